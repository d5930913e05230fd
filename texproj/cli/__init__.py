"""The command line: it parses, calls a stage, and says what came of it."""

import os

# Stages divide their work among threads of their own; those of BLAS only spin beside them (a tenth
# of the processor time of coloring). Read when numpy is loaded; a value of the user's stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from texproj.cli.main import main

__all__ = ["main"]
