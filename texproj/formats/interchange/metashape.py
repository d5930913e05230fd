"""Camera XML of Agisoft Metashape and PhotoScan.

``u = width/2 + cx + x' f + x' b1 + y' b2``, ``v = height/2 + cy + y' f`` with
``x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y`` and
``y' = y (...) + p2 (r^2 + 2 y^2) + 2 p1 x y`` (Metashape manual, appendix on camera models):
OpenCV's p1 and p2 with their names exchanged; pixels as ours. Coefficients that are zero are not
written.
PhotoScan before 1.3 wrote <fx>, <fy>, <skew>, <cx> and <cy> from the picture's corner, and p1 and
p2 as OpenCV has them (Agisoft Lens manual 0.4; "Camera projection model", agisoft.com/forum 6437).
A camera's transform is chunk_from_cam with OpenCV's axes; the chunk's or the component's own
transform (scale, rotation, translation) leads on to the world.
In a rig the master's camera has a transform, the others name it; a sensor's <rotation> (of its axes
to the master's) and <location> (its center in the master's frame) are its place on the rig
("The slave-sensor transform", metashape-expert-manual). Whether that is in metres or in the chunk's
unit is not said there: where these differ the camera is a start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_xml
from texproj.formats.interchange.model import (
    Array,
    ForeignCamera,
    ForeignModel,
    Shot,
    SizeOf,
    Unusable,
    Written,
    beyond_k3,
    left_out,
    lens,
    lenses_of,
    number,
    numbers,
    pose_at,
    possible,
    rotation,
    sentences,
    words,
)
from texproj.formats.interchange.radial import fisheye, with_fourth_order
from texproj.formats.interchange.text import whole

VERSION = "2.0.0"
FRAME, FISHEYES = "frame", ("fisheye", "equidistant_fisheye")
"""Types of sensors: a fisheye's angle takes the place of r, else all is the same."""
MOST_SCALE = 1e12
"""By how much a chunk may be enlarged; numbers far beyond are no scale."""


@dataclass(frozen=True, eq=False)
class _Similarity:
    """``x_in_world = scale R x_in_chunk + t``."""

    scale: float
    R: Array
    t: Array


IDENTITY = _Similarity(1.0, np.eye(3), np.zeros(3))
NO_PLACE = (
    "it is part of a rig, and the file does not say where on it; export the cameras from Metashape"
    " for COLMAP or Bundler"
)
CENTERS = ("location", "translation")
"""Where a sensor's place on a rig stands."""
RIG_START = (
    "it is part of a rig in a chunk with a scale, and the file does not say in which unit its place"
    " on the rig is: its camera is taken as a start"
)
Sensor = tuple[Intrinsics, str] | Unusable
"""Lens and a note, or why there is none."""


def read_metashape(path: Path, size_of: SizeOf) -> ForeignModel:
    """The cameras of all chunks, in the world that the chunk's transform leads to.

    Cameras that are not aligned are refused. Raises InputError for broken files.
    """
    root = read_xml(path)
    chunks = [root] if root.tag == "chunk" else root.findall("chunk")
    if not chunks:
        raise InputError(f"{path}: not a Metashape camera file (no <chunk> in it)")
    found: list[ForeignCamera] = []
    refused: dict[str, str] = {}
    for chunk in chunks:
        where = f"{path}"
        sensors = {s.get("id"): _sensor(s, where) for s in chunk.iterfind("sensors/sensor")}
        worlds = {
            c.get("id"): _similarity(c, where) for c in chunk.iterfind("components/component")
        }
        own = _similarity(chunk, where)
        rig = _Rig(chunk, where)
        for camera in chunk.iterfind("cameras//camera"):
            name = camera.get("label") or f"camera {camera.get('id')}"
            told = f"{path}, {excerpt(name)}"
            try:
                matrix, apart = rig.chunk_from_cam(camera, told)
                component = camera.get("component_id") or rig.master_of(camera).get("component_id")
                world = worlds.get(component) or own or IDENTITY
                unsure = RIG_START if apart and world.scale != 1 else ""
                found.append(_camera(camera, sensors, (matrix, world), unsure))
            except Unusable as reason:
                refused[name] = str(reason)
    return ForeignModel(tuple(found), refused, notes=_notes(chunks))


