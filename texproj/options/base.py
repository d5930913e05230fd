"""What all settings have in common: bounds, and values checked against them."""

from __future__ import annotations

import ast
import inspect
import textwrap
from dataclasses import fields
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, TypeVar

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
    try:
        return TypeAdapter(cls).validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"] if part not in _KINDS)
        given = repr(first["input"]) if len(repr(first["input"])) < 60 else excerpt(first["input"])
        message = f"{where}: {key} = {given}: {_WORDS.get(first['type'], first['msg'].lower())}"
        raise UsageError(message) from None
