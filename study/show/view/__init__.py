"""Results in three dimensions: the map on the object, pads, pressure, friction, deformed wall and limit surface."""
