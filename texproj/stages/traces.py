"""How each photo's entry came about, kept in work/register: one file a photo.

Photos that were placed together name each other; that list is kept once for all of them, so that
what is kept grows with the photos and not with their square.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from texproj.files import json_hash
from texproj.project import Project
from texproj.stages.freshness import Inputs
from texproj.stages.methods import READS

STAGE = "register"
FOLDER = "block"
"""Where in work/ the photos of each block are listed."""
LIST = re.compile("photos-[0-9a-f]{32}")
"""Names of such lists."""

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Trace:
    """How an entry came about.

    asked: the method of the settings; tried: the methods that ran, in their order; block: the
    photos that were placed together with this one; inputs: what those methods read.
    """

    asked: str
    tried: Names
    block: Names
    inputs: Inputs

    def as_dict(self) -> dict[str, Any]:
        """As it is kept: the block by the name of its list."""
        return {**asdict(self), "block": list_of(self.block) if self.block else ""}


def list_of(block: Names) -> str:
    """The name of the list of a block's photos."""
    return f"photos-{json_hash(block)}"


def read_traces(project: Project, names: Iterable[str]) -> dict[str, Trace | None]:
    """The traces of photos; None where there is none, or one that is not understood."""
    blocks: dict[str, Names] = {}
    return {name: _read(project, name, blocks) for name in names}


def _read(project: Project, name: str, blocks: dict[str, Names]) -> Trace | None:
    told = project.load_record(STAGE, name)
    if told is None:
        return None
    tried, block = told.get("tried"), told.get("block")
    tried = tried if isinstance(tried, list) and set(map(str, tried)) <= READS.keys() else []
    if isinstance(block, str) and LIST.fullmatch(block):
        if block not in blocks:
            kept = project.load_record(FOLDER, block) or {}
            blocks[block] = _names(kept.get("photos"))
        return Trace(str(told.get("asked")), tuple(tried), blocks[block], told["inputs"])
    return Trace(str(told.get("asked")), tuple(tried), _names(block), told["inputs"])


def _names(value: Any) -> Names:
    """A list of names; empty for what is none. Version 0.2 kept the list with each photo."""
    return tuple(n for n in value if isinstance(n, str)) if isinstance(value, list) else ()


def keep_blocks(project: Project, traces: Mapping[str, Trace]) -> None:
    """Keep the lists of photos that traces name, before the traces. Raises OutputError."""
    for block in {trace.block for trace in traces.values() if trace.block}:
        if project.load_record(FOLDER, list_of(block)) is None:
            project.save_record(FOLDER, list_of(block), {"inputs": {}, "photos": list(block)})
