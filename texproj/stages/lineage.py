"""What each photo's registration was made from, and which of them still hold: one value per run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property

from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.choosing import said_of
from texproj.stages.entries import Entries, camera_hash, own_registration, start_of
from texproj.stages.freshness import FAILED, Freshness, Inputs, changed_inputs, file_inputs
from texproj.stages.methods import AUTO, READS
from texproj.stages.neighborhood import Behind, Neighborhood
from texproj.stages.partners import companions
from texproj.stages.traces import STAGE, Trace, read_traces

VERSION = 2
OTHERS = "other registered photos"
FAULT = "internal_fault"
"""Key of an entry's quality: nobody foresaw why it failed, so it is tried again."""


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
                project, photo=project.photo_path(name), mask=project.mask_files(name),
                correspondences=project.picks_files(name),
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
        traces = read_traces(project, names)
        alone = {
            name: state(
                sources, name, entries.get(name), traces[name], cameras,
                lambda name: around.around(name, behind.of(name).__contains__),
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
