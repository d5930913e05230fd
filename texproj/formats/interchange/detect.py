"""Which program a camera file is from: by its name, and by its content where names are shared."""

from __future__ import annotations

import struct
from pathlib import Path

from texproj.errors import InputError
from texproj.formats.documents import read_json, read_text
from texproj.formats.interchange.arkit import is_frame
from texproj.formats.interchange.pix4d import HEADER as PIX4D_HEADER
from texproj.formats.interchange.table import columns

BY_SUFFIX = {
    ".mlp": "meshlab", ".out": "bundler", ".sfm": "meshroom", ".nvm": "visualsfm", ".opf": "opf",
    ".mvs": "openmvs",
}  # fmt: skip
MODEL_FILES = {f"{part}{ending}" for part in ("cameras", "images") for ending in (".bin", ".txt")}
IN_FOLDER = {
    "transforms.json": "nerfstudio", "sfm_data.json": "openmvg", "bundle.out": "bundler",
    "cameras.xml": "metashape", "cameras.mlp": "meshlab", "cameras.csv": "realityscan",
    "reconstruction.json": "opensfm", "opensfm/reconstruction.json": "opensfm",
    "blocks.xml": "blocks-exchange", "cameras.sfm": "meshroom", "orientations.txt": "table",
    "*calibrated_camera_parameters.txt": "pix4d",
    "params/*calibrated_camera_parameters.txt": "pix4d",
    "1_initial/params/*calibrated_camera_parameters.txt": "pix4d",
    "*.opf": "opf", "*.nvm": "visualsfm", "*.mvs": "openmvs", "sfm_data.bin": "openmvg",
    "transforms_train.json": "nerfstudio-poses", "transforms_eval.json": "nerfstudio-poses",
}  # fmt: skip
"""Names and patterns of files, in the order in which they are looked for."""
FRAMES = ("", "keyframes/corrected_cameras", "keyframes/cameras", "corrected_cameras", "cameras")
"""Where the apps on telephones keep one JSON file a photo."""
COLMAP = ("colmap", "colmap-binary")
"""Names of one reader, which takes the binary files where both are there."""
OWN = "texproj"
SIDECARS, VIEWS, ARKIT, MICMAC = "realityscan-xmp", "texrecon", "arkit", "micmac"
"""Formats of one file a photo: their readers take the folder."""
ORIENTATIONS = "Orientation-*.xml"
HEAD_BYTES = 1 << 16
LISTS = {"shots": "opensfm", "transform": "nerfstudio-poses"}
OBJECTS = {
    "frames": "nerfstudio", "extrinsics": "openmvg", "shots": "opensfm",
    "featuresFolders": "meshroom", "poses": "meshroom",
}  # fmt: skip
"""Keys of JSON lists' first entries and of JSON objects, by which they are known."""
SHOWN = 5
"""How many models a sentence lists."""
COLMAP_FOLDERS = ("", "sparse", "colmap/sparse")
"""Where a model is, or folders of models that are named by numbers."""


def detect(path: Path, asked: str | None = None) -> tuple[str, Path]:
    """Name of the format, and the file (of COLMAP and sidecars: the folder) that its reader wants.

    asked: the format that the user names, None to look. Raises InputError for what is not there
    or not known.
    """
    if not path.exists():
        raise InputError(f"no camera file at {path}")
    if path.is_dir():
        return _in_folder(path, asked)
    if path.suffix.lower() == ".xmp" and asked in (None, SIDECARS):
        return SIDECARS, path.parent
    if path.suffix.lower() == ".cam" and asked in (None, VIEWS):
        return VIEWS, path.parent
    if path.match(ORIENTATIONS) and asked in (None, MICMAC):
        return MICMAC, path.parent
    if path.name in MODEL_FILES and asked in (None, *COLMAP):
        return asked or "colmap", path.parent
    found = asked or _of_file(path)
    return found, path.parent if found == ARKIT else path


