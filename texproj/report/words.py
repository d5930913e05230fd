"""Numbers of the report's details in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

MOST_NAMED = 3
SAME_EXPOSURE = 0.05
"""Stops that are none when rounded."""


def _part(of_what: str) -> Callable[[float], str]:
    return lambda value: f"{100 * value:.1f} % of {of_what}"


def _count(of_what: str) -> Callable[[float], str]:
    return lambda value: f"{value:,} {of_what}"


QUALITY: dict[str, tuple[str, Callable[[Any], str]]] = {
    "points": ("colored", _count("texels or vertices")),
    "seen": ("seen", _part("the surface is seen by a photo")),
    "seen_by_one": ("seen once", _part("that by one photo alone")),
    "photos_per_point": ("seen by", lambda value: f"{value:.1f} photos on the mean"),
    "behind": ("backs", _part("what photos see of the surface is the back of faces")),
    "preference": ("preference", lambda value: f"{value:g} for the best of the photos that agree"),
    "patches": ("patches", _count("pieces of single photos")),
    "cut_for_overlap": ("cut", _count("pieces, since they would overlap on the page")),
    "scale": ("resolution", _part("what the photos have, by what fits on the pages")),
}
"""Title and words of the numbers that coloring tells of the whole."""


def details(quality: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Title and text of each number that the coloring tells of the whole."""
    return [
        (title, words(quality[name]))
        for name, (title, words) in QUALITY.items()
        if isinstance(quality.get(name), int | float)
    ]


def light_of(row: Mapping[str, Any]) -> str:
    """What the coloring says of one photo."""
    told = [f"gain {', '.join(f'{gain:.2f}' for gain in row['gain'])}"]
    off = row.get("exposure_off") or 0.0
    if abs(off) >= SAME_EXPOSURE:
        way = "darker" if off > 0 else "brighter"
        told.append(f"{abs(off):.1f} stops {way} than its EXIF says")
    if row.get("sharpness") is not None:
        told.append(f"its fine detail has {100 * row['sharpness']:.0f} % of the others' contrast")
    if row.get("share") is not None:
        told.append(f"gives {100 * row['share']:.0f} % of the color")
    return "; ".join(told)


def shared_notes(photos: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The notes that several photos have, and whose they are."""
    count = Counter(note for photo in photos for note in dict.fromkeys(photo["notes"]))
    out = {}
    for note in (n for n, times in count.items() if times > 1):
        names = [photo["file"] for photo in photos if note in photo["notes"]]
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        whose = ", ".join(names[:MOST_NAMED]) + more
        out[note] = "all photos" if len(names) == len(photos) else whose
    return out
