"""What the surface is made of, as the page shows it."""

from __future__ import annotations

from typing import Any

import numpy as np

from texproj.errors import InputError
from texproj.formats.documents import read_json
from texproj.project import Project
from texproj.stages.appearance_files import MATERIALS

NUMBERS = ("roughness", "share")


def material_table(project: Project) -> list[dict[str, Any]]:
    """The materials of out/materials.json; empty where there is none. Raises InputError for one
    that `appearance` did not write.
    """
    path = project.out / MATERIALS
    if not path.is_file():
        return []
    told = read_json(path)
    if not isinstance(told, list) or not all(_is_material(one) for one in told):
        raise InputError(f"{path} is not as `texproj appearance` writes it; run it again")
    return told


def _is_material(one: Any) -> bool:
    if not isinstance(one, dict) or not isinstance(one.get("name"), str):
        return False
    color, f0 = one.get("base_color"), one.get("f0")
    numbers = [one.get(key) for key in NUMBERS]
    numbers += [] if f0 is None else [f0]
    numbers += [] if color is None else list(color) if isinstance(color, list) else [None]
    right = all(isinstance(x, int | float) and np.isfinite(x) for x in numbers)
    return right and isinstance(one.get("metallic"), bool)