def _in_folder(path: Path, asked: str | None) -> tuple[str, Path]:
    for sub in COLMAP_FOLDERS if asked in (None, *COLMAP) else ():
        models = colmap_models(path / sub)
        if models:
            return asked or "colmap", max(models, key=lambda model: models[model])
    for pattern, kind in IN_FOLDER.items():
        files = sorted(path.glob(pattern)) if asked in (None, kind) else []
        if files and not asked and pattern.startswith("transforms_"):
            return _of_file(files[0]), files[0]  # Blender's synthetic data has the name, too
        if files:
            return kind, files[0]
    for pattern, kind in ((ORIENTATIONS, MICMAC), ("*.xmp", SIDECARS), ("*.cam", VIEWS)):
        if asked in (None, kind) and any(path.glob(pattern)):
            return kind, path
    for sub in FRAMES if asked in (None, ARKIT) else ():
        if any(_is_frame_file(file) for file in sorted((path / sub).glob("*.json"))[:SHOWN]):
            return ARKIT, path / sub
    raise InputError(
        f"no camera file that texproj knows in {path}; name the file itself, or for COLMAP the"
        f" folder that holds cameras.bin or cameras.txt"
    )


def other_models(asked: Path, found: Path) -> tuple[str, ...]:
    """A sentence about COLMAP models beside the one that was found in folder `asked`."""
    if asked == found or not asked.is_dir():
        return ()
    models = colmap_models(found.parent)
    others = [f"{path.name} ({count} photos)" for path, count in models.items() if path != found]
    if not others or found not in models:
        return ()
    return (
        f"the largest model of {found.parent} was read, {found.name} ({models[found]} photos); each"
        f" has a frame of its own, so these were not: {', '.join(others[:SHOWN])}",
    )


def colmap_models(folder: Path) -> dict[Path, int]:
    """How many photos each COLMAP model has: of `folder` itself, or of the numbered folders in it,
    which COLMAP makes where the photos fall apart.
    """
    if _is_model(folder):
        return {folder: _count_images(folder)}
    parts = sorted(folder.iterdir()) if folder.is_dir() else []
    models = [part for part in parts if part.name.isdecimal() and _is_model(part)]
    return {model: _count_images(model) for model in models}


def _is_model(folder: Path) -> bool:
    return any(
        all((folder / f"{part}{ending}").is_file() for part in ("cameras", "images"))
        for ending in (".bin", ".txt")
    )


def _count_images(folder: Path) -> int:
    """Images of a model, without reading what they observe."""
    binary = folder / "images.bin"
    if binary.is_file():
        with binary.open("rb") as file:
            head = file.read(8)
        return int(struct.unpack("<Q", head)[0]) if len(head) == 8 else 0
    lines = read_text(folder / "images.txt").splitlines()
    words = (line.split(maxsplit=10) for line in lines if not line.startswith("#"))
    return sum(len(row) >= 10 and not row[-1].replace(".", "").isdecimal() for row in words)


def _of_file(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in BY_SUFFIX:
        return BY_SUFFIX[suffix]
    by_content = {
        ".xml": _of_xml, ".csv": _of_table, ".txt": _of_table, ".json": _of_json,
        ".bin": _of_binary,
    }  # fmt: skip
    found = by_content[suffix](path) if suffix in by_content else ""
    if found:
        return found
    raise InputError(f"{path}: not a camera file that texproj knows; name the format with --format")


def _of_xml(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES).replace(b"\0", b"")  # UTF-16
    return "blocks-exchange" if b"<BlocksExchange" in head else "metashape"


def _of_table(path: Path) -> str:
    lines = read_text(path).split("\n")
    if lines[0].strip() == PIX4D_HEADER[0]:
        return "pix4d"
    if path.suffix.lower() == ".txt":
        return "table" if columns(lines) else ""
    return "table" if columns(lines) and not _has_lens(lines[0]) else "realityscan"


def _has_lens(head: str) -> bool:
    """Whether a line names the columns of RealityScan's lenses."""
    words = head.lower().replace(";", ",").replace("\t", ",").split(",")
    return "k1" in [word.strip() for word in words]


def _of_binary(path: Path) -> str:
    return "openmvg" if path.name.lower() == "sfm_data.bin" else ""


def _of_json(path: Path) -> str:
    content = read_json(path)
    if isinstance(content, list):
        first = content[0] if content and isinstance(content[0], dict) else {}
        return next((kind for key, kind in LISTS.items() if key in first), "")
    if not isinstance(content, dict):
        return ""
    if content.get("format") == "texproj-cameras":
        return OWN
    if str(content.get("format")).startswith("application/opf-"):
        return "opf"
    if is_frame(content):
        return ARKIT
    return next((kind for key, kind in OBJECTS.items() if key in content), "")


def _is_frame_file(path: Path) -> bool:
    """Whether a JSON file is a frame of an app on a telephone."""
    try:
        return is_frame(read_json(path))
    except InputError:
        return False
