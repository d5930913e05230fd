"""What registration and refinement keep in an entry of cameras.json beside the camera: where it
started, through which photos it was found, and what it was before all were refined together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from texproj.errors import InputError
from texproj.files import json_hash
from texproj.formats.cameras import entry_of_record, record_of_entry
from texproj.records import CameraRecord

START_KEY = "start"
"""Key of an entry under which the camera is kept that registration started from."""
BEFORE_KEY = "before_refine"
"""Key of an entry under which the photo's own registration is kept when all were refined."""
OWN_KEYS = (START_KEY, BEFORE_KEY)
THROUGH = "through"
"""Key of an entry's quality: the photos through which it was found, where it was."""

Entries = Mapping[str, CameraRecord]


def start_of(entry: CameraRecord | None) -> CameraRecord | None:
    """The camera that the registration of an entry starts from: what was there before it."""
    if entry is None or START_KEY not in entry.extra:
        return entry
    if entry.status == "prior":  # somebody has put a camera in place of a failure
        return replace(entry, extra=foreign(entry))
    start = entry.extra[START_KEY]
    return None if start is None else _nested(entry, start, START_KEY)


def own_registration(entry: CameraRecord) -> CameraRecord:
    """The entry as the photo's own registration left it, before all were refined together.

    What others have written into it since then stays; a camera that somebody has changed since
    then counts as the photo's own.
    """
    if not is_refined(entry):
        extra = {key: value for key, value in entry.extra.items() if key != BEFORE_KEY}
        return replace(entry, extra=extra)
    own = _nested(entry, entry.extra[BEFORE_KEY].get("entry"), BEFORE_KEY)
    kept = {key: value for key, value in own.extra.items() if key == START_KEY}
    return replace(own, extra={**foreign(entry), **kept})


def is_refined(entry: CameraRecord) -> bool:
    """Whether the entry holds what the joint refinement made of it, unchanged since then."""
    kept = entry.extra.get(BEFORE_KEY)
    return isinstance(kept, dict) and kept.get("refined") == camera_hash(entry)


def refined_entry(record: CameraRecord, own: CameraRecord, asked: bool) -> CameraRecord:
    """The entry `record` with the way back to the photo's own registration.

    asked: it was refined on request, while the settings had it switched off.
    """
    kept = {"entry": entry_of_record(own), "refined": camera_hash(record), "asked": asked}
    return replace(record, extra={**record.extra, BEFORE_KEY: kept})


def camera_hash(entry: CameraRecord) -> str:
    """Hash of the camera alone, so that a later edit of it by hand shows."""
    written = entry_of_record(entry)
    return json_hash([written.get(key) for key in ("K", "dist", "R", "t", "status")])


def foreign(entry: CameraRecord) -> dict[str, Any]:
    """What others have written into an entry."""
    return {key: value for key, value in entry.extra.items() if key not in OWN_KEYS}


def found_through(entry: CameraRecord | None) -> tuple[str, ...]:
    """The photos through which an entry's camera was found; none if it stands on its own."""
    if entry is None or START_KEY not in entry.extra or entry.method != "features":
        return ()
    names = entry.quality.get(THROUGH)
    return tuple(n for n in names if isinstance(n, str)) if isinstance(names, list) else ()


def resting_on(name: str, entries: Entries) -> set[str]:
    """The photos that were found through photo `name`, directly or through others."""
    found: set[str] = set()
    new = {name}
    while new:
        new = {n for n, e in entries.items() if n not in found and new & {*found_through(e)}}
        found |= new
    return found


def in_order(names: Iterable[str], entries: Entries) -> list[str]:
    """`names`, each after those through which it was found."""
    out, rest = [], list(names)
    while rest:
        waiting = set(rest)
        ready = [n for n in rest if not waiting & {*found_through(entries.get(n))} - {n}]
        ready = ready or rest  # a circle, by somebody's hand
        out += ready
        rest = [n for n in rest if n not in {*ready}]
    return out


def _nested(entry: CameraRecord, value: Any, key: str) -> CameraRecord:
    """A record that is kept inside an entry. Raises InputError."""
    where = f"cameras.json, photo {entry.file}: {key}"
    if not isinstance(value, dict):
        raise InputError(f"{where}: must be an entry as cameras.json has it; remove the key")
    return record_of_entry({"file": entry.file, **value}, where)
