"""``python -m fem_biobot`` is the command ``fem-biobot``."""

import sys

from fem_biobot.cli import main

if __name__ == "__main__":
    sys.exit(main())
