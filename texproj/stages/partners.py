"""Which photos show the same, and which look alike: found once, kept in work/ from run to run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from texproj.errors import InputError
from texproj.files import content_hash
from texproj.project import Project
from texproj.register.block.graph import PhotoGraph
from texproj.stages.attending import attended
from texproj.stages.progress import Progress

if TYPE_CHECKING:
    from texproj.arrays import Floats
    from texproj.stages.bench import Workbench

FOLDER, SHARED, ALIKE = "block", "graph", "alike"
STAGE = "comparing photos"
MOST_ALIKE = 30
"""Photos that are kept of those that look like one, the most alike first."""
SAMPLED_EACH, COMPARED_EACH = 200, 1000
"""Descriptors of each photo for finding typical ones, and for comparing it with others."""


def content_key(project: Project, name: str) -> str:
    """Another word for other content of the photo or of its mask."""
    parts = (project.hash_of(project.photo_path(name)), project.hash_of(project.mask_files(name)))
    return content_hash("-".join(map(str, parts)).encode())


@dataclass(frozen=True)
class Partner:
    """A photo that shows the same as another. matches: points that were found in both, verified by
    the geometry of two views; None where the two only look alike and were not matched yet.
    """

    name: str
    matches: int | None


def partners(project: Project, name: str) -> tuple[Partner, ...]:
    """The photos that show the same as photo `name`: first those in which something of it was
    found again, most of it first, then those that look like it, the most alike first; none where
    the photos were not compared yet. Reads what is kept and computes nothing.
    """
    graph = load_graph(project)
    found = [Partner(other, graph.count(name, other)) for other in graph.neighbors(name)]
    told = _looks(project).get(name, ())
    return (*found, *(Partner(n, None) for n in told if not graph.knows(name, n)))


def load_graph(project: Project) -> PhotoGraph:
    """What was matched between the photos, as far as they are still the same."""
    told, same = _kept(project, SHARED)
    found = {}
    for pair in told.get("pairs", ()):
        match pair:
            case [str(a), str(b), int(n)] if a in same and b in same:
                found[a, b] = n
    return PhotoGraph(found, frozenset(same))


def keep_graph(project: Project, graph: PhotoGraph) -> None:
    """Keep what was matched between photos, beside what is known of others. Raises OutputError."""
    joined = load_graph(project).joined(graph)
    pairs = [[a, b, n] for (a, b), n in sorted(joined.matches.items())]
    keys = {name: content_key(project, name) for name in sorted(joined.compared)}
    project.save_record(FOLDER, SHARED, {"inputs": keys, "pairs": pairs})


def companions(project: Project) -> dict[str, tuple[str, ...]]:
    """By photo, the others that show the same, by what was matched, or else by their looks; the
    best first. Reads what is kept and computes nothing.
    """
    found, graph = _looks(project), load_graph(project)
    for name in project.photo_names:
        found[name] = tuple(dict.fromkeys([*graph.neighbors(name), *found.get(name, ())]))
    return {name: others for name, others in found.items() if others}


def _looks(project: Project) -> dict[str, tuple[str, ...]]:
    """By photo, the others that look like it, as far as all are still the same."""
    told, same = _kept(project, ALIKE)
    alike = told.get("alike", {})
    known = {n: alike[n] for n in project.photo_names if n in same and _is_list(alike.get(n))}
    return {
        name: tuple(other for other in known.get(name, ()) if other in same)
        for name in project.photo_names if name in same
    }  # fmt: skip


def _is_list(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, str) for item in value)


def compare_looks(bench: Workbench, progress: Progress) -> None:
    """Find out for all photos which others look like them, and keep it. Raises OutputError."""
    from texproj.solve.retrieval import most_alike  # noqa: PLC0415 - slow to load

    project = bench.project
    rows: dict[str, Floats] = {}
    names = project.photo_names
    for done, name in enumerate(names):
        progress(STAGE, done, len(names), name)
        try:
            found = attended(name, partial(bench.features, name)).descriptors
        except InputError:  # its own entry says why it cannot be used
            continue
        if len(found):
            rows[name] = found[:: max(1, len(found) // COMPARED_EACH)].astype(np.float16)
    told = _by_name(list(rows), most_alike(list(rows.values()), SAMPLED_EACH, MOST_ALIKE))
    keys = {name: content_key(project, name) for name in rows}
    project.save_record(FOLDER, ALIKE, {"inputs": keys, "alike": told})


def _by_name(names: Sequence[str], numbers: Sequence[Sequence[int]]) -> dict[str, list[str]]:
    pairs = zip(names, numbers, strict=True)
    return {name: [names[k] for k in others] for name, others in pairs}


def _kept(project: Project, what: str) -> tuple[dict[str, Any], dict[str, str]]:
    """A record, and the keys of its photos that are in the project unchanged."""
    told = project.load_record(FOLDER, what) or {"inputs": {}}
    return told, {n: key for n, key in told["inputs"].items() if _is_still(project, n, key)}


def _is_still(project: Project, name: str, key: str) -> bool:
    """Whether a photo is in the project and its content is that of `key`."""
    try:
        return name in project.photo_paths and content_key(project, name) == key
    except InputError:  # two masks; whoever needs the photo says so
        return False
