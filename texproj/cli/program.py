"""The program: exit codes, and one sentence instead of a traceback."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from texproj.cli import talk
from texproj.cli.exits import DONE, STOP, UNUSABLE
from texproj.errors import TexprojError
from texproj.stages.progress import Cancelled

LOG = logging.getLogger("texproj")


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line `arguments` (those of the process by default); return the exit code.

    Raises KeyboardInterrupt where somebody asked to stop.
    """
    from texproj.cli.commands import app  # noqa: PLC0415 - keeps `import texproj.cli` light

    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _call(app, words)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of our output went away, e.g. `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    return code


def _call(app: App, words: list[str]) -> int:
    if not words or words[0] in app.help_flags:
        for name in app:
            app[name]  # loads it: the list of commands says what each does
    try:
        result = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        return _refuse(words, f"{error} (see `texproj {_command(app, words)}--help`)")
    except TexprojError as error:
        return _refuse(words, str(error))
    except ModuleNotFoundError as error:
        if (error.name or "texproj").startswith("texproj"):
            raise
        return _refuse(words, _lacking(str(error.name)))
    except BrokenPipeError:
        raise
    except OSError as error:
        return _refuse(words, _told(error))
    except MemoryError:
        return _refuse(words, "not enough memory; close other programs, or use smaller photos")
    except Cancelled:
        raise KeyboardInterrupt from None
    except Exception as error:
        if STOP.is_set():
            raise KeyboardInterrupt from error
        return _refuse(words, _fault(error))
    return result if isinstance(result, int) else DONE


def _refuse(words: list[str], sentence: str) -> int:
    if "--json" in words:
        talk.say_json({"error": sentence})
    talk.complain(" ".join(sentence.split()))
    return UNUSABLE


def _fault(error: Exception) -> str:
    """What nobody foresaw, for people; the traceback for those who asked for details."""
    LOG.info("internal fault", exc_info=error)
    return (
        f"internal fault ({type(error).__name__}: {error}), please report; details in"
        " work/log/texproj.log of the project, or with -v"
    )


def _lacking(package: str) -> str:
    """Why a package may be missing, and how to get it."""
    from texproj.doctor import missing_package  # noqa: PLC0415 - where nothing lacks, not needed

    finding = missing_package(package)
    return f"the package {package} is {finding.detail}; {finding.remedy}"


def _told(error: OSError) -> str:
    """What the system refused that no stage has foreseen: a full temporary folder, for example."""
    place = f"{error.filename}: " if error.filename else ""
    return f"{place}{error.strerror or error}"


def _command(app: App, words: list[str]) -> str:
    known = bool(words) and not words[0].startswith("-") and words[0] in app
    return f"{words[0]} " if known else ""
