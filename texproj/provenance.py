"""What made a model: photos, cameras, program and settings, and whose the photos are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texproj.version import __version__

GENERATOR = f"texproj {__version__}"


@dataclass(frozen=True, eq=False)
class Provenance:
    """copyright: what the photos say of it, one line, empty if they say nothing; facts: all of it
    as JSON has it.
    """

    copyright: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def lines(self) -> tuple[str, ...]:
        """For the comments of formats that hold no more."""
        said = (f"copyright: {self.copyright}",) if self.copyright else ()
        return (GENERATOR, *said)


NOTHING = Provenance()
