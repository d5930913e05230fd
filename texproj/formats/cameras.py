"""cameras.json: the registered cameras, the only thing that travels from register to color."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from texproj.camera import LENGTHS, Intrinsics, LensModel, Pose
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import (
    MOST_SIDE_PX,
    checked_intrinsics,
    checked_rotation,
    checked_translation,
)
from texproj.formats.documents import read_json
from texproj.records import CameraRecord, Method, Refinement, Status

FORMAT = "texproj-cameras"
VERSION = 1
UNBENT: dict[LensModel, tuple[float, ...]] = {"perspective": (0.0,) * 5, "fisheye": (0.0,) * 4}
"""Distortion of an entry that tells of none."""

ROTATION_TOLERANCE = 1e-4
"""Largest error of R @ R.T against the identity; six printed digits stay well below."""
START_KEY = "start"
"""Key of an entry under which the camera is kept that registration started from; null = none."""
REFINED_KEY = "before_refine"
"""Key of an entry under which the photo's own registration is kept when all were refined."""

M = TypeVar("M", bound=BaseModel)
Side = Annotated[int, Field(ge=1, le=MOST_SIDE_PX)]
Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Matrix = tuple[Row, Row, Row]


class _Pick(BaseModel):
    """How well one picked point fits."""

    model_config = ConfigDict(extra="allow")

    name: str
    residual_px: FiniteFloat
    outlier: bool


class _Quality(BaseModel):
    """What texproj itself reads again of an entry's quality; the rest is for people."""

    model_config = ConfigDict(extra="allow")

    expected_error_px: FiniteFloat | None = None
    reason: str | None = None
    picks: list[_Pick] = []


class _Entry(BaseModel):
    """One photo's entry as the file has it."""

    model_config = ConfigDict(extra="allow")

    file: str = Field(min_length=1)
    width: Side
    height: Side
    status: Status = "registered"
    K: Matrix | None = None
    dist: tuple[FiniteFloat, ...] | None = None
    model: LensModel = "perspective"
    R: Matrix | None = None
    t: Row | None = None
    method: Method | None = None
    quality: _Quality = _Quality()


class _Refined(BaseModel):
    """What stands under `REFINED_KEY`."""

    entry: dict[str, Any]
    refined: str
    asked: bool = False


class _File(BaseModel):
    """The whole file; entries are validated one by one so that errors can name them."""

    model_config = ConfigDict(extra="allow")

    format: str
    version: int
    photos: list[dict[str, Any]]


@dataclass(frozen=True, eq=False)
class CameraFile:
    """What a cameras.json holds. extra: its top-level keys that texproj does not know."""

    records: list[CameraRecord]
    extra: dict[str, Any]


def read_cameras(path: Path) -> CameraFile:
    """The records of a cameras.json, in its order; unknown keys are kept, here and per entry.

    Raises InputError that names the entry and the key.
    """
    content = _validated(_File, read_json(path), f"{path}")
    if content.format != FORMAT or content.version != VERSION:
        raise InputError(
            f"{path}: format {excerpt(content.format)!r} version {content.version};"
            f" this program reads {FORMAT!r} version {VERSION}"
        )
    records = [
        record_of_entry(entry, f"{path}, photo {excerpt(entry.get('file') or f'number {i}')}")
        for i, entry in enumerate(content.photos, 1)
    ]
    seen: set[str] = set()
    for record in records:
        if record.file in seen:
            name = excerpt(record.file)
            raise InputError(f"{path}: {name} appears twice; keep one entry per photo")
        seen.add(record.file)
    return CameraFile(records, _kept(f"{path}", content.model_extra))


def cameras_json(
    records: Iterable[CameraRecord], extra: Mapping[str, Any] = MappingProxyType({})
) -> str:
    """The text of a cameras.json, one entry a line; reading it gives back every bit."""
    known = {"format": FORMAT, "version": VERSION}
    head = json.dumps(dict(extra) | known, allow_nan=False, default=_plain)[:-1]
    entries = ",\n".join(json.dumps(entry_of_record(record)) for record in records)
    return f'{head}, "photos": [\n{entries}\n]}}\n'


def record_of_entry(value: dict[str, Any], where: str = "camera") -> CameraRecord:
    """One entry of `photos` as a record. Raises InputError that names `where` and the key."""
    entry = _validated(_Entry, value, where)
    if (entry.R is None) != (entry.t is None):
        raise InputError(f"{where}: give R and t together, or neither")
    if entry.status == "registered" and (entry.K is None or entry.R is None):
        raise InputError(f"{where}: a registered camera has K, R and t (else: status 'prior')")
    if entry.status == "failed" and entry.R is not None:
        raise InputError(f"{where}: a failed photo has no R and t (else: status 'prior')")
    quality = _kept(f"{where}: quality", entry.quality.model_dump(exclude_unset=True))
    extra = dict(entry.model_extra or {})
    sought = START_KEY in extra
    start, refinement = extra.pop(START_KEY, None), extra.pop(REFINED_KEY, None)
    return CameraRecord(
        entry.file, entry.width, entry.height, _intrinsics(where, entry), _pose(where, entry),
        entry.status, entry.method, quality, _kept(where, extra),
        sought, _start(where, entry.file, start), _refinement(where, entry.file, refinement),
    )  # fmt: skip


