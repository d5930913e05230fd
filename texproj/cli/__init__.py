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
# No plugin of pydantic takes part in settings; to look for them it reads what is known of every
# package that is installed, a twelfth of the time of `status`.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

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
    except (Exception, KeyboardInterrupt) as error:
        # A library may have turned the request into an error of its own.
        if not (STOP.is_set() or isinstance(error, KeyboardInterrupt)):
            raise
        sys.stderr.write("texproj: stopped; what was done is kept: the same command goes on\n")
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
    raise _Stopped


class _Stopped(KeyboardInterrupt):
    """A request to stop, of a class of its own.

    A plain KeyboardInterrupt that passes through `exec` of a text (as loading modules does) makes
    CPython end the process by SIGINT at its very end, in place of the code that `main` returned.
    """
