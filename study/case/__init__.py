"""One case: from candidate and force to contact, friction, limit surface and score."""