def entry_of_record(record: CameraRecord) -> dict[str, Any]:
    """A record as its entry of `photos`, plain lists and numbers."""
    entry: dict[str, Any] = {**record.extra}
    if record.sought:
        entry[START_KEY] = _start_entry(record.start)
    if record.refinement is not None:
        kept = record.refinement
        own = entry_of_record(kept.own)
        entry[REFINED_KEY] = {"entry": own, "refined": kept.camera, "asked": kept.asked}
    entry |= {"file": record.file, "width": record.width, "height": record.height}
    entry |= {key: value for key, value in camera_part(record).items() if value is not None}
    entry["status"] = record.status
    if record.method is not None:
        entry["method"] = record.method
    first = [name for name in _Quality.model_fields if name in record.quality]
    entry["quality"] = {name: record.quality[name] for name in first} | record.quality  # as reread
    return json.loads(json.dumps(entry, allow_nan=False, default=_plain))


def camera_part(record: CameraRecord) -> dict[str, Any]:
    """What an entry says of the camera itself: K, dist, R, t, None where not known."""
    intrinsics, pose = record.intrinsics, record.pose
    if record.status == "failed":
        pose = None
    return {
        "K": None if intrinsics is None else intrinsics.K.tolist(),
        "dist": None if intrinsics is None else list(intrinsics.dist),
        "model": "fisheye" if intrinsics is not None and intrinsics.is_fisheye else None,
        "R": None if pose is None else pose.R.tolist(),
        "t": None if pose is None else pose.t.tolist(),
    }


def _start_entry(start: CameraRecord | None) -> dict[str, Any] | None:
    if start is None:
        return None
    entry = entry_of_record(replace(start, sought=False, refinement=None))
    return {key: value for key, value in entry.items() if key != "file"}


def _start(where: str, file: str, value: Any) -> CameraRecord | None:
    if value is None:
        return None
    return _nested(f"{where}: {START_KEY}", file, value, (START_KEY, REFINED_KEY))


def _refinement(where: str, file: str, value: Any) -> Refinement | None:
    if value is None:
        return None
    where = f"{where}: {REFINED_KEY}"
    kept = _validated(_Refined, value, where)
    return Refinement(_nested(where, file, kept.entry, (REFINED_KEY,)), kept.refined, kept.asked)


def _nested(where: str, file: str, value: Any, without: tuple[str, ...]) -> CameraRecord:
    """A record that is kept inside an entry, which may not hold more of its kind."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: must be an entry as cameras.json has it; remove the key")
    entry = {key: part for key, part in value.items() if key not in without}
    return record_of_entry({**entry, "file": file}, where)


def _kept(where: str, unknown: Mapping[str, Any] | None) -> dict[str, Any]:
    """Keys that are kept as they are. Raises InputError for numbers that JSON cannot hold."""
    try:
        json.dumps(unknown, allow_nan=False)
    except ValueError:
        told = excerpt(", ".join(unknown or {}))
        raise InputError(f"{where}: NaN or an infinite number in {told}; take it out") from None
    return dict(unknown or {})


def _validated(model: type[M], value: Any, where: str) -> M:
    try:
        return model.model_validate(value)
    except ValidationError as error:
        first = error.errors()[0]
        key = excerpt(".".join(str(part) for part in first["loc"]))
        raise InputError(f"{where}: {key or 'content'}: {first['msg'].lower()}") from None


def _intrinsics(where: str, entry: _Entry) -> Intrinsics | None:
    if entry.K is None:
        return None
    K = np.array(entry.K)
    if K[0, 1] or K[1, 0] or not np.array_equal(K[2], (0, 0, 1)) or min(K[0, 0], K[1, 1]) <= 0:
        raise InputError(
            f"{where}: K must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0"
        )
    lengths = LENGTHS[entry.model]
    dist = UNBENT[entry.model] if entry.dist is None else entry.dist
    if len(dist) not in lengths:
        raise InputError(
            f"{where}: dist has {len(dist)} coefficients; a {entry.model} lens has"
            f" {' or '.join(map(str, lengths))}"
        )
    focal, center = (K[0, 0], K[1, 1]), (K[0, 2], K[1, 2])
    size = entry.width, entry.height
    return checked_intrinsics(*size, focal, center, dist, where, entry.model)


def _pose(where: str, entry: _Entry) -> Pose | None:
    if entry.R is None or entry.t is None:
        return None
    R = checked_rotation(np.array(entry.R), where, ROTATION_TOLERANCE)
    return Pose(R, checked_translation(entry.t, where))


def _plain(value: Any) -> Any:
    """numpy scalars and arrays as JSON has them."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written to cameras.json")
