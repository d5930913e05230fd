"""What the records of the stages in work/ must be to be believed: anybody may have been there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KINDS: dict[str, type] = {
    **dict.fromkeys(("inputs", "outputs", "failed", "quality", "occluders", "found"), dict),
    **dict.fromkeys(("written", "before", "after", "moved_px", "thrown_out", "light"), dict),
    **dict.fromkeys(("alike", "standing", "provenance"), dict),
    **dict.fromkeys(("used", "alone", "pairs", "mesh notes", "questions"), list),
    "copyright": str,
}
"""What stands under a key, in the record of whichever stage."""

NEEDED = {
    "color": ("outputs", "used", "failed", "quality", "occluders"),
    "appearance": ("outputs", "used", "failed", "light"),
    "refine": ("before", "after", "moved_px", "thrown_out", "quality"),
    "occluders": ("found", "written"),
    "report": ("outputs",),
}
"""Keys without which the record of a stage says nothing."""


def believable(stage: str, record: Mapping[str, Any]) -> bool:
    """Whether a record is of the shape that its stage writes."""
    needed = ("inputs", *NEEDED.get(stage, ()))
    known = {key: kind for key, kind in KINDS.items() if key in record}
    return all(key in record for key in needed) and all(
        isinstance(record[key], kind) for key, kind in known.items()
    )
