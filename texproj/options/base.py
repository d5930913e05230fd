"""What all settings have in common: bounds, and values checked against them."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import fields
from functools import cache
from itertools import pairwise
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from texproj.errors import UsageError, excerpt, nearest_name

STRICT = ConfigDict(extra="forbid")
T = TypeVar("T")

EXPERT = object()
"""Marks an option that only a benchmark or an unusual case sets: project.toml takes it, no flag."""

Positive = Annotated[float, Field(gt=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]


_KINDS = ("constrained-float",)
"""What pydantic calls one of several kinds of values that an option may have."""

_WORDS = {"tuple_type": "must be a list: [1, 2, 3], say"}
"""By kind of error, where pydantic speaks of Python."""

_LENGTHS = ("missing", "too_long")
"""What pydantic calls a list that is too short, which it takes for missing fields, or too long."""


def is_expert(cls: type, name: str) -> bool:
    """Whether an option of `cls` is for experts."""
    return EXPERT in vars(cls)["__pydantic_fields__"][name].metadata


@cache
def meanings(cls: type) -> dict[str, str]:
    """What each option of `cls` means, in one line: the string below it. Read from the source when
    somebody asks, because pydantic's own reading costs every command a twelfth of its start.
    """
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(definition, ast.ClassDef)
    return {
        option.target.id: " ".join(text.value.value.split())
        for option, text in pairwise(definition.body)
        if isinstance(option, ast.AnnAssign)
        and isinstance(option.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


def options_from(cls: type[T], values: dict[str, Any], where: str) -> T:
    """`cls` with `values` over its defaults.

    Raises UsageError that names `where`, the key and the nearest known key or the bound.
    """
    known = [f.name for f in fields(cls)]  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise UsageError(f"{where}: unknown key {excerpt(key)!r}{nearest_name(key, known)}")
    meant = {key: _meant(cls, key, value, where) for key, value in values.items()}
    try:
        return TypeAdapter(cls).validate_python(meant)
    except ValidationError as error:
        first = error.errors()[0]
        parts, words = list(first["loc"]), _WORDS.get(first["type"], first["msg"].lower())
        if first["type"] in _LENGTHS:
            parts, count = parts[:1], len(get_args(_kind(cls, str(parts[0]), tuple)))
            words = f"must be a list of {count} numbers"
        key = ".".join(str(part) for part in parts if part not in _KINDS)
        raise UsageError(f"{where}: {key} = {_shown(first['input'])}: {words}") from None


def _shown(value: Any) -> str:
    return repr(value) if len(repr(value)) < 60 else excerpt(value)


def _meant(cls: type, key: str, value: Any, where: str) -> Any:
    """What a person means: one value of a list that may have any length is a list of one, true and
    false are "on" and "off" where these are choices. Raises UsageError for true and false where a
    number is wanted, which they would silently become.
    """
    lists = _kind(cls, key, tuple)
    if not isinstance(value, bool):
        alone = lists is not None and get_args(lists)[-1] is Ellipsis
        return [value] if alone and isinstance(value, str | int) else value
    if _kind(cls, key, bool) is not None:
        return value
    words = {word for literal in _kinds(cls, key) for word in get_args(literal)}
    if {"on", "off"} <= words:
        return "on" if value else "off"
    told = str(value).lower()
    raise UsageError(f"{where}: {key} = {told}: {told} is no value that it can have")


def _kinds(cls: type, key: str) -> list[Any]:
    """The types that an option may have, without their bounds."""
    waiting, found = [vars(cls)["__pydantic_fields__"][key].annotation], []
    while waiting:
        kind = waiting.pop()
        if get_origin(kind) is Annotated:
            waiting.append(get_args(kind)[0])
        elif get_origin(kind) in (Union, UnionType):
            waiting += get_args(kind)
        else:
            found.append(kind)
    return found


def _kind(cls: type, key: str, wanted: type) -> Any:
    """Which of the types of an option is `wanted`, with what it is made of; None if none is."""
    found = [kind for kind in _kinds(cls, key) if wanted in (kind, get_origin(kind))]
    return found[0] if found else None
