"""Which files that a person put into a folder are photos, masks and picks, whatever the case of
their names and however their accents are composed; and which are nobody's, so that somebody can
be told.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from texproj.errors import InputError, nearest_name

MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
MASK_ENDINGS = ("_mask", ".mask", "-mask")
"""What programs append to a photo's name to name its mask."""

TO_DEVELOP = {
    **dict.fromkeys(
        (".cr2", ".cr3", ".nef", ".arw", ".dng", ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr"),
        "RAW",
    ),
    **dict.fromkeys((".heic", ".heif", ".avif"), "HEIC"),
    **dict.fromkeys((".mp4", ".mov", ".avi", ".mts", ".m4v"), "video"),
    **dict.fromkeys((".webp", ".bmp", ".gif", ".exr", ".jp2"), "other image"),
}
"""Pictures that are not read, by the ending of their names."""

MOST_NAMED = 5
"""Files that one sentence names."""


@dataclass(frozen=True)
class Found:
    """Files of a folder by the name of the photo that they belong to, and sentences about others.

    several: for photos that more than one file claims, those files.
    """

    paths: Mapping[str, Path]
    notes: tuple[str, ...] = ()
    several: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)


def plain(name: str) -> str:
    """A name as it is compared: composed accents, no case."""
    return unicodedata.normalize("NFC", name).casefold()


def unusable_name(name: str) -> str:
    """Why a file's name cannot be written to a text file and read back; empty if it can."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return "its name is not UTF-8"
    return "" if name.isprintable() else "its name holds a line break or another control character"


def shown(path: Path) -> str:
    """A path that can be printed, whatever bytes it is made of."""
    return str(path).encode(errors="backslashreplace").decode().replace("\n", "\\n")


def find_photos(folder: Path, suffixes: Sequence[str]) -> Found:
    """The photos in a folder, in the order of their names, and what was passed over."""
    paths: dict[str, Path] = {}
    passed: list[Path] = []
    notes = []
    for path in _visible(folder):
        if path.suffix.lower() in suffixes:
            why = unusable_name(path.name)
            if why:
                notes.append(f"{shown(path)} is passed over: {why}; rename it")
            else:
                paths[path.name] = path
        elif path.suffix.lower() in TO_DEVELOP:
            passed.append(path)
    return Found(paths, (*notes, *_to_develop(folder, passed)))


def _to_develop(folder: Path, passed: Sequence[Path]) -> list[str]:
    if not passed:
        return []
    kinds = sorted({TO_DEVELOP[path.suffix.lower()] for path in passed})
    what = f"{len(passed)} file{'s' if len(passed) > 1 else ''} skipped in {shown(folder)}"
    return [f"{what}: {_named(passed)} ({', '.join(kinds)}: save as jpg, png or tif first)"]


def _named(paths: Sequence[Path]) -> str:
    names = ", ".join(shown(Path(path.name)) for path in paths[:MOST_NAMED])
    more = len(paths) - MOST_NAMED
    return f"{names} and {more} more" if more > 0 else names


def find_masks(folder: Path, photos: Iterable[str]) -> Found:
    """The masks of photos: STEM.png, STEM.jpg.png, STEM_mask.png, STEM.mask.png, also jpg, tif."""
    return _matched(folder, photos, MASK_SUFFIXES, MASK_ENDINGS, "an image (png, jpg or tif)")


def find_picks(folder: Path, photos: Iterable[str]) -> Found:
    """The picks of photos: STEM.csv, or STEM.jpg.csv."""
    return _matched(folder, photos, (".csv",), (), "a csv")


def one_of(found: Found, photo: str) -> Path | None:
    """The file of a photo, None if it has none. Raises InputError where several claim it."""
    if photo in found.several:
        names = " and ".join(shown(path) for path in found.several[photo])
        raise InputError(f"{names} both belong to {photo}; keep one of them")
    return found.paths.get(photo)


def _matched(
    folder: Path,
    photos: Iterable[str],
    suffixes: Sequence[str],
    endings: Sequence[str],
    kind: str,
) -> Found:
    owners = {plain(key): name for name in photos for key in (name, Path(name).stem)}
    claims: dict[str, list[Path]] = {}
    notes = []
    for path in _visible(folder):
        if path.suffix.lower() not in suffixes:
            notes.append(f"{shown(path)} is ignored: it is not {kind}")
            continue
        owner = _owner(path.stem, owners, endings)
        if owner is None:
            near = nearest_name(path.stem, {Path(name).stem for name in owners.values()})
            near = near if "did you mean" in near else ""
            notes.append(f"{shown(path)} is ignored: it belongs to no photo{near}")
        else:
            claims.setdefault(owner, []).append(path)
    return Found(
        {name: paths[0] for name, paths in claims.items()},
        tuple(notes),
        {name: tuple(paths) for name, paths in claims.items() if len(paths) > 1},
    )


def _owner(stem: str, owners: Mapping[str, str], endings: Sequence[str]) -> str | None:
    key = plain(stem)
    for ending in ("", *endings):
        if key.endswith(ending) and key.removesuffix(ending) in owners:
            return owners[key.removesuffix(ending)]
    return None


def _visible(folder: Path) -> list[Path]:
    """The files of a folder that the system does not hide, in the order of their names."""
    if not folder.is_dir():
        return []
    hidden = ("thumbs.db", "desktop.ini")
    found = (path for path in folder.iterdir() if not path.name.startswith("."))
    return sorted(path for path in found if path.name.lower() not in hidden and path.is_file())
