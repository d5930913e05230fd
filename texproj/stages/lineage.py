"""What each photo's registration was made from, and which of them still hold: one value per run."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any

from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.choosing import said_of
from texproj.stages.entries import Entries, camera_hash, own_registration, start_of
from texproj.stages.freshness import FAILED, Freshness, Inputs, changed_inputs, file_inputs
from texproj.stages.methods import AUTO, MOST_COMPARED, READS
from texproj.stages.partners import companions

STAGE = "register"
VERSION = 2
OTHERS = "other registered photos"
FAULT = "internal_fault"
"""Key of an entry's quality: nobody foresaw why it failed, so it is tried again."""


@dataclass(frozen=True, eq=False)
class Trace:
    """How an entry came about; kept in work/register, one file a photo.

    asked: the method of the settings; tried: the methods that ran, in their order; block: the
    photos that were placed together with this one; inputs: what those methods read.
    """

    asked: str
    tried: tuple[str, ...]
    block: tuple[str, ...]
    inputs: Inputs

    @classmethod
    def read(cls, project: Project, name: str) -> Trace | None:
        """The trace of a photo; None if there is none, or one that is not understood."""
        told = project.load_record(STAGE, name)
        if told is None:
            return None
        tried, block = told.get("tried"), told.get("block")
        tried = tried if isinstance(tried, list) and set(map(str, tried)) <= READS.keys() else []
        block = [n for n in block if isinstance(n, str)] if isinstance(block, list) else []
        return cls(str(told.get("asked")), tuple(tried), tuple(block), told["inputs"])

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


class Sources:
    """Hashes of what registrations read, each made once."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self._settings: dict[str, str] = {}
        self._files: dict[str, Inputs] = {}
        self._blocks: dict[tuple[str, ...], str] = {}
        self._said: dict[str, str] | None = None

    def settings(self, methods: Iterable[str]) -> Inputs:
        """The tables of project.toml that the methods read."""
        sections = dict.fromkeys(section for method in methods for section in READS[method])
        for section in sections:
            if section not in self._settings:
                told = asdict(self.project.settings.table(section))
                self._settings[section] = json_hash(told)
        return {f"[{section}] settings": self._settings[section] for section in sections}

    @cached_property
    def mesh(self) -> Inputs:
        return file_inputs(self.project, mesh=self.project.mesh_path)

    def files(self, name: str) -> Inputs:
        """The photo's own files, one that is not there too."""
        if name not in self._files:
            project = self.project
            self._files[name] = file_inputs(
                project, photo=project.photo_path(name), mask=project.mask_path(name),
                correspondences=project.correspondences_path(name),
            )  # fmt: skip
        return self._files[name]

    def picture(self, name: str) -> str | None:
        """The photo itself, left out or not: what was found through it was found all the same; None
        if it is not in the project any more.
        """
        if name in self.project.settings.exclude:
            return file_inputs(self.project, photo=self.project.photos / name)["photo"]
        return self.files(name)["photo"] if name in self.project.photo_paths else None

    def pictures(self, names: tuple[str, ...]) -> str:
        """Several photos as one input."""
        if names not in self._blocks:
            self._blocks[names] = json_hash({name: self.picture(name) for name in names})
        return self._blocks[names]

    def said(self, name: str) -> Inputs:
        """The place that somebody chose for a photo, if anybody did."""
        if self._said is None:
            self._said = said_of(self.project)
        return {"place that was chosen": self._said[name]} if name in self._said else {}


