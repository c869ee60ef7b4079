"""`python -m camopt` is the command line."""

import sys

from camopt.cli.parser import main

if __name__ == "__main__":
    sys.exit(main())
