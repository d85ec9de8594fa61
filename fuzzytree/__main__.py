"""`python -m fuzzytree` is the command line."""

import sys

from fuzzytree.cli import main

sys.exit(main())
