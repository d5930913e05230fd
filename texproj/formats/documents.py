"""Text, JSON and XML of any hand: what is broken ends in one sentence, never in a traceback."""

from __future__ import annotations

import codecs
import json
import math
import re
import stat
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from texproj.errors import InputError, excerpt

MOST_BYTES = 2 << 30
"""Files of text are read whole: beyond this they do not fit beside what is made of them."""

MOST_NESTED = 100
"""Levels of JSON and XML: real files have ten, and every walk over them is by recursion."""

LONGEST_INTEGER = 20
"""Digits up to which a number of JSON stays an integer; 2**64 has twenty."""

_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"), (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"),
)  # fmt: skip
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_HALF_PAIR = re.compile(r"\\u[dD][89a-fA-F]")


def read_bytes(path: Path, most: int = MOST_BYTES) -> bytes:
    """The content of a file of at most so many bytes. Raises InputError."""
    try:
        found = path.stat()
        if found.st_size <= most and stat.S_ISREG(found.st_mode):
            return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise InputError(f"{path}: cannot be read ({_reason(error)})") from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path}: not a file")
    raise InputError(f"{path}: larger than {most / 1e6:.0f} MB: no such file is read")


def _reason(error: OSError | ValueError) -> str:
    return str(getattr(error, "strerror", None) or error)


def read_text(path: Path, most: int = MOST_BYTES) -> str:
    r"""The text of a file; lines end with ``\n`` however the file ends them.

    UTF-8, or UTF-16 and UTF-32 with a byte order mark; what is none of these is taken for
    Windows' western code page 1252, in which spreadsheets save. Raises InputError.
    """
    text = text_of(read_bytes(path, most), f"{path}")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_lines(path: Path, most: int = MOST_BYTES) -> list[str]:
    """The lines of a text file without their ends. Raises InputError; see `read_text`."""
    return read_text(path, most).split("\n")


def text_of(data: bytes, where: str, fallback: str | None = "cp1252") -> str:
    """The text in `data`, decoded by its byte order mark, else as UTF-8, else by `fallback`.

    Raises InputError that names `where`, for binary data too.
    """
    mark, encoding = next(((m, e) for m, e in _BYTE_ORDER_MARKS if data.startswith(m)), (b"", ""))
    for name in [encoding] if encoding else ["utf-8", fallback]:
        try:
            text = data[len(mark) :].decode(name) if name else None
        except UnicodeDecodeError:
            continue
        if text is not None and "\0" not in text:
            return text
    raise InputError(f"{where}: not a text file in UTF-8; save it as one")


def finite_number(word: str) -> float | None:
    """The number that a word of a text file means, None where it is none or not finite.

    Stricter than Python, which takes 1_0, digits of every script, nan and infinity.
    """
    word = word.strip()
    if not _NUMBER.fullmatch(word):
        return None
    number = float(word)
    return number if math.isfinite(number) else None


def read_json(path: Path) -> Any:
    """The value of a JSON file. Raises InputError; see `json_of`."""
    return json_of(read_bytes(path), f"{path}")


def json_of(data: bytes | str, where: str) -> Any:
    """The value of a JSON text.

    Integers of more than 20 digits become floats, and numbers may be NaN or infinite, as other
    programs write them: who reads a number checks it. Raises InputError that names `where` and
    the line, for what is nested too deeply and for halves of characters, too.
    """
    text = data if isinstance(data, str) else text_of(data, where, fallback=None)
    try:
        value = json.loads(text, parse_int=_integer)
    except json.JSONDecodeError as error:
        raise InputError(f"{where}, line {error.lineno}: not JSON ({error.msg})") from None
    except RecursionError:
        raise InputError(_too_deep(where)) from None
    if _HALF_PAIR.search(text):
        try:
            json.dumps(value, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise InputError(f"{where}: a text in it holds half of a character (\\ud...)") from None
        except RecursionError:
            raise InputError(_too_deep(where)) from None
    level = [value]
    for _ in range(MOST_NESTED):
        level = [child for parent in level for child in _nested(parent)]
        if not level:
            return value
    raise InputError(_too_deep(where))


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)


def _nested(value: Any) -> list[Any]:
    """What is in `value` and may hold more."""
    children = (
        value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    )
    return [child for child in children if isinstance(child, dict | list)]


def _too_deep(where: str) -> str:
    return f"{where}: nested more than {MOST_NESTED} levels deep: no such file is read"


def read_xml(path: Path) -> ET.Element:
    """The root of an XML file. Raises InputError; see `xml_of`."""
    return xml_of(read_bytes(path), f"{path}")


def xml_of(data: bytes, where: str) -> ET.Element:
    """The root of an XML text in any encoding that expat knows (UTF-8, UTF-16, one byte each).

    By the standard library: it never opens what an entity names, and expat (2.4.1 and later,
    which every supported Python has) stops entities that multiply. Raises InputError that names
    `where` and the line, for what is nested too deeply, too.
    """
    try:
        root = ET.fromstring(data)
    except ET.ParseError as error:
        raise InputError(f"{where}: not XML ({error})") from None
    except (ValueError, LookupError) as error:  # encodings of several bytes, and unknown ones
        raise InputError(
            f"{where}: its encoding cannot be read ({excerpt(str(error))}); save it in UTF-8"
        ) from None
    level = [root]
    for _ in range(MOST_NESTED):
        level = [child for parent in level for child in parent]
        if not level:
            return root
    raise InputError(_too_deep(where))
