"""The command line: it parses, calls a stage, and says what came of it."""

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

# Stages divide their work among threads of their own; those of BLAS only spin beside them (a tenth
# of the processor time of coloring). Read when numpy is loaded; a value of the user's stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__all__ = ["main"]

STOPPED = 130
"""Exit code where somebody asked to stop: by Ctrl-C, or with SIGTERM."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (those of the process by default); return the exit code.

    Whoever stops it is answered in a sentence at any moment, also while modules are loaded.
    """
    try:
        before = signal.signal(signal.SIGTERM, _stop)
    except ValueError:  # not in the main thread, where signals are heard
        before = None
    try:
        from texproj.cli.program import run  # noqa: PLC0415 - stopping is answered meanwhile

        return run(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("texproj: stopped; the next run goes on where this one was\n")
        return STOPPED
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)


def _stop(_: int, __: FrameType | None) -> None:
    raise KeyboardInterrupt
