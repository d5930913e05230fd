"""What all settings have in common: bounds, and values checked against them."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Any, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from texproj.errors import UsageError, excerpt, nearest_name

STRICT = ConfigDict(extra="forbid", use_attribute_docstrings=True)
T = TypeVar("T")

EXPERT = object()
"""Marks an option that only a benchmark or an unusual case sets: project.toml takes it, no flag."""

Positive = Annotated[float, Field(gt=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]


def is_expert(cls: type, name: str) -> bool:
    """Whether an option of `cls` is for experts."""
    return EXPERT in vars(cls)["__pydantic_fields__"][name].metadata


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
        key = ".".join(str(part) for part in first["loc"])
        given = repr(first["input"]) if len(repr(first["input"])) < 60 else excerpt(first["input"])
        message = f"{where}: {key} = {given}: {first['msg'].lower()}"
        raise UsageError(message) from None
