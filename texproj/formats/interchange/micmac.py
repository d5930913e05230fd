"""MicMac's orientations: a folder Ori-NAME with Orientation-PHOTO.xml for each photo, and the
calibrations of lenses that these name.

Convention eConvApero_DistM2C: ``Centre``, and lines of world_from_cam with OpenCV's axes; an ideal
pixel ``PP + F (x/z, y/z)``, from the picture's corner, goes through the distortion to the photo's.
Radii are in pixels from ``CDist`` (ModRad; ModPhgrStd adds ``P1 (r^2 + 2 x^2) + 2 P2 x y`` and
``b1 x + b2 y``): MicMac's documentation; itowns/three-photogrammetric-camera; MicMac's own import
from Bundler (cAppliBundler). Fisheyes: the same, and its phgr_ebner_brown_dist.cpp.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path, PureWindowsPath
from xml.etree import ElementTree as ET

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera, Intrinsics
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import read_xml
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
    lenses_of,
    numbers,
    pose_at,
    possible,
    rotation,
    words,
)
from texproj.formats.interchange.round_lens import beyond_radial, of_bend

PREFIX, SUFFIX = "Orientation-", ".xml"
CONVENTION = "eConvApero_DistM2C"
CALIBRATION = "AutoCal_{}.xml"
FISHEYES = ("eModele_FishEye_10_5_5", "eModele_EquiSolid_FishEye_10_5_5")
"""Whose rays are bent by their angle, or by twice the sine of half of it."""
FISHEYE_TERMS = 24
"""Center, 10 radial terms, 5 pairs of decentering, 2 of first degree; what follows is a polynomial.
"""
SAMPLES = 40
"""Along each side of the picture, at which OpenCV's lens is fitted."""
MOST_ERROR_PX, TOLD_ERROR_PX = 1.0, 0.005
ROUNDS = 4
Bend = Callable[[Doubles], Doubles]
"""(n, 2) pixels of the ideal picture to those of the photo."""


def read_micmac(path: Path, size_of: SizeOf) -> ForeignModel:
    """The orientations in folder `path`. Raises InputError for broken files and for none."""
    files = sorted(path.glob(f"{PREFIX}*{SUFFIX}"))
    if not files:
        raise InputError(f"{path}: no {PREFIX}...{SUFFIX} in the folder")
    lenses: dict[str, tuple[Intrinsics, str] | Unusable] = {}
    found, refused = [], {}
    for file in files:
        name = file.name.removeprefix(PREFIX).removesuffix(SUFFIX)
        try:
            found.append(_camera(file, name, lenses))
        except Unusable as reason:
            refused[name] = str(reason)
    return ForeignModel(tuple(found), refused)


def write_micmac(shots: Sequence[Shot]) -> Written:
    """An orientation for each photo and a calibration for each lens, of MicMac's model Fraser."""
    lenses = lenses_of(shots)
    files = {CALIBRATION.format(i): _calibration(k) for i, k in enumerate(lenses)}
    for shot in shots:
        number = lenses.index(shot.camera.intrinsics)
        name = f"{PREFIX}{shot.name}{SUFFIX}"
        files[name] = _orientation(shot.camera, CALIBRATION.format(number))
    return Written.of(files, shots, _lost)


def _camera(
    file: Path, name: str, lenses: dict[str, tuple[Intrinsics, str] | Unusable]
) -> ForeignCamera:
    root = read_xml(file)
    conic = root if root.tag == "OrientationConique" else root.find("OrientationConique")
    if conic is None:
        raise InputError(f"{file}: not an orientation of MicMac (no <OrientationConique> in it)")
    where = f"{file}, {excerpt(name)}"
    if conic.findtext("TypeProj", "eProjStenope").strip() != "eProjStenope":
        raise Unusable("its projection is none of a lens")
    _need_convention(conic.find("Externe"), conic.find("ConvOri"))
    if _affine(conic.find("OrIntImaM2C")):
        raise Unusable("it is a scan of film with a frame of its own; resample it in MicMac")
    lines = [conic.findtext(f"Externe/ParamRotation/CodageMatr/L{i}") for i in (1, 2, 3)]
    world_from_cam = np.stack([numbers(line, 3, f"{where}, L1, L2, L3") for line in lines])
    center = numbers(conic.findtext("Externe/Centre"), 3, f"{where}, Centre")
    possible(checked_translation, center, "its pose")
    key = (conic.findtext("FileInterne") or "").strip()
    if not key:
        raise Unusable("it names no calibration")
    if key not in lenses:
        lenses[key] = _lens(file, key)
    known = lenses[key]
    if isinstance(known, Unusable):
        raise known
    intrinsics, note = known
    camera = Camera(intrinsics, pose_at(rotation(world_from_cam, where).T, center))
    return ForeignCamera(name, camera, (note,) if note else ())


