"""A pressure field from elsewhere, judged by the definitions of the study: read, evaluated, reported."""
