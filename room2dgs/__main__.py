"""`python -m room2dgs VERB ...`: the command `room2dgs`, where no script of that name is installed."""

import sys

from room2dgs.cli import main

if __name__ == "__main__":
    sys.exit(main())
