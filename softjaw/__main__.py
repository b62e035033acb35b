"""``python -m softjaw`` and ``softjaw`` are the same program."""

from __future__ import annotations

import sys

from softjaw.study.cli import main

if __name__ == "__main__":
    sys.exit(main())