def write_metashape(shots: Sequence[Shot]) -> Written:
    """A file of one chunk; photos with the same lens share a sensor. Rational and prism terms of
    the lens are left out.
    """
    document = ET.Element("document", version=VERSION)
    chunk = ET.SubElement(document, "chunk", label="texproj", enabled="true")
    lenses = lenses_of(shots)
    sensors = ET.SubElement(chunk, "sensors", next_id=str(len(lenses)))
    for i, k in enumerate(lenses):
        _write_sensor(sensors, i, k)
    cameras = ET.SubElement(chunk, "cameras", next_id=str(len(shots)), next_group_id="0")
    for i, shot in enumerate(shots):
        sensor = str(lenses.index(shot.camera.intrinsics))
        camera = ET.SubElement(cameras, "camera", id=str(i), sensor_id=sensor, label=shot.name)
        inverse = shot.camera.pose.inverse
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = inverse.R, inverse.t
        ET.SubElement(camera, "transform").text = words(matrix.ravel())
    ET.indent(document)
    content = ET.tostring(document, encoding="utf-8", xml_declaration=True) + b"\n"
    return Written.of({"cameras.xml": content}, shots, _lost)


def _similarity(holder: ET.Element, where: str) -> _Similarity | None:
    transform = holder.find("transform")
    if transform is None or transform.find("rotation") is None:
        return None
    R = numbers(transform.findtext("rotation"), 9, f"{where}, rotation of the chunk")
    t = numbers(transform.findtext("translation", "0 0 0"), 3, f"{where}, translation of the chunk")
    scale = number(transform.findtext("scale", "1"), f"{where}, scale of the chunk")
    if not MOST_SCALE > scale > 1 / MOST_SCALE:
        raise InputError(f"{where}, scale of the chunk: must be positive, and of possible size")
    checked_translation(t, f"{where}, chunk", "translation")
    return _Similarity(scale, rotation(R, f"{where}, rotation of the chunk"), t)


def _sensor(sensor: ET.Element, where: str) -> Sensor:
    calibrations = sensor.findall("calibration")
    adjusted = [c for c in calibrations if c.get("class", "adjusted") == "adjusted"]
    if not calibrations:
        return Unusable("its sensor has no calibration")
    best = (adjusted or calibrations)[0]
    kind = best.get("type", sensor.get("type", "frame"))
    if kind not in (FRAME, *FISHEYES):
        return Unusable(
            f"its lens is of type {excerpt(kind)}, neither frame nor fisheye; export undistorted"
            " photos from Metashape"
        )
    size = best.find("resolution")
    size = sensor.find("resolution") if size is None else size
    if size is None:
        return Unusable("its sensor has no resolution")
    where = f"{where}, sensor {excerpt(sensor.get('id'))}"
    width, height = (number(size.get(key), f"{where}, resolution") for key in ("width", "height"))
    try:
        return _lens(best, (width, height), kind, where)
    except Unusable as reason:
        return reason


def _lens(
    calibration: ET.Element, size: tuple[float, float], kind: str, where: str
) -> tuple[Intrinsics, str]:
    width, height = size
    old = calibration.find("fx") is not None
    if not old and calibration.find("f") is None:
        raise InputError(f"{where}: no focal length <f>, and no <fx>")

    def value(key: str) -> float:
        return number(calibration.findtext(key, "0"), f"{where}, {key}")

    if old:
        focal, center = (value("fx"), value("fy")), (value("cx"), value("cy"))
        p1, p2, skew = value("p1"), value("p2"), value("skew")
    else:
        focal = value("f") + value("b1"), value("f")
        center = width / 2 + value("cx"), height / 2 + value("cy")
        p1, p2, skew = value("p2"), value("p1"), value("b2")
    k1, k2, k3, k4 = (value(key) for key in ("k1", "k2", "k3", "k4"))
    if kind in FISHEYES:
        bent = (k1, k2, k3, k4, p1, p2) if p1 or p2 else (k1, k2, k3, k4)
        intrinsics, note = fisheye(size, focal, center, bent)
    else:
        plain = lens(width, height, focal, center, (k1, k2, p1, p2, k3))
        intrinsics, note = with_fourth_order(plain, k4)
    if not skew:
        return intrinsics, note
    most = abs(skew) * height / 2 / focal[1]
    name = "skew" if old else "skew b2"
    return intrinsics, sentences([note, f"{name} = {skew:.6g} is ignored: up to {most:.2g} px"])


