"""`python -m dojo_opt`: the same as the console script `dojo-opt`."""

import sys

from dojo_opt.cli import main

if __name__ == "__main__":
    sys.exit(main())
