"""The figures of the paper, redrawn from results of the shipped scenes; `drawing` lists them."""

from pathlib import Path

JOBS = Path(__file__).parents[4] / "jobs"
WIDTH = 8.5  # of every figure [in]