class _Rig:
    """The cameras of a chunk by their numbers, and the places of its sensors on a rig."""

    def __init__(self, chunk: ET.Element, where: str) -> None:
        self._cameras = {c.get("id"): c for c in chunk.iterfind("cameras//camera")}
        self._places = {s.get("id"): _place(s, where) for s in chunk.iterfind("sensors/sensor")}

    def master_of(self, camera: ET.Element) -> ET.Element:
        """The camera whose pose its own follows; itself where it is no part of a rig."""
        return self._cameras.get(camera.get("master_id"), camera)

    def chunk_from_cam(self, camera: ET.Element, where: str) -> tuple[Array, bool]:
        """(4, 4), and whether it follows from a place on the rig apart from the master's. Raises
        Unusable for a camera without a pose.
        """
        if camera.get("enabled", "true").lower() in ("false", "0"):
            raise Unusable("it is disabled there; enable it in Metashape and export again")
        text, master = camera.findtext("transform"), self.master_of(camera)
        if text is not None or master is camera:
            return _transform(text, where), False
        own, other = (self._places.get(c.get("sensor_id")) for c in (camera, master))
        if own is None:
            raise Unusable(NO_PLACE)
        offset = own if other is None else np.linalg.inv(other) @ own
        matrix = _transform(master.findtext("transform"), where) @ offset
        return matrix, bool(np.abs(offset[:3, 3]).max() > 0)


def _place(sensor: ET.Element, where: str) -> Array | None:
    """(4, 4) from a sensor's frame to the master's; None where the file does not say."""
    if all(sensor.find(key) is None for key in ("rotation", *CENTERS)):
        return None
    where, place = f"{where}, sensor {excerpt(sensor.get('id'))}", np.eye(4)
    if sensor.find("rotation") is not None:
        told = numbers(sensor.findtext("rotation"), 9, f"{where}, rotation")
        place[:3, :3] = rotation(told, where)
    for key in CENTERS:
        if sensor.find(key) is not None:
            place[:3, 3] = numbers(sensor.findtext(key), 3, f"{where}, {key}")
            checked_translation(place[:3, 3], where, key)
    return place


def _transform(text: str | None, where: str) -> Array:
    if text is None:
        raise Unusable("it is not aligned there")
    matrix = numbers(text, 16, f"{where}, transform").reshape(4, 4)
    possible(checked_translation, matrix[:3, 3], "its pose")
    matrix[:3, :3] = rotation(matrix[:3, :3], where)
    return matrix


def _camera(
    camera: ET.Element,
    sensors: dict[str | None, Sensor],
    placed: tuple[Array, _Similarity],
    unsure: str,
) -> ForeignCamera:
    """placed: chunk_from_cam, and world from chunk; unsure: why it is no more than a start."""
    sensor = sensors.get(camera.get("sensor_id"), Unusable("its sensor is missing in the file"))
    if isinstance(sensor, Unusable):
        raise sensor
    chunk_from_cam, world = placed
    R = (world.R @ chunk_from_cam[:3, :3]).T
    center = world.scale * world.R @ chunk_from_cam[:3, 3] + world.t
    intrinsics, note = sensor
    name = camera.get("label") or f"camera {camera.get('id')}"
    found = Camera(intrinsics, pose_at(R, center))
    turned = whole((camera.findtext("orientation") or "").strip())
    return ForeignCamera(name, found, (note,) if note else (), turned, unsure)


def _notes(chunks: Sequence[ET.Element]) -> tuple[str, ...]:
    systems = [(chunk.findtext("reference") or "").strip() for chunk in chunks]
    if not any(s.startswith(("GEOGCS", "PROJCS", "COMPD_CS", "GEOCCS")) for s in systems):
        return ()
    return (
        "the chunk is georeferenced: its cameras are in geocentric coordinates;"
        " the mesh must be exported in the same system",
    )


def _write_sensor(sensors: ET.Element, number_: int, k: Intrinsics) -> None:
    kind = FISHEYES[0] if k.is_fisheye else FRAME
    sensor = ET.SubElement(sensors, "sensor", id=str(number_), label="unknown", type=kind)
    size = {"width": str(k.width), "height": str(k.height)}
    ET.SubElement(sensor, "resolution", size)
    calibration = ET.SubElement(sensor, "calibration", {"type": kind, "class": "adjusted"})
    ET.SubElement(calibration, "resolution", size)
    terms = _terms(k)
    values = {
        "f": k.fy, "cx": k.cx - k.width / 2, "cy": k.cy - k.height / 2, "b1": k.fx - k.fy,
        **terms, "p1": terms["p2"], "p2": terms["p1"],
    }  # fmt: skip
    for key, value in values.items():
        if value:
            ET.SubElement(calibration, key).text = repr(float(value))


def _terms(k: Intrinsics) -> dict[str, float]:
    """k1 .. k4, p1, p2 under our names."""
    names = ("k1", "k2", "k3", "k4", "p1", "p2") if k.is_fisheye else ("k1", "k2", "p1", "p2", "k3")
    values = (*k.dist, *(0.0,) * 6)[: len(names)]
    return dict(zip(names, values, strict=True))


def _lost(k: Intrinsics) -> str:
    beyond = {f"s{i}": v for i, v in enumerate(k.dist[6:], 1)} if k.is_fisheye else beyond_k3(k)
    return left_out(beyond)
