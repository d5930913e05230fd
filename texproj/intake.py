"""Which files that a person put into a folder are photos, masks and picks, whatever the case of
their names and however their accents are composed; and which are nobody's, so that somebody can
be told.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from texproj.errors import InputError, nearest_name

MASK_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
MASK_ENDINGS = ("_mask", ".mask", "-mask")
"""What programs append to a photo's name to name its mask."""

NOT_READ = {
    **dict.fromkeys((".mp4", ".mov", ".avi", ".mts", ".m4v"), "video"),
    **dict.fromkeys((".webp", ".bmp", ".gif", ".jp2", ".jxl"), "other image"),
}
"""Pictures that are not read, by the ending of their names."""

JPEG_SUFFIXES = (".jpg", ".jpeg")

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
    files, notes = _visible(folder)
    for path in files:
        if path.suffix.lower() in suffixes:
            why = unusable_name(path.name)
            if why:
                notes.append(f"{shown(path)} is passed over: {why}; rename it")
            else:
                paths[path.name] = path
        elif path.suffix.lower() in NOT_READ:
            passed.append(path)
    return Found(paths, (*notes, *_not_read(folder, passed)))


def folders_of_photos(folder: Path, suffixes: Sequence[str]) -> dict[Path, Found]:
    """What `find_photos` finds in the folders of a folder, where it finds any; why one cannot be
    read is a note.
    """
    below = [place for place in _entries(folder) if place.is_dir()] if folder.is_dir() else []
    found = {}
    for place in below:
        try:
            found[place] = find_photos(place, suffixes)
        except InputError as error:
            found[place] = Found({}, (str(error),))
    return {place: photos for place, photos in found.items() if photos.paths or photos.notes}


def _not_read(folder: Path, passed: Sequence[Path]) -> list[str]:
    if not passed:
        return []
    kinds = sorted({NOT_READ[path.suffix.lower()] for path in passed})
    what = f"{len(passed)} file{'s' if len(passed) > 1 else ''} skipped in {shown(folder)}"
    return [f"{what}: {_named(passed)} ({', '.join(kinds)}: save as jpg, png or tif first)"]


def one_per_shot(
    paths: Mapping[str, Path], raw_suffixes: Sequence[str], prefer: Literal["raw", "jpeg"]
) -> Found:
    """The photos, of shots that are there as RAW and as JPEG only the preferred one, and a note."""
    stems: dict[str, list[str]] = {}
    for name in paths:
        stems.setdefault(plain(Path(name).stem), []).append(name)
    passed: list[Path] = []
    for names in stems.values():
        raws = [name for name in names if Path(name).suffix.lower() in raw_suffixes]
        jpegs = [name for name in names if Path(name).suffix.lower() in JPEG_SUFFIXES]
        if len(raws) == len(jpegs) == 1 and paths[raws[0]].parent == paths[jpegs[0]].parent:
            passed.append(paths[jpegs[0] if prefer == "raw" else raws[0]])
    out = set(passed)
    kept = {name: path for name, path in paths.items() if path not in out}
    return Found(kept, tuple(_other_half(passed, prefer)))


def _other_half(passed: Sequence[Path], prefer: str) -> list[str]:
    if not passed:
        return []
    shots = f"{len(passed)} shot{'s are' if len(passed) > 1 else ' is'}"
    taken, other = ("RAW", "jpeg") if prefer == "raw" else ("JPEG", "raw")
    return [
        f"{shots} there as RAW and as JPEG: the {taken} is used, not {_named(passed)}"
        f' ([develop] pair = "{other}" takes these)'
    ]


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


def find_crossed(folder: Path, photos: Iterable[str], suffixes: Sequence[str]) -> Found:
    """The partners of photos, taken through crossed polarizers: the same name, of any format."""
    return _matched(folder, photos, suffixes, (), "a photo")


def one_of(found: Found, photo: str) -> Path | None:
    """The file of a photo, None if it has none. Raises InputError where several claim it."""
    if photo in found.several:
        names = " and ".join(shown(path) for path in found.several[photo])
        raise InputError(f"{names} both belong to {photo}; keep one of them")
    return found.paths.get(photo)


