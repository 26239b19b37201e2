"""`python -m bench ...` from the checkout: the same as `glcaustics bench ...`."""

import sys

from glcaustics.cli import main

if __name__ == "__main__":
    sys.exit(main(["bench", *sys.argv[1:]]))
