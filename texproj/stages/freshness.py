"""What a result was made from, and whether that is still what is there."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from texproj.files import json_hash
from texproj.project import Project

Inputs = dict[str, str]
"""Hashes of a result's inputs by the name under which a person knows them."""

FAILED = "failed, inputs unchanged"


@dataclass(frozen=True)
class Freshness:
    """Whether one item of a stage is there and up to date; `reason` says what changed if it is not.

    failed: it could not be made, and nothing has changed since then.
    """

    stage: str
    item: str
    fresh: bool
    reason: str = ""
    failed: bool = False

    @property
    def settled(self) -> bool:
        """Whether making it again would give the same."""
        return self.fresh or self.failed

    def lines(self) -> list[str]:
        """For people."""
        if self.failed:
            return [f"{self.stage:10} {self.item:24} {self.reason}"]
        because = f": {self.reason}" if self.reason else ""
        return [f"{self.stage:10} {self.item:24} {'fresh' if self.fresh else 'stale'}{because}"]

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return asdict(self)


def options_inputs(project: Project, version: int, *sections: str) -> Inputs:
    """The settings of the named sections as inputs, one each, and the version of the method."""
    hashes = {f"[{s}] settings": json_hash(asdict(project.settings.table(s))) for s in sections}
    return {"method": str(version), **hashes}


def file_inputs(project: Project, **paths: Any) -> Inputs:
    """The contents of files as inputs; a file that is not there is an input too."""
    return {name: project.hash_of(path) or "none" for name, path in paths.items()}


def changed_inputs(
    record: Mapping[str, Any] | None, inputs: Inputs, left_out: Collection[str] = ()
) -> str:
    """Which inputs differ from those of a record; empty if none does. left_out: photos that take
    part no more. What belongs to a photo ("mask of IMG_0001.jpg") is told with it.
    """
    if record is None:
        return "not made yet"
    before = record.get("inputs", {})
    changed = [name for name in inputs if name in before and before[name] != inputs[name]]
    added = _without_parts([name for name in inputs if name not in before])
    gone = _without_parts([name for name in before if name not in inputs])
    out = [name for name in gone if name in left_out]
    words = [f"{', '.join(changed)} changed"] if changed else []
    words += [f"{name} is new" for name in added]
    words += [f"{name} is gone" for name in gone if name not in out]
    words += [f"left out: {', '.join(out)}"] if out else []
    return "; ".join(words)


def _without_parts(names: Sequence[str]) -> list[str]:
    """The names without those of what belongs to another that is there."""
    known = set(names)
    return [
        name
        for name in names
        if (owner := name.rpartition(" of ")[2]) == name or owner not in known
    ]
