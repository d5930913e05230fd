"""The settings of a project as a form: made from the options themselves, their bounds and help."""

from __future__ import annotations

import math
import tomllib
from typing import Any

from pydantic import TypeAdapter

from texproj.editing.toml import Change, settings_text, settings_version
from texproj.errors import UsageError
from texproj.options import is_expert, meanings
from texproj.project import Project
from texproj.settings import SECTIONS

NOT_HERE = ("preview",)
"""Tables that the page does not change: it is served by them, and who may reach it."""

WHOLE = ("light",)
"""Tables of which the settings for experts are here too: there are few, and no flags for them."""
KINDS = ("string", "boolean", "integer", "number")
"""Types of settings for which there is a field; several of a few are one, too."""

MOST_CHANGES = 100


def settings_form(project: Project) -> dict[str, Any]:
    """The documented settings, table by table: help, kind, bounds, default and present value."""
    given = tomllib.loads(settings_text(project).replace("\r\n", "\n"))
    tables = [
        {"name": name, "help": str(cls.__doc__).strip(), "options": _options(project, name, given)}
        for name, cls in SECTIONS.items()
        if name not in NOT_HERE
    ]
    return {
        "version": settings_version(project),
        "tables": [table for table in tables if table["options"]],
        "excluded": list(project.settings.exclude),
    }


def _options(project: Project, table: str, given: dict[str, Any]) -> list[dict[str, Any]]:
    cls, values = SECTIONS[table], project.settings.table(table)
    schema = TypeAdapter(cls).json_schema()["properties"]
    return [
        {
            "key": key,
            "help": meanings(cls)[key],
            "value": _plain(getattr(values, key)),
            "default": _plain(told.get("default")),
            "given": key in given.get(table, {}),
            **_kind(told),
        }
        for key, told in schema.items()
        if (table in WHOLE or not is_expert(cls, key)) and _is_field(told)
    ]


def _is_field(told: dict[str, Any]) -> bool:
    """Whether the form has a field for an option; a list of any length has none."""
    kinds = [part for part in told.get("anyOf", [told]) if part.get("type") != "null"]
    return all(p.get("type") in KINDS or "enum" in p.get("items", p) or _is_place(p) for p in kinds)


def _is_place(part: dict[str, Any]) -> bool:
    """Whether an option is three numbers."""
    return [item.get("type") for item in part.get("prefixItems", ())] == ["number"] * 3


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _kind(told: dict[str, Any]) -> dict[str, Any]:
    """How an option is asked for: a choice, several of a few, a place, a flag, a number, a text."""
    parts = [part for part in told.get("anyOf", [told]) if part.get("type") != "null"]
    part = parts[0]
    if _is_place(part):
        return {"kind": "place"}
    if part.get("type") == "array":
        return {"kind": "several", "choices": part["items"].get("enum", [])}
    if "enum" in part:
        return {"kind": "choice", "choices": part["enum"]}
    names = {"boolean": "flag", "integer": "integer", "number": "number"}
    bounds = {
        "least": part.get("minimum", part.get("exclusiveMinimum")),
        "most": part.get("maximum", part.get("exclusiveMaximum")),
    }
    return {"kind": names.get(part.get("type", ""), "text"), **bounds}


def parse_changes(data: Any) -> list[Change]:
    """Changes as the page sends them. Raises UsageError for anything else."""
    if not isinstance(data, list) or not 0 < len(data) <= MOST_CHANGES:
        raise UsageError(f"expected a list of 1 to {MOST_CHANGES} changes")
    return [_change(item) for item in data]


def _change(item: Any) -> Change:
    table = item.get("table") if isinstance(item, dict) else None
    key = item.get("key") if isinstance(item, dict) else None
    if not isinstance(table, str) or table not in SECTIONS or table in NOT_HERE:
        raise UsageError("each change needs the name of a table of project.toml")
    if not isinstance(key, str) or key not in vars(SECTIONS[table])["__dataclass_fields__"]:
        raise UsageError(f"each change needs the name of a setting of [{table}]")
    value = item.get("value")
    if not _is_toml(value):
        raise UsageError(f"[{table}] {key} cannot have that value")
    return Change(table, key, value)


MOST_TEXT = 1000


def _is_toml(value: Any) -> bool:
    """Whether a value is one that a setting can have: plain, short, or None to take it out."""
    if isinstance(value, list):
        return len(value) <= MOST_CHANGES and all(_is_item(item) for item in value)
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) < 2**63
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, bool) or _short(value)


def _is_item(value: Any) -> bool:
    """Whether a list of a setting can hold it: a short text, or a number."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return math.isfinite(value) and abs(value) < 2**63
    return isinstance(value, str) and _short(value)


def _short(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_TEXT and value.isprintable()