class Neighborhood:
    """The photos in the order of their names, and which of those around one are registered.

    registered: their names in that order; companions: by photo, the others that show the same, the
    best first.
    """

    def __init__(
        self,
        names: Sequence[str],
        registered: Collection[str],
        companions: Mapping[str, Sequence[str]],
    ) -> None:
        self._rank = {name: k for k, name in enumerate(names)}
        self.registered = [name for name in names if name in registered]
        self._ranks = [self._rank[name] for name in self.registered]
        self.companions = companions

    def around(self, name: str, apart: Collection[str]) -> tuple[str, ...]:
        """The registered photos that are next to `name`, without `name` and those `apart`: first
        those that show the same, then those whose names are next to it.
        """
        found: dict[str, None] = {}
        for other in chain(self._companions(name), self._outwards(self._rank[name])):
            if other != name and other not in apart:
                found[other] = None
                if len(found) == MOST_COMPARED:
                    break
        return tuple(found)

    def _companions(self, name: str) -> Iterator[str]:
        return (other for other in self.companions.get(name, ()) if self._has(other))

    def _has(self, name: str) -> bool:
        rank = self._rank.get(name, -1)
        place = bisect_left(self._ranks, rank)
        return self._ranks[place : place + 1] == [rank]

    def add(self, name: str) -> None:
        """One more photo is registered."""
        if not self._has(name):
            place = bisect_left(self._ranks, self._rank[name])
            self.registered.insert(place, name)
            self._ranks.insert(place, self._rank[name])

    def remove(self, name: str) -> None:
        """A photo is registered no more."""
        if self._has(name):
            place = bisect_left(self._ranks, self._rank[name])
            del self.registered[place], self._ranks[place]

    def _outwards(self, rank: int) -> Iterator[str]:
        after = bisect_left(self._ranks, rank)
        before = after - 1
        while before >= 0 or after < len(self._ranks):
            below = rank - self._ranks[before] if before >= 0 else float("inf")
            above = self._ranks[after] - rank if after < len(self._ranks) else float("inf")
            if below <= above:
                yield self.registered[before]
                before -= 1
            else:
                yield self.registered[after]
                after += 1


@dataclass(frozen=True, eq=False)
class Lineage:
    """What the registrations of a project's photos were made from.

    cameras: hash of each registered photo's own camera, before all were refined together; traces:
    how each entry came about; order: the photos, each after those through which it was found;
    alone: for each photo whether its registration holds as far as its own inputs say; states: the
    same in view of the photos through which it was found.
    """

    sources: Sources
    entries: Entries
    cameras: Mapping[str, str]
    traces: Mapping[str, Trace | None]
    order: tuple[str, ...]
    alone: Mapping[str, Freshness]
    states: Mapping[str, Freshness]

    @classmethod
    def of(cls, project: Project, entries: Entries) -> Lineage:
        """The lineage of the photos as the project is now; linear in the photos. Raises InputError
        for an unusable project.
        """
        names, sources = project.photo_names, Sources(project)
        cameras = own_cameras(entries)
        registered = {n for n in names if n in entries and entries[n].vouches}
        around = Neighborhood(names, registered, companions(project))
        behind = Behind(entries.values())
        traces = {name: Trace.read(project, name) for name in names}
        alone = {
            name: state(
                sources, name, entries.get(name), traces[name], cameras,
                lambda name: around.around(name, behind.of(name)),
            )
            for name in names
        }  # fmt: skip
        order = tuple(in_order(names, entries))
        states = _together(order, alone, entries)
        return cls(sources, entries, cameras, traces, order, alone, states)


def own_cameras(entries: Entries) -> dict[str, str]:
    """Hash of each entry's own camera, before all were refined together."""
    return {name: camera_hash(own_registration(entry)) for name, entry in entries.items()}


def _together(
    order: Iterable[str], alone: Mapping[str, Freshness], entries: Entries
) -> dict[str, Freshness]:
    """The states in view of those through which each photo was found."""
    states: dict[str, Freshness] = {}
    for name in order:
        entry, state = entries.get(name), alone[name]
        through = entry.through if entry is not None else ()
        if state.settled and any(n in states and not states[n].settled for n in through):
            told = f"found through {', '.join(through)}, which are not all fresh"
            state = replace(state, fresh=False, failed=False, reason=told)
        states[name] = state
    return {name: states[name] for name in alone}


def state(
    sources: Sources,
    name: str,
    entry: CameraRecord | None,
    trace: Trace | None,
    cameras: Mapping[str, str],
    around: Callable[[str], Sequence[str]],
) -> Freshness:
    """Whether a photo's registration holds, as far as its own inputs say.

    cameras: hashes of all own cameras; around: names the registered photos next to one.
    """
    asked = sources.project.settings.register.method
    reason = _out_of_question(entry, trace, asked)
    if entry is None or reason:
        return Freshness(STAGE, name, False, reason)
    if not entry.sought:
        return Freshness(STAGE, name, True, "registered elsewhere, kept as it is")
    assert trace is not None
    now = inputs(sources, entry, trace.tried, trace.block, cameras, around)
    reason = changed_inputs({"inputs": trace.inputs}, now)
    if reason:
        return Freshness(STAGE, name, False, reason)
    if entry.status == "failed":
        return Freshness(STAGE, name, False, FAILED, failed=True)
    return Freshness(STAGE, name, True)


