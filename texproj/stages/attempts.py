"""What is tried of a photo, or of several together, and the entry that comes of it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from texproj.errors import InputError
from texproj.records import PROOF, CameraRecord, Fit, Status
from texproj.stages.attending import PhotoFaultError, attended
from texproj.stages.bench import Crew, Workbench
from texproj.stages.lineage import FAULT
from texproj.stages.methods import METHODS, Job, Search, believed, search_as_asked
from texproj.stages.outcomes import (
    UNUSABLE,
    PhotoOutcome,
    failed_record,
    refused_record,
    registered_record,
)
from texproj.stages.progress import Progress
from texproj.stages.traces import Trace

if TYPE_CHECKING:
    from texproj.stages.judging import Judgement

Placing = Callable[
    [Workbench, Sequence[str], Mapping[str, CameraRecord], Progress], Mapping[str, Fit | str]
]
"""``placing(bench, names, registered, progress)``: for each photo a fit, or why there is none."""


def as_block(
    bench: Workbench,
    names: Sequence[str],
    anchors: Mapping[str, CameraRecord],
    progress: Progress,
) -> Mapping[str, Fit | str]:
    """All at once, by structure from motion: for each photo a fit, or why there is none."""
    from texproj.stages.blocking import place_together  # noqa: PLC0415 - slow to load

    return place_together(bench, names, anchors, progress)


def by_agreement(
    bench: Workbench,
    names: Sequence[str],
    registered: Mapping[str, CameraRecord],
    progress: Progress,
) -> Mapping[str, Fit | str]:
    """From rough cameras to where the photos agree on the surface."""
    from texproj.stages.agreeing import placed_by_agreement  # noqa: PLC0415 - slow to load

    return placed_by_agreement(bench, names, registered, progress)


def judged(
    bench: Workbench,
    registered: Mapping[str, CameraRecord],
    new: Collection[str],
    crew: Crew | None,
    listen: Callable[[], None],
) -> Mapping[str, Judgement]:
    """What the registered photos say of those of them that are new."""
    from texproj.stages.judging import judgements  # noqa: PLC0415 - slow to load

    return judgements(bench, registered, new, crew, listen)


def is_new(outcome: PhotoOutcome) -> bool:
    """Whether the others have to be asked about a registered photo: one of this run, or one of a
    run that was interrupted before it asked. What was refined since then stays as it is.
    """
    record = outcome.record
    if outcome.failed or not record.sought:
        return False
    return not outcome.kept or (PROOF not in record.quality and record.refinement is None)


def told_rests_on(bench: Workbench, registered: Mapping[str, CameraRecord]) -> str:
    """What the place on the mesh rests on where the mesh does not tell it; empty where it does."""
    from texproj.stages.judging import rests_on  # noqa: PLC0415 - slow to load

    return rests_on(bench, registered)


def by_features(job: Job) -> Search:
    """By what registered photos show of the same surface alone."""
    return search_as_asked(job, "features")


def as_searches(told: Mapping[str, Fit | str]) -> dict[str, Search]:
    """What was said of photos that were placed together, by photo, as searches of them."""
    return {
        name: Search(None, (fit,), ("block",))
        if isinstance(fit, str)
        else Search().then([("block", partial(believed, fit))])
        for name, fit in told.items()
    }


def continued(found: Search, outcome: PhotoOutcome | None, trace: Trace | None) -> Search:
    """A search after what was tried of the photo before."""
    if outcome is None or trace is None:
        return found
    reasons = (outcome.reason, *found.refusals) if found.fit is None else ()
    return replace(found, refusals=reasons, tried=(*trace.tried, *found.tried))


def as_placed(found: Search, _: Job) -> Search:
    """What a step said of a photo, as a search of it."""
    return found


def searched(job: Job, search: Callable[[Job], Search]) -> tuple[Search, dict[str, Any]]:
    """What came of a search, and what to note where a photo cannot be used or met a fault."""
    try:
        return attended(job.name, partial(search, job)), {}
    except PhotoFaultError as error:
        return Search(None, (str(error),), tuple(METHODS)), {FAULT: True}
    except InputError as error:
        return Search(None, (str(error).removeprefix(f"{job.name}: "),)), {UNUSABLE: True}


def record_of(job: Job, found: Search, why: dict[str, Any]) -> CameraRecord:
    """The entry that a search makes."""
    start = job.start
    if start is not None:
        status: Status = "prior" if start.status == "registered" else start.status
        start = replace(start, status=status, extra={}, refinement=None)
    if found.fit is None:
        reason = found.reason  # whoever tells it names the photo
        for named in (job.project.photo_path(job.name), job.name):
            reason = reason.replace(f"{named}: ", "")
        quality = {"reason": reason, **why}
        return failed_record(job.project, job.name, start, quality)
    make = registered_record if found.fit.accepted else refused_record
    return make(job.project, job.name, start, found.fit)


def noted(record: CameraRecord, proof: Mapping[str, Any], note: str) -> CameraRecord:
    """An entry with more of what speaks for its camera, and a note, if it is not empty."""
    known = record.quality.get(PROOF, {})
    told = dict.fromkeys(filter(None, [record.quality.get("reason", ""), note]))
    quality = {**record.quality, PROOF: {**known, **proof}, "reason": "; ".join(told)}
    return replace(record, quality=quality)
