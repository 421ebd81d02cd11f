"""The program, as ``python -m mechid``."""

import sys

from ._program import main

sys.exit(main())