def _need_convention(*holders: ET.Element | None) -> None:
    told = {
        (holder.findtext("KnownConv") or "").strip() for holder in holders if holder is not None
    }
    other = sorted(told - {"", CONVENTION})
    if other:
        raise Unusable(f"its convention is {excerpt(other[0])}, not {CONVENTION}")


def _affine(holder: ET.Element | None) -> bool:
    """Whether a change of the picture's frame changes anything."""
    if holder is None:
        return False
    usual = {"I00": "0 0", "V10": "1 0", "V01": "0 1"}
    told = {key: (holder.findtext(f".//{key}") or value).split() for key, value in usual.items()}
    try:
        return any(
            [float(v) for v in told[k]] != [float(v) for v in usual[k].split()] for k in told
        )
    except ValueError:
        return True


def _lens(file: Path, key: str) -> tuple[Intrinsics, str] | Unusable:
    """The calibration that an orientation names: a path from the folder above its own."""
    name = PureWindowsPath(key).name
    beside = next((p for p in (file.parent / name, file.parent.parent / name) if p.is_file()), None)
    if beside is None:
        return Unusable(f"its calibration {excerpt(key)} is not in its folder; copy it there")
    try:
        return _read_lens(beside)
    except Unusable as reason:
        return reason


def _read_lens(file: Path) -> tuple[Intrinsics, str]:
    root = read_xml(file)
    tag = "CalibrationInternConique"
    conic = root if root.tag == tag else root.find(tag)
    if conic is None:
        raise InputError(f"{file}: not a calibration of MicMac (no <{tag}> in it)")
    _need_convention(conic)
    if _affine(conic.find("OrIntGlob")):
        raise Unusable("its calibration turns or scales the picture; resample it in MicMac")
    width, height = numbers(conic.findtext("SzIm"), 2, f"{file}, SzIm")
    center = numbers(conic.findtext("PP"), 2, f"{file}, PP")
    focal = float(numbers(conic.findtext("F"), 1, f"{file}, F")[0])
    plain = lens(width, height, focal, center)
    parts = list(reversed(conic.findall("CalibDistortion")))
    bends = [bend for part in parts if (bend := _bend(part, f"{file}")) is not None]
    if any((part.findtext(".//TypeModele") or "").strip() in FISHEYES for part in parts):
        return _round_lens(plain, bends)
    return _fitted(plain, bends)


def _round_lens(plain: Intrinsics, bends: list[Bend]) -> tuple[Intrinsics, str]:
    """OpenCV's fisheye nearest to distortions one after the other. Raises Unusable."""
    center = np.array([plain.cx, plain.cy])

    def bend(flat: Doubles) -> Doubles:
        angle = np.sqrt(np.einsum("ij,ij->i", flat, flat))
        pixels = flat * (np.tan(angle) / angle)[:, None] * plain.fx + center
        for part in bends:
            pixels = part(pixels)
        return pixels

    return of_bend((plain.width, plain.height), (plain.fx, plain.fx), center.tolist(), bend)