def _out_of_question(entry: CameraRecord | None, trace: Trace | None, asked: str) -> str:
    """Why an entry has to be made whatever it was made from; empty if it does not."""
    if entry is None:
        return "not registered yet"
    if entry.status == "prior":
        return "not registered yet, there is a start camera"
    if not entry.sought and entry.status == "registered":
        return "" if asked == AUTO else f"registered elsewhere, not by {asked}"
    if trace is None or not entry.sought:
        return "not made yet"
    if entry.quality.get(FAULT):
        return "it met an internal fault, which may be gone"
    if asked != AUTO:
        return "" if trace.tried == (asked,) else f"tried by {_told(trace.tried)}, not by {asked}"
    if trace.asked != AUTO and not _own_registered(entry):
        return f"only {_told(trace.tried)} was tried"
    return ""


def _told(methods: Iterable[str]) -> str:
    return ", ".join(methods) or "nothing"


def inputs(
    sources: Sources,
    entry: CameraRecord,
    tried: Sequence[str],
    block: tuple[str, ...],
    cameras: Mapping[str, str],
    around: Callable[[str], Sequence[str]],
) -> Inputs:
    """What the registration of an entry reads, as the methods that were `tried` read it.

    block: the photos that were placed together with it; cameras, around: as for `state`.
    """
    start = start_of(entry)
    found: Inputs = {
        "method": str(VERSION),
        **sources.settings(tried),
        **sources.mesh,
        **sources.files(entry.file),
        "start camera": json_hash(entry_of_record(replace(start, extra={}))) if start else "none",
    }
    if block:
        found["photos of the block"] = sources.pictures(block)
        if stands := sources.project.settings.stands:
            found["[output] up"] = stands
        found |= sources.said(entry.file)
    if not _own_registered(entry):
        if "features" in tried:
            others = around(entry.file)
            found[OTHERS] = json_hash([[n, cameras.get(n)] for n in others])
    elif entry.method == "features" or entry.through:
        found |= _through_inputs(sources, entry, cameras)
    return found


def _through_inputs(sources: Sources, entry: CameraRecord, cameras: Mapping[str, str]) -> Inputs:
    """The photos through which an entry was found: what they show, and from where by themselves."""
    if not entry.through:
        return {"which photos it was found through": "unknown"}
    return {
        f"registration of {name}": json_hash([cameras.get(name, "none"), sources.picture(name)])
        for name in entry.through
    }


def _own_registered(entry: CameraRecord) -> bool:
    """Whether the photo's own registration succeeded, whatever the others said later."""
    return entry.status == "registered" or entry.refinement is not None


class Behind:
    """Which photos were found through which."""

    def __init__(self, records: Iterable[CameraRecord]) -> None:
        self._next: dict[str, set[str]] = {}
        self._through: dict[str, tuple[str, ...]] = {}
        for record in records:
            self.put(record)

    def put(self, record: CameraRecord) -> None:
        """A photo's entry in place of the one before."""
        for name in self._through.get(record.file, ()):
            self._next[name].discard(record.file)
        self._through[record.file] = record.through
        for name in record.through:
            self._next.setdefault(name, set()).add(record.file)

    def of(self, name: str) -> set[str]:
        """The photos that were found through `name`, directly or through others."""
        found: set[str] = set()
        new = set(self._next.get(name, ()))
        while new:
            found |= new
            new = {n for k in new for n in self._next.get(k, ())} - found
        return found


def in_order(names: Iterable[str], entries: Entries) -> list[str]:
    """`names`, each after those through which it was found; what goes in a circle, by somebody's
    hand, comes last.
    """
    rank = {name: k for k, name in enumerate(names)}
    open_: dict[str, int] = {}
    following: dict[str, list[str]] = {}
    for name in rank:
        entry = entries.get(name)
        before = {n for n in (entry.through if entry else ()) if n in rank and n != name}
        open_[name] = len(before)
        for other in before:
            following.setdefault(other, []).append(name)
    out: list[str] = []
    ready = [name for name in rank if not open_[name]]
    while ready:
        out += ready
        freed = [n for name in ready for n in following.get(name, ()) if _closed(open_, n)]
        ready = sorted(freed, key=rank.__getitem__)
    return out + [name for name in rank if open_[name]]


def _closed(open_: dict[str, int], name: str) -> bool:
    """Whether nothing more has to come before `name`, now that one more is there."""
    open_[name] -= 1
    return not open_[name]


def registration_freshness(project: Project) -> list[Freshness]:
    """For each photo, whether its registration is up to date."""
    return list(Lineage.of(project, project.load_cameras()).states.values())
