"""In how many random positions a decision is tried; ``make test-long`` asks for more by the variable TURNS."""

import os

TURNS = int(os.environ.get("TURNS", 20))
