"""Points that were picked and named on a mesh in MeshLab: NAME_picked_points.pp.

``<PickedPoints><point x= y= z= name= active="1"/>``; points that are switched off have active="0".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import InputError, excerpt
from texproj.formats.camera_bounds import checked_translation
from texproj.formats.documents import finite_number, read_xml

ROOT, POINT = "PickedPoints", "point"


def read_picked_points(path: Path) -> dict[str, Doubles]:
    """The (3,) points by name, mesh units. Raises InputError for broken files, for a name that two
    points have, and for none.
    """
    root = read_xml(path)
    if root.tag != ROOT:
        raise InputError(f"{path}: not a file of MeshLab's picked points (no <{ROOT}> in it)")
    found: dict[str, Doubles] = {}
    for number, point in enumerate(root.iter(POINT), 1):
        name = (point.get("name") or "").strip() or str(number)
        if point.get("active", "1") == "0":
            continue
        where = f"{path}, point {excerpt(name)}"
        if name in found:
            raise InputError(f"{where}: two points have this name; give each its own in MeshLab")
        values = [finite_number(point.get(axis) or "") for axis in "xyz"]
        if None in values:
            raise InputError(f"{where}: x, y, z must be numbers")
        found[name] = checked_translation(np.array(values, np.float64), where, "x, y, z")
    if not found:
        raise InputError(f"{path}: it holds no point")
    return found