def all_of(found: Found, photo: str) -> tuple[Path, ...]:
    """The files that claim a photo: one, none, or by mistake several."""
    if photo in found.several:
        return tuple(found.several[photo])
    return (found.paths[photo],) if photo in found.paths else ()


def _matched(
    folder: Path,
    photos: Iterable[str],
    suffixes: Sequence[str],
    endings: Sequence[str],
    kind: str,
) -> Found:
    owners = {plain(key): name for name in photos for key in (name, Path(name).stem)}
    claims: dict[str, list[Path]] = {}
    strays = 0
    files, notes = _visible(folder)
    for path in files:
        if path.suffix.lower() not in suffixes:
            notes.append(f"{shown(path)} is ignored: it is not {kind}")
            continue
        owner = _owner(path.stem, owners, endings)
        if owner is None:
            strays += 1
            near = _near(path.stem, owners.values()) if strays <= MOST_NAMED else ""
            notes.append(f"{shown(path)} is ignored: it belongs to no photo{near}")
        else:
            claims.setdefault(owner, []).append(path)
    return Found(
        {name: paths[0] for name, paths in claims.items()},
        tuple(notes),
        {name: tuple(paths) for name, paths in claims.items() if len(paths) > 1},
    )


def _near(stem: str, photos: Iterable[str]) -> str:
    """Which photo may be meant by a name; as slow as there are photos."""
    near = nearest_name(stem, {Path(name).stem for name in photos})
    return near if "did you mean" in near else ""


def _owner(stem: str, owners: Mapping[str, str], endings: Sequence[str]) -> str | None:
    key = plain(stem)
    for ending in ("", *endings):
        if key.endswith(ending) and key.removesuffix(ending) in owners:
            return owners[key.removesuffix(ending)]
    return None


def _visible(folder: Path) -> tuple[list[Path], list[str]]:
    """The files of a folder that the system does not hide, in the order of their names, and a
    sentence for each link to a file that is gone. Raises InputError where the folder is none or
    cannot be read.
    """
    if why := points_nowhere(folder):
        raise InputError(f"{shown(folder)}: {why}")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{shown(folder)} is a file where a folder should be; move it away")
    if not folder.is_dir():
        return [], []
    hidden = ("thumbs.db", "desktop.ini")
    found = _entries(folder)
    gone = [
        f"{shown(path)} is passed over: {why}" for path in found if (why := points_nowhere(path))
    ]
    return [path for path in found if path.name.lower() not in hidden and path.is_file()], gone


def _entries(folder: Path) -> list[Path]:
    """What is in a folder and not hidden by its name, sorted. Raises InputError."""
    try:
        return sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{shown(folder)} cannot be read: {error.strerror}") from None


def points_nowhere(path: Path) -> str:
    """Why a link cannot be followed; empty if it can, and for what is no link."""
    if not path.is_symlink() or path.exists():
        return ""
    return f"it is a link to {shown(path.readlink())}, which is not there; is its disk connected?"


def the_one_mesh(folder: Path, suffixes: Sequence[str], settings: Path) -> Path:
    """The mesh in a folder. Raises InputError for none, or for more than one to choose from, which
    the file `settings` can.
    """
    files, gone = _visible(folder)
    found = [path for path in files if path.suffix.lower() in suffixes]
    if not found:
        kinds = ", ".join(suffix[1:] for suffix in suffixes)
        said = "".join(f" ({note})" for note in gone)
        raise InputError(f"no mesh in {folder}; put one file there ({kinds}){said}")
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise InputError(
            f'several meshes in {folder} ({names}); say which: mesh = "mesh/{found[0].name}" '
            f"in {settings}"
        )
    return found[0]


def refuse_same_stems(photos: Iterable[Path]) -> None:
    """Raise InputError for two photos whose masks and picks would have the same name."""
    stems: dict[str, Path] = {}
    for path in photos:
        if path.stem in stems:
            raise InputError(
                f"{stems[path.stem]} and {path.name} differ only in their ending, "
                f"so masks and correspondences cannot tell them apart; rename one"
            )
        stems[path.stem] = path
