"""What accuracy costs in time: knobs, their measurement, and the choice of settings that meet a target."""
