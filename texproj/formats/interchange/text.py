"""Reading text, XML and JSON of other programs, with one sentence for what is broken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from texproj.errors import InputError


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises InputError."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, with or without a byte order mark. Raises InputError."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None


def read_json(path: Path) -> dict[str, Any]:
    """The object of a JSON file. Raises InputError."""
    try:
        value = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}, line {error.lineno}: not JSON ({error.msg})") from None
    if not isinstance(value, dict):
        raise InputError(f"{path}: an object in braces expected")
    return value


def read_xml(path: Path) -> ET.Element:
    """The root of an XML file. Raises InputError."""
    try:
        return ET.fromstring(read_bytes(path))
    except ET.ParseError as error:
        raise InputError(f"{path}: not XML ({error})") from None


def member(value: Any, key: str, where: str) -> Any:
    """An entry of a JSON object. Raises InputError where there is none."""
    if not isinstance(value, dict) or key not in value:
        raise InputError(f"{where}: no {key!r}")
    return value[key]


def members(value: Any, key: str, where: str) -> list[Any]:
    """An entry that is a list. Raises InputError where it is none."""
    found = member(value, key, where)
    if not isinstance(found, list):
        raise InputError(f"{where}: {key!r} must be a list")
    return found
