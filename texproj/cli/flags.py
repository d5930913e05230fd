"""Command-line flags made from the option classes, so that each default lives once.

A flag that is not given leaves what project.toml says; that leaves the default of the option.
"""

from __future__ import annotations

from dataclasses import Field, asdict, field, fields, make_dataclass
from typing import Annotated, Any, get_type_hints

from cyclopts import Parameter

from texproj.options import is_expert, meanings, options_from
from texproj.settings import SECTIONS, Settings


def flags_for(flat: tuple[str, ...], nested: tuple[str, ...] = ()) -> Any:
    """An annotation that adds flags for sections of project.toml to a command.

    The options of `flat` sections become `--option`, those of `nested` ones `--section.option`.
    """
    columns: list[Any] = [
        (name, hint, field(default=None, metadata={"section": section}))
        for section in flat
        for name, hint in _flags(section)
    ]
    for section in nested:
        holder = _dataclass(f"{section.title().replace('-', '')}Flags", _columns(section))
        hint: Any = Annotated[holder | None, Parameter(name=section)]
        name = section.replace("-", "_")
        columns.append((name, hint, field(default=None, metadata={"table": section})))
    combined = _dataclass("Flags", columns)
    return Annotated[combined | None, Parameter(name="*")]


def apply_flags(settings: Settings, flags: Any) -> Settings:
    """`settings` with the flags that were given over it. Raises UsageError for a bad value."""
    if flags is None:
        return settings
    for section, given in _given(flags).items():
        values = {**asdict(settings.table(section)), **given}
        options: Any = options_from(SECTIONS[section], values, "command line")
        settings = settings.with_table(section, options)
    return settings


def _given(flags: Any) -> dict[str, dict[str, Any]]:
    """The values that were given, by section."""
    given: dict[str, dict[str, Any]] = {}
    for column in fields(flags):
        value = getattr(flags, column.name)
        if value is None:
            continue
        if "section" in column.metadata:
            given.setdefault(column.metadata["section"], {})[column.name] = value
        else:
            values = {k: v for k, v in asdict(value).items() if v is not None}
            given.setdefault(column.metadata["table"], {}).update(values)
    return given


def _columns(section: str) -> list[Any]:
    return [(name, hint, field(default=None)) for name, hint in _flags(section)]


def _flags(section: str) -> list[tuple[str, Any]]:
    """Name and optional, documented type of each option of a section, but those for experts."""
    cls = SECTIONS[section]
    hints = get_type_hints(cls)
    shown = [f for f in fields(cls) if not is_expert(cls, f.name)]
    return [(f.name, _flag(cls, f, hints[f.name])) for f in shown]


def _flag(cls: type, option: Field[Any], hint: Any) -> Any:
    shown = "none" if option.default is None else option.default
    return Annotated[
        hint | None, Parameter(help=f"{meanings(cls)[option.name]} [default: {shown}]")
    ]


def _dataclass(name: str, columns: list[Any]) -> type:
    made = make_dataclass(name, columns, frozen=True)
    made.__module__ = __name__
    return made
