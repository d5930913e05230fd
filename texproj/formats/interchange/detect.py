"""Which program a camera file is from: by its name, and by its content where names are shared."""

from __future__ import annotations

import struct
from pathlib import Path

from texproj.errors import InputError
from texproj.formats.documents import read_text
from texproj.formats.interchange.text import read_object

BY_SUFFIX = {
    ".mlp": "meshlab", ".out": "bundler", ".xml": "metashape", ".csv": "realityscan",
    ".sfm": "meshroom",
}  # fmt: skip
MODEL_FILES = {f"{part}{ending}" for part in ("cameras", "images") for ending in (".bin", ".txt")}
IN_FOLDER = {
    "transforms.json": "nerfstudio", "sfm_data.json": "openmvg", "bundle.out": "bundler",
    "cameras.xml": "metashape", "cameras.mlp": "meshlab", "cameras.csv": "realityscan",
}  # fmt: skip
OWN = "texproj"
SIDECARS = "realityscan-xmp"
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
    if path.name in MODEL_FILES and asked in (None, "colmap"):
        return "colmap", path.parent
    return asked or _of_file(path), path


def _in_folder(path: Path, asked: str | None) -> tuple[str, Path]:
    for sub in COLMAP_FOLDERS if asked in (None, "colmap") else ():
        models = colmap_models(path / sub)
        if models:
            return "colmap", max(models, key=lambda model: models[model])
    for name, kind in IN_FOLDER.items():
        if (path / name).is_file() and asked in (None, kind):
            return kind, path / name
    if asked in (None, SIDECARS) and any(path.glob("*.xmp")):
        return SIDECARS, path
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
    if suffix == ".json":
        content = read_object(path)
        if content.get("format") == "texproj-cameras":
            return OWN
        if "frames" in content:
            return "nerfstudio"
        if "extrinsics" in content:
            return "openmvg"
        if "featuresFolders" in content or "poses" in content:
            return "meshroom"
    raise InputError(f"{path}: not a camera file that texproj knows; name the format with --format")
