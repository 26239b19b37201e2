"""`python -m glcaustics`: the same as the `glcaustics` command."""

from __future__ import annotations

import sys

from glcaustics.cli import main

sys.exit(main())
