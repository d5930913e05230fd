"""What a model was made from, for whoever archives it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from texproj.errors import excerpt
from texproj.formats.cameras import camera_part
from texproj.project import Project
from texproj.provenance import Provenance
from texproj.version import __version__

FORMAT, VERSION = "texproj-provenance", 1
LONGEST_COPYRIGHT = 1000
"""Characters of the one line for all photos; each photo's own words stand with it."""
SETTINGS = ("develop", "color", "unwrap", "patches", "output", "render")


def provenance_of(project: Project, used: Sequence[str]) -> Provenance:
    """The mesh, the photos that colored it with their cameras and their owners' words, the
    settings. Hashes are BLAKE2b of 16 bytes; a model that is made again from the same is the same.
    """
    records = project.load_cameras()
    photos, owners = [], []
    for name in used:
        info, record = project.photo_info(name), records[name]
        photos.append({
            "file": name, "blake2b": project.hash_of(project.photo_path(name)),
            "mask_blake2b": project.hash_of(project.mask_path(name)),
            **{key: value for key in ("copyright", "artist", "taken")
               if (value := getattr(info, key))},
            "width": record.width, "height": record.height, **camera_part(record),
            "method": record.method,
        })  # fmt: skip
        owners.append(info.copyright or info.artist)
    facts = {
        "format": FORMAT, "version": VERSION, "texproj": __version__,
        "mesh": {
            "file": project.mesh_path.name, "blake2b": project.hash_of(project.mesh_path),
        },
        "photos": photos,
        "settings": {name: asdict(project.settings.table(name)) for name in SETTINGS},
    }  # fmt: skip
    said = "; ".join(dict.fromkeys(owner for owner in owners if owner))
    return Provenance(excerpt(said, LONGEST_COPYRIGHT), _plain(facts))


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    """The facts as JSON has them; numbers that it has not become words."""
    plain: dict[str, Any] = json.loads(json.dumps(facts, default=str), parse_constant=str)
    return plain
