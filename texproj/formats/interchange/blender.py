"""A Blender script (.py) that builds the scene: the mesh, and a camera for each photo, which lies
behind it. Blender's cameras look along -z with y up and have no distortion; their shift is the
principal point's offset in widths of the picture (docs.blender.org, bpy.types.Camera).
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from texproj.camera import Intrinsics
from texproj.formats.interchange.model import (
    Y_AND_Z_FLIPPED,
    Shot,
    Written,
    beyond_k3,
    brown_terms,
    left_out,
    sentences,
)

FILM_MM = 36.0
SCRIPT = '''"""Builds the scene of a texproj project. Run: blender --python cameras.py"""

import json
from pathlib import Path

import bpy
from mathutils import Matrix

MESH = {mesh}
CAMERAS = json.loads("""{cameras}""")
FOLDER = Path(__file__).resolve().parent
IMPORTERS = {{
    ".ply": lambda p: bpy.ops.wm.ply_import(filepath=p, forward_axis="Y", up_axis="Z"),
    ".obj": lambda p: bpy.ops.wm.obj_import(filepath=p, forward_axis="Y", up_axis="Z"),
    ".stl": lambda p: bpy.ops.wm.stl_import(filepath=p, forward_axis="Y", up_axis="Z"),
    ".glb": lambda p: bpy.ops.import_scene.gltf(filepath=p),
    ".gltf": lambda p: bpy.ops.import_scene.gltf(filepath=p),
}}


def add_mesh(path):
    """The mesh as its file has it; glTF is turned back from Blender's z up."""
    before = set(bpy.data.objects)
    IMPORTERS[path.suffix.lower()](str(path))
    if path.suffix.lower() in (".glb", ".gltf"):
        back = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))
        for added in set(bpy.data.objects) - before:
            if added.parent is None:
                added.matrix_world = back @ added.matrix_world


def add_camera(entry):
    """A camera with its photo behind what it sees."""
    data = bpy.data.cameras.new(entry["name"])
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = entry["sensor_width_mm"]
    data.lens = entry["lens_mm"]
    data.shift_x, data.shift_y = entry["shift"]
    shown = bpy.data.objects.new(entry["name"], data)
    shown.matrix_world = Matrix(entry["world_from_cam"])
    bpy.context.scene.collection.objects.link(shown)
    photo = FOLDER / entry["photo"]
    if photo.exists():
        data.show_background_images = True
        behind = data.background_images.new()
        behind.image = bpy.data.images.load(str(photo))
        behind.display_depth = "FRONT"
        behind.alpha = 0.5
    return shown


scene = bpy.context.scene
for old in [o for o in scene.objects if o.name in ("Cube", "Camera", "Light")]:
    bpy.data.objects.remove(old)
if (FOLDER / MESH).suffix.lower() in IMPORTERS and (FOLDER / MESH).exists():
    add_mesh(FOLDER / MESH)
else:
    print("texproj: import the mesh by hand:", FOLDER / MESH)
added = [add_camera(entry) for entry in CAMERAS]
scene.camera = added[0]
scene.render.resolution_x, scene.render.resolution_y = CAMERAS[0]["size"]
scene.render.resolution_percentage = 100
'''


def write_blender(shots: Sequence[Shot], mesh: str) -> Written:
    """cameras.py; `mesh`: its path as seen from there."""
    entries = [_entry(shot) for shot in shots]
    text = json.dumps(entries, indent=1).replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    script = SCRIPT.format(mesh=ascii(mesh), cameras=text)
    return Written.of({"cameras.py": script.encode()}, shots, _lost)


def _entry(shot: Shot) -> dict[str, object]:
    k, inverse = shot.camera.intrinsics, shot.camera.pose.inverse
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = inverse.R @ Y_AND_Z_FLIPPED, inverse.t
    return {
        "name": shot.name, "photo": shot.path, "size": [k.width, k.height],
        "sensor_width_mm": FILM_MM, "lens_mm": (k.fx + k.fy) / 2 * FILM_MM / k.width,
        "shift": [(k.width / 2 - k.cx) / k.width, (k.cy - k.height / 2) / k.width],
        "world_from_cam": matrix.tolist(),
    }  # fmt: skip


def _lost(k: Intrinsics) -> str:
    named = brown_terms(k)
    higher = beyond_k3(k)
    return sentences([left_out({"fx - fy": k.fx - k.fy, **named, **higher})])
