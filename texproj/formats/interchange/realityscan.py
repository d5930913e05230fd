"""RealityScan's (RealityCapture's) "Internal/External camera parameters" CSV.

Heading, pitch, roll are those of `angles`. Focal length: 35 mm equivalent over the longer side,
``f max(w, h) / 36`` px. Principal point: offset from the image center in units of the longer side.
Distortion: Brown's; what t1 and t2 multiply is not documented: they are taken as OpenCV's p1 and
p2, and a note says so where they are not zero.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError
from texproj.formats.documents import read_text
from texproj.formats.interchange.angles import (
    heading_pitch_roll_deg,
    rotation_of_heading_pitch_roll,
)
from texproj.formats.interchange.model import (
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    five,
    left_out,
    lens,
    number,
    pose_at,
    sentences,
)
from texproj.formats.interchange.radial import with_fourth_order

FILM_MM = 36.0
POSE = ("x", "y", "alt", "heading", "pitch", "roll")
COLUMNS = ("name", *POSE, "f", "px", "py", "k1", "k2", "k3", "k4", "t1", "t2")
TANGENTIAL = "t1 and t2 are taken as OpenCV's p1 and p2, which RealityScan does not document"


def read_realityscan(path: Path, size_of: SizeOf) -> ForeignModel:
    """The rows of a camera CSV; image sizes are the photos'. Raises InputError for broken files."""
    rows = _rows(path)
    found, refused, absent = [], {}, []
    for line, row in rows:
        name = row["name"]
        size = size_of(name)
        if size is None:
            absent.append(name)
            continue
        values = {key: number(row[key], f"{path}, line {line}, {key}") for key in COLUMNS[1:]}
        try:
            found.append(_camera(name, values, size))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_realityscan(shots: Sequence[Shot]) -> Written:
    """cameras.csv. Focal lengths are averaged, lens terms beyond k3 are left out."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["#name", *COLUMNS[1:]])
    for shot in shots:
        table.writerow([shot.name, *(repr(float(v)) for v in _values(shot.camera))])
    return Written.of({"cameras.csv": text.getvalue().encode()}, shots, _lost)


def _rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    text = read_text(path)
    separator = _separator(text)
    try:
        table = list(_numbered(csv.reader(io.StringIO(text), delimiter=separator)))
    except csv.Error as error:
        raise InputError(f"{path}: not a table ({error})") from None
    header = [word.strip().lstrip("#").lower() for word in table[0][1]] if table else []
    missing = [column for column in COLUMNS if column not in header]
    if missing:
        raise InputError(
            f"{path}: no column {missing[0]!r}; export 'Internal/External camera parameters'"
        )
    rows = []
    for line, words in table[1:]:
        if not any(word.strip() for word in words):
            continue
        if len(words) < len(header):
            raise InputError(f"{path}, line {line}: {len(header)} values expected")
        if any(word.strip() for word in words[len(header) :]):
            raise InputError(
                f"{path}, line {line}: {len(words)} values for {len(header)} columns; if decimals"
                " have commas, export with points, or with semicolons between the values"
            )
        row = dict(zip(header, words, strict=False))
        if separator != ",":
            row |= {key: row[key].replace(",", ".") for key in COLUMNS[1:]}
        rows.append((line, {**row, "name": row["name"].strip()}))
    return rows


def _numbered(table: Any) -> Iterator[tuple[int, list[str]]]:
    """The rows of a csv reader with the lines where they end."""
    for words in table:
        yield table.line_num, words


def _separator(text: str) -> str:
    """What stands between the columns: spreadsheets of half the world write semicolons."""
    head = text.partition("\n")[0]
    return max(",;\t", key=head.count)


def _camera(name: str, values: dict[str, float], size: tuple[int, int]) -> ForeignCamera:
    width, height = size
    longer = max(size)
    center = width / 2 + values["px"] * longer, height / 2 + values["py"] * longer
    dist = [values[key] for key in ("k1", "k2", "t1", "t2", "k3")]
    intrinsics = lens(width, height, values["f"] * longer / FILM_MM, center, dist)
    intrinsics, note = with_fourth_order(intrinsics, values["k4"])
    tangential = TANGENTIAL if values["t1"] or values["t2"] else ""
    R = rotation_of_heading_pitch_roll([values[key] for key in ("heading", "pitch", "roll")])
    pose = pose_at(R, [values[key] for key in ("x", "y", "alt")])
    said = sentences([note, tangential])
    return ForeignCamera(name, Camera(intrinsics, pose), (said,) if said else ())


def _values(camera: Camera) -> list[float]:
    k = camera.intrinsics
    longer = max(k.width, k.height)
    k1, k2, p1, p2, k3 = five(k.dist)
    return [
        *camera.center, *heading_pitch_roll_deg(camera.pose.R),
        (k.fx + k.fy) / 2 * FILM_MM / longer,
        (k.cx - k.width / 2) / longer, (k.cy - k.height / 2) / longer,
        k1, k2, k3, 0.0, p1, p2,
    ]  # fmt: skip


def _lost(k: Intrinsics) -> str:
    _, _, p1, p2, _ = five(k.dist)
    higher = beyond_k3(k)
    return sentences([left_out({"fx - fy": k.fx - k.fy, **higher}), TANGENTIAL if p1 or p2 else ""])
