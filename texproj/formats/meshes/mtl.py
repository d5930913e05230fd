"""MTL: the names of an OBJ's materials, and the images of their colors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from texproj.errors import InputError
from texproj.formats.documents import read_lines
from texproj.layout import Material

MOST_BYTES = 64 << 20
TILES, FIRST_TILE = "<UDIM>", "1001"
"""In a file's name, the first stands for the number of a tile (UDIM)."""
OPTIONS = {
    "-s": 3, "-o": 3, "-t": 3, "-mm": 2, "-bm": 1, "-boost": 1, "-texres": 1,
    "-clamp": 1, "-blendu": 1, "-blendv": 1, "-imfchan": 1, "-cc": 1, "-type": 1,
}  # fmt: skip
"""Of map_Kd, with the number of words that may follow each."""


def read_materials(obj: Path, libraries: Iterable[str]) -> Iterator[Material]:
    """The materials of an OBJ's libraries; what cannot be read is no material of theirs."""
    for name in libraries:
        found = beside(obj, name)
        if found is not None:
            try:
                yield from _materials(found, read_lines(found, MOST_BYTES))
            except InputError:
                continue


def beside(file: Path, name: str) -> Path | None:
    """The file that another names, in its folder or below, or, where the project links to that one,
    beside the original; None where there is none.
    """
    relative = Path(name.strip().strip('"').replace("\\", "/"))
    if relative.is_absolute() or ".." in relative.parts or "\0" in name:
        relative = Path(relative.name)
    for folder in (file.parent, file.resolve().parent):
        for candidate in (folder / relative, folder / relative.name):
            try:
                if candidate.is_file():
                    return candidate
            except (OSError, ValueError):
                return None
    return None


def _materials(file: Path, lines: Iterable[str]) -> Iterator[Material]:
    name, color, image = None, (1.0, 1.0, 1.0), None
    for line in lines:
        words = line.split(None, 1)
        key, rest = (words[0].lower(), words[1].strip()) if len(words) == 2 else ("", "")
        if key == "newmtl":
            if name is not None:
                yield _material(file, name, color, image)
            name, color, image = rest, (1.0, 1.0, 1.0), None
        elif key == "kd":
            color = _color(rest) or color
        elif key == "map_kd":
            image = _without_options(rest)
    if name is not None:
        yield _material(file, name, color, image)


def image_names(lines: Iterable[str]) -> Iterator[str]:
    """The names of all images of colors."""
    for line in lines:
        words = line.split(None, 1)
        if len(words) == 2 and words[0].lower() == "map_kd":
            yield _without_options(words[1].strip()).replace("\\", "/")


def _material(
    file: Path, name: str, color: tuple[float, float, float], image: str | None
) -> Material:
    if image is None:
        return Material(name, None, color)
    found = beside(file, image.replace(TILES, FIRST_TILE))
    return Material(name, found, color, "" if found else f"there is no {image} beside {file.name}")


def _color(text: str) -> tuple[float, float, float] | None:
    try:
        r, g, b = (min(max(float(word), 0.0), 1.0) for word in text.split()[:3])
    except ValueError:
        return None
    return r, g, b


def _without_options(text: str) -> str:
    """The name of the file, which may hold spaces, after options and their values."""
    words = text.split()
    while words and words[0].lower() in OPTIONS:
        most = OPTIONS[words.pop(0).lower()]
        while most and words and _is_value(words[0]):
            words, most = words[1:], most - 1
    return " ".join(words)


def _is_value(word: str) -> bool:
    if word.lower() in ("on", "off"):
        return True
    try:
        float(word)
    except ValueError:
        return False
    return True
