"""Names of a package whose modules are loaded when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def when_used(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """A `__getattr__` (PEP 562) for a package. homes: the module of each public name.

    Raises ValueError for a name of a module in the package: loading that would put it in the place
    of what is meant.
    """
    if hidden := [name for name, home in homes.items() if home == f"{package}.{name}"]:
        raise ValueError(f"{package}: {', '.join(hidden)} would be hidden by modules of that name")

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return load