def _bend(holder: ET.Element, where: str) -> Bend | None:
    model = next(iter(holder), None)
    if model is None or model.tag == "ModNoDist":
        return None
    kind = (model.findtext("TypeModele") or model.tag).strip()
    if kind in FISHEYES:
        return _round_bend(model, kind, where)
    if model.tag not in ("ModRad", "ModPhgrStd"):
        raise Unusable(
            f"its lens is of MicMac's model {excerpt(kind)}; calibrate by Tapas with RadialStd,"
            " Fraser or FishEyeEqui"
        )
    middle = numbers(model.findtext(".//CDist"), 2, f"{where}, CDist")
    told = [part.text for part in model.iter("CoeffDist")]
    radial = [float(numbers(text, 1, f"{where}, CoeffDist")[0]) for text in told]

    def value(key: str) -> float:
        return float(numbers(model.findtext(key, "0"), 1, f"{where}, {key}")[0])

    p1, p2, b1, b2 = (value(key) for key in ("P1", "P2", "b1", "b2"))

    def bend(pixels: Doubles) -> Doubles:
        x, y = (pixels - middle).T
        r2 = x * x + y * y
        scale = np.polyval([*reversed(radial), 1.0], r2)
        u = x * scale + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y
        v = y * scale + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
        return np.stack([u, v], axis=1) + middle

    return bend


def _round_bend(model: ET.Element, kind: str, where: str) -> Bend:
    """A fisheye's: ten radial terms, five pairs of decentering, and terms of a polynomial, of which
    the first two are taken.
    """
    told = [float(numbers(p.text, 1, f"{where}, Params")[0]) for p in model.iter("Params")]
    told += [0.0] * (FISHEYE_TERMS - len(told))
    scale = float(numbers(model.findtext("Etats"), 1, f"{where}, Etats")[0])
    if any(told[FISHEYE_TERMS:]):
        raise Unusable("its fisheye lens has a free polynomial; calibrate by Tapas FishEyeEqui")
    if not scale > 0:
        raise Unusable("its fisheye lens has a scale that is not positive")
    middle, radial, pairs, (l0, l1) = np.array(told[:2]), told[2:12], told[12:22], told[22:24]
    equisolid = kind == FISHEYES[1]

    def bend(pixels: Doubles) -> Doubles:
        ideal = (pixels - middle) / scale
        r = np.sqrt(np.einsum("ij,ij->i", ideal, ideal))
        angle = np.arctan(r)
        seen = 2 * np.sin(angle / 2) if equisolid else angle
        x, y = (ideal * np.divide(seen, r, out=np.ones_like(r), where=r > 0)[:, None]).T
        r2 = x * x + y * y
        factor = np.polyval([*reversed(radial), 1.0], r2)
        u, v = x * (factor + l0) + y * l1, y * factor + x * l1
        for n, (a, b) in enumerate(zip(pairs[::2], pairs[1::2], strict=True)):
            grade = 2 * n + 2
            u = u + r2**n * (a * (r2 + grade * x * x) + b * grade * x * y)
            v = v + r2**n * (b * (r2 + grade * y * y) + a * grade * x * y)
        return np.stack([u, v], axis=1) * scale + middle

    return bend


def _fitted(plain: Intrinsics, bends: list[Bend]) -> tuple[Intrinsics, str]:
    """OpenCV's lens nearest to distortions about centers of their own: linear least squares over
    the picture (ours). Raises Unusable where it is not near.
    """
    if not bends:
        return plain, ""
    steps = np.linspace(0, 1, SAMPLES)
    pixels = np.stack(np.meshgrid(steps * plain.width, steps * plain.height), -1).reshape(-1, 2)
    seen = pixels
    with np.errstate(over="ignore", invalid="ignore"):
        for bend in bends:
            seen = bend(seen)
    if not np.isfinite(seen).all() or np.abs(seen).max() > 10 * max(plain.width, plain.height):
        raise Unusable("its lens cannot be: it leads far out of the picture")
    ideal = (pixels - (plain.cx, plain.cy)) / (plain.fx, plain.fy)
    (x, y), r2 = ideal.T, np.einsum("ij,ij->i", ideal, ideal)
    one, zero = np.ones_like(x), np.zeros_like(x)
    u = [one, zero, x, zero, x * r2, x * r2**2, x * r2**3, 2 * x * y, r2 + 2 * x * x, r2, zero]
    v = [zero, one, zero, y, y * r2, y * r2**2, y * r2**3, r2 + 2 * y * y, 2 * x * y, zero, r2]
    system = np.concatenate([np.stack(u, axis=1), np.stack(v, axis=1)])
    focal, dist = np.array([plain.fx, plain.fy]), np.zeros(12)
    for _ in range(ROUNDS):
        solved = np.linalg.lstsq(system, np.concatenate(list((seen / focal).T)), rcond=None)[0]
        center, dist[:] = solved[:2] * focal, 0
        focal = focal * solved[2:4]
        dist[[0, 1, 4, 2, 3, 8, 10]] = solved[4:]
    size = plain.width, plain.height
    fitted = lens(*size, focal, center, dist if dist[8:].any() else dist[:5])
    error = np.abs(fitted.distort(ideal) * focal + center - seen).max()
    if not error <= MOST_ERROR_PX:
        raise Unusable(f"its lens is none that OpenCV's model comes near ({error:.2g} px)")
    note = f"its lens is fitted by OpenCV's within {error:.2g} px" if error > TOLD_ERROR_PX else ""
    return fitted, note


