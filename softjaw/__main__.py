"""``python -m softjaw`` and ``softjaw`` are the same program."""

import sys

from softjaw.study.cli import main

if __name__ == "__main__":
    sys.exit(main())
