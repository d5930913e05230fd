"""`python -m texproj`."""

import sys

from texproj.cli import main

sys.exit(main())
