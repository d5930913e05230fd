"""Keys of project.toml changed one by one; comments, order and spelling of all else stay."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from texproj.errors import InputError, UsageError, excerpt
from texproj.files import content_hash, write_atomically
from texproj.project import SETTINGS_FILE, Project
from texproj.settings import SECTIONS, read_settings

TOP = ""
"""Stands for the keys before any table."""


@dataclass(frozen=True)
class Change:
    """One key. table: its name, `TOP` for none; value: None takes the key out again."""

    table: str
    key: str
    value: Any


def settings_text(project: Project) -> str:
    """What stands in project.toml, its line ends as they are. Raises InputError."""
    path = project.root / SETTINGS_FILE
    try:
        return path.read_bytes().decode("utf-8-sig") if path.exists() else ""
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path} cannot be read as text in UTF-8") from None


def settings_version(project: Project) -> str:
    """Another word for another project.toml."""
    return content_hash(settings_text(project).encode())


def change_settings(project: Project, changes: Iterable[Change]) -> Project:
    """Write the changes to project.toml; the project with them.

    Raises UsageError, with nothing written, for a key or value that cannot be, InputError where the
    project could not be opened with them, OutputError.
    """
    text, path = settings_text(project), project.root / SETTINGS_FILE
    made = list(changes)
    new = edited(text, made, str(path))
    changed = project.with_settings(read_settings(new, str(path)))
    if any(change.table == TOP for change in made):
        _ = changed.photo_paths  # left out are photos that are there, and not all of them
    write_atomically(path, new.encode())
    return changed


def leave_out(project: Project, names: Sequence[str], out: bool) -> Project:
    """Leave photos out of everything, or take them back. Raises as `change_settings`."""
    before = list(project.settings.exclude)
    after = [n for n in before if n not in names] + (list(dict.fromkeys(names)) if out else [])
    if sorted(after) == sorted(before):
        return project
    return change_settings(project, [Change(TOP, "exclude", after or None)])


def edited(text: str, changes: Iterable[Change], where: str) -> str:
    """The TOML `text` with the changes. Raises InputError for a text that cannot be edited so that
    all else in it stays.
    """
    made = list(changes)
    wanted = _plain(text, where)
    for change in made:
        _put(wanted, change)
    try:
        document = tomlkit.parse(text)
        for change in made:
            _put(document, change)
        new = tomlkit.dumps(document)
    except (TOMLKitError, ValueError, TypeError, AttributeError):
        raise InputError(f"{where} cannot be edited here; open it in an editor") from None
    if "\r\n" in text:  # as it is written, new keys too
        new = new.replace("\r\n", "\n").replace("\n", "\r\n")
    if _without_empty(_plain(new, where)) != _without_empty(wanted):
        raise InputError(
            f"{where} is written in a way that cannot be edited here; open it yourself"
        )
    return new


def _plain(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} is not valid TOML: {excerpt(str(error))}") from None


def _put(document: Any, change: Change) -> None:
    """Set or take out a key of a plain dictionary or of a document of tomlkit."""
    if change.table != TOP and change.table not in SECTIONS:
        raise UsageError(f"no table {excerpt(change.table)!r} in project.toml")
    place = document
    if change.table != TOP:
        if change.table not in document:
            if change.value is None:
                return
            document[change.table] = tomlkit.table() if hasattr(document, "as_string") else {}
        place = document[change.table]
    if change.value is None:
        place.pop(change.key, None)
    else:
        place[change.key] = change.value


def _without_empty(data: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in data.items() if value != {}}
