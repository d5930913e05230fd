"""Where photos fit the mesh in several places, somebody chooses: the places are kept until then.

They stand in work/ as cameras, so that what is chosen is taken without any new search.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter, ValidationError

from texproj.camera import Camera
from texproj.errors import InputError, UsageError
from texproj.formats.cameras import entry_of_record, record_of_entry
from texproj.project import Project
from texproj.records import CHOSEN, CameraRecord, Fit
from texproj.stages.entries import start_of
from texproj.stages.outcomes import Tally, failed_record
from texproj.stages.partners import content_key

if TYPE_CHECKING:
    from texproj.register.block.block_fit import BlockFit
    from texproj.register.block.reconstruction import Reconstruction
    from texproj.stages.block_fits import Told

FOLDER, RECORD = "block", "places"
NONE_OF_THEM = 0
LOOKED_THROUGH = 2
"""Photos through which the places are shown side by side."""
ERROR = "expected_error_px"
PLACED = "placed where you said"
CHOSEN_ELSEWHERE = "another place was chosen since then"


class Place(BaseModel):
    """One place of all photos together. cameras: entries as in cameras.json, with the expected
    error of each, if it is known; points: what the photos have in common, world.
    """

    support: FiniteFloat
    cameras: list[dict[str, Any]]
    points: list[tuple[FiniteFloat, FiniteFloat, FiniteFloat]] = []

    def by_name(self) -> dict[str, Camera]:
        """The cameras by photo. Raises InputError for what is none."""
        found = self.records()
        return {record.file: record.camera for record in found if record.camera is not None}

    def records(self) -> list[CameraRecord]:
        """The entries. Raises InputError for what is none."""
        return [record_of_entry(entry) for entry in self.cameras]


class Question(BaseModel):
    """mesh: hash of the mesh; photos: by name, another word for other content; looks: the photos
    to look through; places: the best first; answer: a place's number from 1, 0 for none of them,
    None as long as nobody has chosen.
    """

    mesh: str
    photos: dict[str, str]
    looks: list[str]
    places: Annotated[list[Place], Field(min_length=2)]
    answer: int | None = None

    @property
    def is_open(self) -> bool:
        return self.answer is None

    @property
    def chosen(self) -> Place | None:
        """The place that somebody chose."""
        return self.places[self.answer - 1] if self.answer else None

    @property
    def words(self) -> str:
        """For people: "two places fit: 1 (31 %), 2 (24 %)"."""
        count = {2: "two", 3: "three", 4: "four"}.get(len(self.places), str(len(self.places)))
        told = [f"{k} ({place.support:.0%})" for k, place in enumerate(self.places, 1)]
        return f"{count} places fit {len(self.photos)} photos: {', '.join(told)}"


def questions(project: Project) -> list[Question]:
    """All that were asked, as long as mesh and photos are the same; the latest comes last."""
    mesh = project.hash_of(project.mesh_path)
    return [q for q in _kept(project) if q.mesh == mesh and _same(project, q)]


def open_question(project: Project) -> Question | None:
    """The first that nobody has answered."""
    return next((question for question in questions(project) if question.is_open), None)


def told_of(project: Project) -> str:
    """One sentence for people on what there is to choose; empty if nothing."""
    question = open_question(project)
    if question is None:
        return ""
    return (
        f"{question.words} of the mesh's structure; open `texproj preview {project.root}` and "
        f"choose, or `texproj place {project.root} 1`"
    )


def ask(project: Project, part: Reconstruction, fit: BlockFit) -> None:
    """Keep the places of a block among which somebody has to choose. Raises OutputError."""
    from texproj.stages.block_fits import sparse_points  # noqa: PLC0415 - slow to load

    asked = set(fit.quality["photos_asked"])
    question = Question(
        mesh=str(project.hash_of(project.mesh_path)),
        photos={name: content_key(project, name) for name in part.names},
        looks=[name for name in part.names if name in asked][:LOOKED_THROUGH],
        places=[
            Place(
                support=place.support,
                cameras=[
                    camera_entry(name, camera, place.expected_error_px[name])
                    for name, camera in place.cameras.items()
                ],
                points=sparse_points(part.points, place.world_from_block),
            )
            for place in fit.candidates
        ],
    )
    others = []
    for known in _kept(project):
        if known.photos == question.photos and known.mesh == question.mesh:
            question.answer = known.answer
        elif not known.photos.keys() & question.photos.keys():
            others.append(known)
    _keep(project, [*others, question])


def camera_entry(name: str, camera: Camera, error_px: float | None = None) -> dict[str, Any]:
    """A camera of a photo as cameras.json has it."""
    k, quality = camera.intrinsics, {} if error_px is None else {ERROR: error_px}
    record = CameraRecord(name, k.width, k.height, k, camera.pose, "prior", quality=quality)
    return entry_of_record(record)


@dataclass(frozen=True)
class ChoiceOutcome:
    """Which place was chosen for how many photos; number: 0 for none of them."""

    number: int
    photos: tuple[str, ...]
    root: str

    @property
    def tally(self) -> Tally:
        return Tally(0, len(self.photos), "placed")

    def lines(self) -> Iterator[str]:
        """For people."""
        count = len(self.photos)
        if self.number == NONE_OF_THEM:
            yield f"none of the places is right for {count} photos; pick 8 points in one of them"
        else:
            yield f"place {self.number} is chosen for {count} photos; now `texproj run {self.root}`"

    def as_dict(self) -> dict[str, Any]:
        """For --json."""
        return {"place": self.number, "photos": list(self.photos)}


def choose(project: Project, number: int | None) -> ChoiceOutcome:
    """Say which place is right for the photos that wait for it, or else for those of which it was
    said last; 0: none of them; None: nobody knows any more. The next `register` goes on from there.

    Raises UsageError where there is nothing to choose, or no such place.
    """
    known = questions(project)
    if not known:
        why = "has no places to choose from"
        if _kept(project):
            why = "has places to choose from, but its mesh or photos have changed since"
        raise UsageError(f"{project.root} {why}; run `texproj register`")
    question = next((q for q in known if q.is_open), known[-1])
    if number is not None and not NONE_OF_THEM <= number <= len(question.places):
        raise UsageError(f"there is no place {number}: 1 to {len(question.places)}, 0 for none")
    question.answer = number
    _keep(project, [question if q.photos == question.photos else q for q in _kept(project)])
    _take_back(project, question)
    return ChoiceOutcome(number or NONE_OF_THEM, tuple(question.photos), str(project.root))


def chosen_fits(project: Project, names: Collection[str], others: Collection[str]) -> Told:
    """The photos `names` whose place somebody chose, there. Those are left to their neighbors of
    which one of `others`, registered by other means, holds the block.
    """
    told: Told = {}
    for question in questions(project):
        place = question.chosen
        if place is None or question.photos.keys() & set(others):
            continue
        assert question.answer is not None
        told |= _fits(place, question, {n for n in question.photos if n in names})
    return told


def said_of(project: Project) -> dict[str, str]:
    """By photo, the place that was chosen for it, whatever has changed since then."""
    return {
        name: f"{question.answer} of {len(question.places)}"
        for question in _kept(project) if question.answer
        for name in question.photos
    }  # fmt: skip


def _fits(place: Place, question: Question, names: Collection[str]) -> Mapping[str, Fit]:
    rival = max(p.support for p in question.places if p is not place)
    nothing = np.zeros(0)
    errors_px = {record.file: record.quality.get(ERROR) for record in place.records()}
    return {
        name: Fit(
            camera=camera,
            method="block",
            expected_error_px=float(errors_px[name] or math.nan),
            residual_px=nothing,
            inliers=nothing.astype(bool),
            covariance=np.full((6, 6), np.nan),
            reason=PLACED,
            quality={
                "block_photos": len(question.photos),
                "support": round(place.support, 3),
                "rival": round(rival, 3),
                CHOSEN: question.answer,
            },
        )
        for name, camera in place.by_name().items()
        if name in names
    }


def _take_back(project: Project, question: Question) -> None:
    """Photos that were placed elsewhere by an earlier choice are sought again."""
    back = []
    for name, entry in project.load_cameras().items():
        was = entry.quality.get(CHOSEN)
        if name in question.photos and was is not None and was != question.answer:
            quality = {"reason": CHOSEN_ELSEWHERE}
            back.append(failed_record(project, name, start_of(entry), quality))
    if back:
        project.save_cameras(back)


def _same(project: Project, question: Question) -> bool:
    """Whether its photos are what they were, as far as they still take part."""
    left = [name for name in question.photos if name in project.photo_paths]
    return bool(left) and all(content_key(project, n) == question.photos[n] for n in left)


def _kept(project: Project) -> list[Question]:
    """What stands in work/, as far as it can be understood."""
    record = project.load_record(FOLDER, RECORD) or {}
    try:
        found = TypeAdapter(list[Question]).validate_python(record.get("questions", []))
        for question in found:
            _check(question)
    except (ValidationError, InputError):
        return []
    return found


def _check(question: Question) -> None:
    """Raise InputError for places without the cameras of the photos, or an answer that is none."""
    if question.answer is not None and not 0 <= question.answer <= len(question.places):
        raise InputError(f"there is no place {question.answer}")
    for place in question.places:
        if place.by_name().keys() != question.photos.keys():
            raise InputError("a place without the cameras of all photos")


def _keep(project: Project, found: Sequence[Question]) -> None:
    told = [question.model_dump() for question in found]
    project.save_record(FOLDER, RECORD, {"inputs": {}, "questions": told})