def _calibration(k: Intrinsics) -> bytes:
    f = (k.fx + k.fy) / 2
    root = ET.Element("ExportAPERO")
    conic = ET.SubElement(root, "CalibrationInternConique")
    ET.SubElement(conic, "KnownConv").text = CONVENTION
    ET.SubElement(conic, "PP").text = words([k.cx, k.cy])
    ET.SubElement(conic, "F").text = repr(f)
    ET.SubElement(conic, "SzIm").text = f"{k.width} {k.height}"
    holder = ET.SubElement(conic, "CalibDistortion")
    if k.is_fisheye:
        _write_round(ET.SubElement(holder, "ModUnif"), k, f)
        return _bytes(root)
    k1, k2, p1, p2, k3 = five(k.dist)
    model = ET.SubElement(holder, "ModPhgrStd")
    radial = ET.SubElement(model, "RadialePart")
    ET.SubElement(radial, "CDist").text = words([k.cx, k.cy])
    for power, value in enumerate((k1, k2, k3), 1):
        ET.SubElement(radial, "CoeffDist").text = repr(value / f ** (2 * power))
    for key, number in (("P1", p2 / f), ("P2", p1 / f), ("b1", 0.0), ("b2", 0.0)):
        ET.SubElement(model, key).text = repr(number)
    return _bytes(root)


def _write_round(model: ET.Element, k: Intrinsics, f: float) -> None:
    """The terms of a fisheye; MicMac's first decentering is our p2, p1."""
    k1, k2, k3, k4, p1, p2 = (*k.dist, 0.0, 0.0)[:6]
    ET.SubElement(model, "TypeModele").text = FISHEYES[0]
    told = [k.cx, k.cy, k1, k2, k3, k4, *(0.0,) * 6, p2, p1]
    for value in told + [0.0] * (FISHEYE_TERMS - len(told)):
        ET.SubElement(model, "Params").text = repr(float(value))
    ET.SubElement(model, "Etats").text = repr(f)


def _lost(k: Intrinsics) -> str:
    if k.is_fisheye:
        prism = {name: v for name, v in beyond_radial(k).items() if name in ("s1", "s2")}
        return left_out({**prism, "fx - fy": k.fx - k.fy})
    return left_out({**beyond_k3(k), "fx - fy": k.fx - k.fy})


def _orientation(camera: Camera, calibration: str) -> bytes:
    root = ET.Element("ExportAPERO")
    conic = ET.SubElement(root, "OrientationConique")
    ET.SubElement(conic, "TypeProj").text = "eProjStenope"
    ET.SubElement(conic, "FileInterne").text = calibration
    ET.SubElement(conic, "RelativeNameFI").text = "true"
    outer = ET.SubElement(conic, "Externe")
    ET.SubElement(outer, "KnownConv").text = CONVENTION
    ET.SubElement(outer, "Centre").text = words(camera.center)
    matrix = ET.SubElement(ET.SubElement(outer, "ParamRotation"), "CodageMatr")
    for i, row in enumerate(camera.pose.R.T, 1):
        ET.SubElement(matrix, f"L{i}").text = words(row)
    ET.SubElement(ET.SubElement(conic, "ConvOri"), "KnownConv").text = CONVENTION
    return _bytes(root)


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
