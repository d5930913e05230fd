"""Values in the files of other programs, with one sentence for what is missing or another kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from texproj.errors import InputError
from texproj.formats.documents import read_json


def read_object(path: Path) -> dict[str, Any]:
    """The object of a JSON file. Raises InputError."""
    value = read_json(path)
    if not isinstance(value, dict):
        raise InputError(f"{path}: an object in braces expected")
    return value


def member(value: Any, key: str, where: str) -> Any:
    """An entry of a JSON object. Raises InputError where there is none."""
    if not isinstance(value, dict) or key not in value:
        raise InputError(f"{where}: no {key!r}")
    return value[key]


def members(value: Any, key: str, where: str, default: list[Any] | None = None) -> list[Any]:
    """An entry that is a list; `default` where there is none. Raises InputError."""
    if default is not None and isinstance(value, dict) and value.get(key) is None:
        return default
    found = member(value, key, where)
    if not isinstance(found, list):
        raise InputError(f"{where}: {key!r} must be a list")
    return found


def word(value: Any, key: str, where: str) -> str:
    """An entry that is a text. Raises InputError."""
    found = member(value, key, where)
    if not isinstance(found, str):
        raise InputError(f"{where}: {key!r} must be a text")
    return found


def identity(value: Any, key: str, where: str) -> str:
    """An entry by which others refer to it: a number or a text. Raises InputError."""
    found = member(value, key, where)
    if isinstance(found, bool) or not isinstance(found, int | float | str):
        raise InputError(f"{where}: {key!r} must be a number or a text")
    return str(found)


def whole(text: str) -> int | None:
    """The number that a text of plain digits is; None for any other text."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) < 20 else None
