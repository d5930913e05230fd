"""What a command says: results on standard output, complaints on standard error."""

from __future__ import annotations

import json
import logging
import sys
from typing import Any


def say(text: str = "") -> None:
    """One line of the result, for a person."""
    sys.stdout.write(text + "\n")


def complain(text: str) -> None:
    """One line about what went wrong."""
    sys.stderr.write(f"texproj: {text}\n")


def note(text: str) -> None:
    """One line about what a person may not expect."""
    sys.stderr.write(f"note: {text}\n")


def tell_progress(text: str) -> None:
    """One line about how far the work is."""
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def say_json(value: Any) -> None:
    """The result, for a machine."""
    sys.stdout.write(json.dumps(value, indent=1, default=str) + "\n")


def talk_about_details(wanted: bool) -> None:
    """With -v: what happens inside, on standard error."""
    if wanted:
        logging.basicConfig(stream=sys.stderr, format="%(relativeCreated)7.0f ms  %(message)s")
        logging.getLogger("texproj").setLevel(logging.INFO)
