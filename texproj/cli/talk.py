"""What a command says: results on standard output, complaints on standard error.

Names of files and texts in them are of any hand: nothing in them commands the terminal.
"""

from __future__ import annotations

import json
import logging
import sys
from typing import Any

from texproj.errors import printable


def say(text: str = "") -> None:
    """One line of the result, for a person."""
    sys.stdout.write(printable(text) + "\n")


def complain(text: str) -> None:
    """One line about what went wrong."""
    sys.stderr.write(f"texproj: {printable(text)}\n")


def note(text: str) -> None:
    """One line about what a person may not expect."""
    sys.stderr.write(f"note: {printable(text)}\n")


def tell_progress(text: str) -> None:
    """One line about how far the work is."""
    sys.stderr.write(f"{printable(text)}\n")
    sys.stderr.flush()


def say_json(value: Any) -> None:
    """The result, for a machine."""
    sys.stdout.write(json.dumps(value, indent=1, default=str) + "\n")


def talk_about_details(wanted: bool) -> None:
    """With -v: what happens inside, on standard error."""
    if wanted:
        logging.basicConfig(stream=sys.stderr, format="%(relativeCreated)7.0f ms  %(message)s")
        logging.getLogger("texproj").setLevel(logging.INFO)
