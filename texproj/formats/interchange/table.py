"""Text tables of exterior orientations: name, position and three angles, as Metashape (omega phi
kappa; reference), Pix4D (external camera parameters), surveyors and flight logs write them.

One line names the columns. Position in the mesh's frame; angles in degrees as in `angles`. A focal
length in pixels (``f_px``) may follow; no lens stands there else, so that the cameras are starts.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from texproj.camera import Camera
from texproj.errors import InputError, excerpt
from texproj.formats.documents import read_text
from texproj.formats.interchange.angles import (
    omega_phi_kappa_deg,
    rotation_of_heading_pitch_roll,
    rotation_of_omega_phi_kappa,
)
from texproj.formats.interchange.model import (
    Array,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    brown_terms,
    left_out,
    lens,
    numbers,
    pose_at,
    sentences,
    unknown_lens,
)

ALIASES = {
    "name": ("name", "label", "photoid", "imagename", "image", "filename", "file", "photo"),
    "x": ("x", "x/easting", "x/longitude", "easting", "east"),
    "y": ("y", "y/northing", "y/latitude", "northing", "north"),
    "z": ("z", "z/altitude", "z/height", "alt", "altitude", "height", "elevation"),
    "omega": ("omega",), "phi": ("phi",), "kappa": ("kappa",),
    "heading": ("heading", "yaw"), "pitch": ("pitch",), "roll": ("roll",),
    "f_px": ("f_px",),
}  # fmt: skip
"""What programs call a column, in small letters."""
POSITION, SURVEYED, FLOWN = ("x", "y", "z"), ("omega", "phi", "kappa"), ("heading", "pitch", "roll")
GEOGRAPHIC = ("GEOGCS", "GEOGCRS", "GEODCRS")
HEAD_LINES = 20
"""Lines within which the columns must be named."""


def read_table(path: Path, size_of: SizeOf) -> ForeignModel:
    """The rows of a table; sizes are the photos'. Raises InputError for broken files."""
    lines = read_text(path).split("\n")
    head = columns(lines)
    if head is None:
        raise InputError(
            f"{path}: no line that names the columns: name, x, y, z, and omega, phi, kappa or"
            " heading, pitch, roll"
        )
    at, separator, where_of = head
    if any(word in line for line in lines[:at] for word in GEOGRAPHIC):
        raise InputError(f"{path}: degrees of longitude and latitude; export in the mesh's system")
    found, refused, absent = [], {}, []
    for count, line in enumerate(lines[at + 1 :], at + 2):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        where = f"{path}, line {count}"
        words = split(line, separator)
        if len(words) <= max(where_of.values()):
            raise InputError(f"{where}: {max(where_of.values()) + 1} values expected")
        row = {key: words[i] for key, i in where_of.items()}
        try:
            camera = _camera(row, size_of(row["name"]), where)
        except Unusable as reason:
            refused[row["name"]] = str(reason)
            continue
        if camera is None:
            absent.append(row["name"])
        else:
            found.append(camera)
    return ForeignModel(tuple(found), refused, tuple(absent))


def write_table(shots: Sequence[Shot]) -> Written:
    """orientations.txt: positions, omega, phi, kappa and the focal length."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["#name", *POSITION, *SURVEYED, "f_px"])
    for shot in shots:
        camera = shot.camera
        f = (camera.intrinsics.fx + camera.intrinsics.fy) / 2
        values = [*camera.center, *omega_phi_kappa_deg(camera.pose.R), f]
        table.writerow([shot.name, *(repr(float(value)) for value in values)])
    notes = {shot.name: note for shot in shots if (note := _lost(shot.camera))}
    return Written({"orientations.txt": text.getvalue().encode()}, notes)


def columns(lines: Sequence[str]) -> tuple[int, str, dict[str, int]] | None:
    """The line that names the columns, what separates them (empty: spaces) and where each is."""
    for at, line in enumerate(lines[:HEAD_LINES]):
        for separator in (",", ";", "\t", ""):
            named = [word.lstrip("#").strip().lower() for word in split(line, separator)]
            found = {
                key: next(i for i, word in enumerate(named) if word in aliases)
                for key, aliases in ALIASES.items()
                if any(word in aliases for word in named)
            }
            if all(key in found for key in ("name", *POSITION)) and _angles(found):
                return at, separator, found
    return None


def split(line: str, separator: str) -> list[str]:
    """The values of a line; empty `separator`: spaces."""
    if not separator:
        return line.lstrip("# ").split()
    try:
        return [word.strip() for word in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return []


def _angles(found: dict[str, int] | dict[str, str]) -> tuple[str, ...]:
    return next((keys for keys in (SURVEYED, FLOWN) if all(k in found for k in keys)), ())


def _camera(row: dict[str, str], size: tuple[int, int] | None, where: str) -> ForeignCamera | None:
    """The camera of a row; None for a photo that is not at hand."""
    angles = _angles(row)
    turned = _three(row, angles, where)
    R = (
        rotation_of_omega_phi_kappa(turned)
        if angles == SURVEYED
        else rotation_of_heading_pitch_roll(turned)
    )
    pose = pose_at(R, _three(row, POSITION, where))
    f = numbers([row["f_px"]], 1, f"{where}, f_px")[0] if row.get("f_px") else None
    if size is None:
        return None
    told = unknown_lens(row["name"], size, pose)
    if f is None:
        return told
    center = size[0] / 2, size[1] / 2
    return replace(told, camera=Camera(lens(*size, f, center), pose), focal_told=True)


def _three(row: dict[str, str], keys: Sequence[str], where: str) -> Array:
    if not all(row[key] for key in keys):
        raise Unusable("a value of its position or angles is empty")
    words = [row[key].replace(",", ".") for key in keys]
    return numbers(words, 3, f"{where}, {excerpt(', '.join(keys))}")


def _lost(camera: Camera) -> str:
    k = camera.intrinsics
    offset = {"cx - width/2": k.cx - k.width / 2, "cy - height/2": k.cy - k.height / 2}
    named = brown_terms(k)
    higher = beyond_k3(k)
    return sentences([left_out({"fx - fy": k.fx - k.fy, **offset, **named, **higher})])
