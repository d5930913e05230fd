"""The result's colors on the vertices of the mesh that the page shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import trimesh
from numpy.typing import NDArray
from plyfile import PlyData
from scipy.spatial import cKDTree

from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.models import scan_from_node
from texproj.formats.models.read_values import read_values
from texproj.photo import srgb_from_linear
from texproj.preview.surface import Surface
from texproj.project import Project

T = TypeVar("T")

MATERIAL = ("roughness", "metallic", "confidence")
"""What appearance.ply tells of the surface beside its color."""


def vertex_colors(project: Project, surface: Surface) -> NDArray[np.uint8]:
    """(V, 4) uint8 sRGB and 255 (0 = no photo sees it) of each vertex of the repaired mesh.

    Raises InputError if there is no out/model.ply, or it belongs to another mesh.
    """
    path = project.out / "model.ply"
    if not path.is_file():
        raise InputError(f"no {path}; color the vertices first")
    return _on_repaired(path, _read(path, lambda: _ply_colors(path)), surface)


def base_colors(project: Project, surface: Surface) -> NDArray[np.uint8]:
    """The same of the base colors of out/appearance.ply: of the surface without the light of the
    photos.
    """
    path = project.out / "appearance.ply"
    if not path.is_file():
        raise InputError(f"no {path}; take the light out first")
    return _on_repaired(path, _read(path, lambda: _base_colors(path)), surface)


def material_values(project: Project, surface: Surface, name: str) -> NDArray[np.float32]:
    """(V,) one of `MATERIAL` at each vertex of the repaired mesh, -1 where no photo looks. Raises
    InputError as `base_colors` does.
    """
    path = project.out / "appearance.ply"
    if not path.is_file():
        raise InputError(f"no {path}; take the light out first")
    found = read_values(path, (name, "confidence"))
    values = np.where(found["confidence"] > 0, found[name], -1).astype(np.float32)
    return _on_repaired(path, values[:, None], surface)[:, 0]


def _on_repaired(path: Path, rgba: NDArray[Any], surface: Surface) -> NDArray[Any]:
    """(V, n) what the vertices of the scan's file have on those of the repaired mesh; 0 where there
    is none.
    """
    source = surface.source
    if len(rgba) != len(source.source_vertices):
        raise InputError(f"{path} was made from another mesh; color it again")
    out = np.zeros((len(source.mesh.vertices), rgba.shape[1]), rgba.dtype)
    known = source.vertex_of_source >= 0
    out[source.vertex_of_source[known]] = rgba[known]
    return out


def texture_colors(project: Project, surface: Surface) -> NDArray[np.uint8]:
    """(L, 4) uint8 sRGB and 255 (0 = no texture) of each vertex of the light mesh: the texture
    at the nearest vertex of out/model.glb. Raises InputError where there is none.
    """
    path = project.out / "model.glb"
    if surface.light is None or not path.is_file():
        raise InputError(f"no {path}, or a mesh too small to be simplified")
    vertices, colors = _read(path, lambda: _scene_colors(path))
    nearest = cKDTree(vertices).query(surface.light.mesh.vertices)[1]
    return np.ascontiguousarray(colors[nearest])


def _read(path: Path, read: Callable[[], T]) -> T:
    """What `read` reads of a model. Raises InputError for a file that is cut or broken."""
    try:
        with foreign_parser():
            return read()
    except Broken as error:
        raise InputError(f"{path} is broken ({error}); color the model again") from None


def _ply_colors(path: Path) -> NDArray[np.uint8]:
    return np.asarray(trimesh.load(path, process=False).visual.vertex_colors, np.uint8)


def _base_colors(path: Path) -> NDArray[np.uint8]:
    vertex = PlyData.read(path)["vertex"]
    known = np.where(vertex["confidence"] > 0, 255, 0)
    channels = [vertex["red"], vertex["green"], vertex["blue"], known]
    return np.stack(channels, axis=1).astype(np.uint8)


def _scene_colors(path: Path) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Vertices of all parts of a glb in the scan's frame, and the color at each."""
    scene = trimesh.load_scene(path, process=False)
    parts = [_part_colors(scene, node) for node in scene.graph.nodes_geometry]
    return np.concatenate([xyz for xyz, _ in parts]), np.concatenate([rgba for _, rgba in parts])


def _part_colors(scene: trimesh.Scene, node: str) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Vertices of one primitive in the scan's frame, and its own or the texture's color at each."""
    transform, part = scan_from_node(scene, node), scene.geometry[scene.graph[node][1]]
    colors = np.zeros((len(part.vertices), 4), np.uint8)
    linear = getattr(part.visual, "vertex_attributes", {}).get("color")
    if linear is not None:
        colors[:, :3] = np.round(srgb_from_linear(linear[:, :3]) * 255)
        colors[:, 3] = 255
    image = getattr(getattr(part.visual, "material", None), "baseColorTexture", None)
    uv = getattr(part.visual, "uv", None)
    if image is not None and uv is not None:
        small = np.asarray(image.convert("RGB").reduce(max(1, max(image.size) // SMALL_PX)))
        size = np.array([small.shape[1], small.shape[0]])
        column, row = np.clip((uv * (1, -1) + (0, 1)) * size, 0, size - 1).astype(int).T
        colors[:, :3], colors[:, 3] = small[row, column], 255
    return trimesh.transform_points(part.vertices, transform), colors


SMALL_PX = 2048
"""Longer side to which the texture is reduced before single texels are taken from it."""
