"""Which program a camera file is from: by its name, and by its content where names are shared."""

from __future__ import annotations

from pathlib import Path

from texproj.errors import InputError
from texproj.formats.interchange.text import read_json

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
COLMAP_FOLDERS = ("", "sparse", "sparse/0", "0")


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
        names = {p.name for p in (path / sub).iterdir()} if (path / sub).is_dir() else set()
        if {"cameras.bin", "images.bin"} <= names or {"cameras.txt", "images.txt"} <= names:
            return "colmap", path / sub
    for name, kind in IN_FOLDER.items():
        if (path / name).is_file() and asked in (None, kind):
            return kind, path / name
    if asked in (None, SIDECARS) and any(path.glob("*.xmp")):
        return SIDECARS, path
    raise InputError(
        f"no camera file that texproj knows in {path}; name the file itself, or for COLMAP the"
        f" folder that holds cameras.bin or cameras.txt"
    )


def _of_file(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in BY_SUFFIX:
        return BY_SUFFIX[suffix]
    if suffix == ".json":
        content = read_json(path)
        if content.get("format") == "texproj-cameras":
            return OWN
        if "frames" in content:
            return "nerfstudio"
        if "extrinsics" in content:
            return "openmvg"
        if "featuresFolders" in content or "poses" in content:
            return "meshroom"
    raise InputError(f"{path}: not a camera file that texproj knows; name the format with --format")
