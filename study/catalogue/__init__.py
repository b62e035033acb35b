"""A catalogue: many small scenes in one file, each with the outcome that is right for it."""
