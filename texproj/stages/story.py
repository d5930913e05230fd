"""What a run made of the photos, in one sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from texproj.project import Project
from texproj.records import CHOSEN, DOUBTED, PROOF, THROUGH
from texproj.stages.entries import is_refined
from texproj.stages.outcomes import PhotoOutcome

MOST_NAMED = 8
"""Photos with one reason that are named; of more, the number is told."""


def story(photos: Sequence[PhotoOutcome], refined: bool, left_out: Mapping[str, str]) -> str:
    """How the photos were found, how exact they are, which one others do not bear out, and which
    were left out and why, each named once; empty if there is nothing to tell. left_out: reasons by
    photo; their first part is told.
    """
    found = [photo for photo in photos if not photo.failed]
    parts = [*_blocks(found), *_others(found)]
    if refined and (errors := _errors_px(found)):
        parts.append(f"refined to {np.median(errors):.1f} px")
    parts += _rests_on(found)
    doubted = [photo.name for photo in found if photo.record.quality.get(DOUBTED)]
    if doubted:
        parts.append(f"other photos do not bear out {_named(doubted)}")
    if left_out:
        parts.append(_left_out(left_out))
    return "; ".join(parts)


def story_of(project: Project) -> str:
    """The same of what stands in cameras.json."""
    entries = project.load_cameras()
    own = [entries[name] for name in project.photo_names if name in entries]
    told = [PhotoOutcome(e.file, e, True, str(e.quality.get("reason") or "")) for e in own]
    left_out = {photo.name: photo.reason for photo in told if photo.failed}
    return story(told, any(is_refined(entry) for entry in own), left_out)


def _blocks(found: Sequence[PhotoOutcome]) -> Iterator[str]:
    """A word on the photos that were placed together."""
    placed = [photo.record.quality for photo in found if photo.record.method == "block"]
    if not placed:
        return
    yield f"{len(placed)} photos overlap; placed as one block on the scan ({_why_there(placed)})"


def _why_there(placed: Sequence[Mapping[str, Any]]) -> str:
    sure = next((q for q in placed if "rival" in q), None)
    if sure is not None:
        said = "where you said; " if CHOSEN in sure else ""
        return f"{said}structure {sure['support']:.0%}, next best place {sure['rival']:.0%}"
    through = dict.fromkeys(name for q in placed for name in q.get(THROUGH, ()))
    if not through:
        return "from rough cameras to where they agree with each other"
    return f"held by {_named([*through])}"


def _others(found: Sequence[PhotoOutcome]) -> Iterator[str]:
    methods = [photo.record.method for photo in found if photo.record.method not in (None, "block")]
    counts = {method: methods.count(method) for method in dict.fromkeys(methods)}
    if counts:
        yield ", ".join(f"{count} found by {method}" for method, count in counts.items())


def _rests_on(found: Sequence[PhotoOutcome]) -> list[str]:
    """What the place on the mesh rests on, where the mesh does not tell it."""
    told = [photo.record.quality.get(PROOF, {}).get("rests_on") for photo in found]
    return list(dict.fromkeys(one for one in told if one))


def _errors_px(found: Sequence[PhotoOutcome]) -> list[float]:
    told = [photo.record.quality.get("expected_error_px") for photo in found]
    return [float(error) for error in told if error is not None]


def _left_out(reasons: Mapping[str, str]) -> str:
    """Photos that share a reason are named together."""
    by_reason: dict[str, list[str]] = {}
    for name, why in reasons.items():
        by_reason.setdefault(_short(name, why), []).append(name)
    count = f"{len(reasons)} photo{'s' if len(reasons) > 1 else ''} left out"
    told = [f"{_named(names)} ({why})" for why, names in by_reason.items()]
    return f"{count}: {', '.join(told)}"


def _named(names: Sequence[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _short(name: str, reason: str) -> str:
    """The first part of a reason, without what to do."""
    return reason.removeprefix(f"{name}: ").split(";")[0].split(" (")[0].strip()
