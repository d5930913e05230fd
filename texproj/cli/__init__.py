"""The command line: it parses, calls a stage, and says what came of it."""

import os
import signal
import sys
import threading
from collections.abc import Sequence
from types import FrameType
from typing import Any

# Stages divide their work among threads of their own; those of BLAS only spin beside them (a tenth
# of the processor time of coloring). Read when numpy is loaded; a value of the user's stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from texproj.cli.exits import STOP, STOPPED

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (those of the process by default); return the exit code.

    Whoever stops it is answered in a sentence at any moment, also while modules are loaded.
    """
    STOP.clear()
    before = _listen()
    try:
        from texproj.cli.program import run  # noqa: PLC0415 - stopping is answered meanwhile

        return run(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("texproj: stopped; the next run goes on where this one was\n")
        return STOPPED
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _listen() -> dict[int, Any]:
    """Answer the signals that ask to stop; returns what answered them before."""
    if threading.current_thread() is not threading.main_thread():
        return {}  # signals are heard in the main thread alone
    return {number: signal.signal(number, _stop) for number in (signal.SIGINT, signal.SIGTERM)}


def _stop(_: int, __: FrameType | None) -> None:
    STOP.set()
    raise KeyboardInterrupt
