"""Reading back the colored models that this package writes, to look at them, in the frame of the
scan.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError
from texproj.formats.foreign import Broken, foreign_parser
from texproj.formats.models.glb import UPRIGHT
from texproj.mesh import ColoredMesh, Mesh, NormalMap, TexturedMesh
from texproj.photo import srgb_from_linear
from texproj.tangent_frames import tangent_frames

ON_THE_EDGE = 1e-6
"""Of a tile: corners this far beyond its border lie on it. Each part lies in one tile."""


def read_model(path: Path) -> TexturedMesh | ColoredMesh:
    """A ply with vertex colors, an obj with textures, or a glb with either; vertices that are not
    finite, which no face has, are put where one has: so the whole can be drawn.

    Raises InputError for a file that is neither or damaged, and for a glb with images that cannot
    be read.
    """
    try:
        with foreign_parser():
            return _drawable(_read(path))
    except Broken as error:
        raise InputError(f"{path}: damaged ({error}); run `texproj color` again") from None


def _read(path: Path) -> TexturedMesh | ColoredMesh:
    import trimesh  # noqa: PLC0415

    scene = trimesh.load_scene(path, process=False)
    if path.suffix == ".ply":
        (part,) = scene.geometry.values()
        colors = np.asarray(part.visual.vertex_colors, np.uint8)[:, :3]
        faces, vertices = np.asarray(part.faces, np.int32), np.asarray(part.vertices, np.float64)
        if len(colors) != len(vertices) or not len(faces) or faces.max() >= len(vertices):
            raise Broken("its colors do not belong to its vertices")
        return ColoredMesh(vertices, faces, colors)
    parts = [_Part(scene, node) for node in scene.graph.nodes_geometry]
    if len(parts) == 1 and parts[0].linear is not None:
        encoded = np.round(srgb_from_linear(parts[0].linear[:, :3]) * 255).astype(np.uint8)
        return ColoredMesh(parts[0].vertices, parts[0].faces, encoded)
    if not any(part.page is not None for part in parts):
        raise InputError(f"{path} has no texture that can be read")
    return _textured(parts)


def _drawable(model: TexturedMesh | ColoredMesh) -> TexturedMesh | ColoredMesh:
    finite = np.isfinite(model.vertices).all(axis=1, keepdims=True)
    if finite.all() or not len(model.faces):
        return model
    return replace(
        model, vertices=np.where(finite, model.vertices, model.vertices[model.faces[0, 0]])
    )


def scan_from_node(scene: Any, node: str) -> NDArray[np.float64]:
    """(4, 4) of a node of a trimesh scene: to the scan's frame, without the turn and scale by which
    a glb stands upright.
    """
    transform = np.asarray(scene.graph[node][0], np.float64)
    if UPRIGHT not in scene.graph.nodes:
        return transform
    upright = np.asarray(scene.graph[UPRIGHT][0], np.float64)
    return np.asarray(np.linalg.solve(upright, transform), np.float64)


class _Part:
    """One primitive of a glb, or one material of an obj, in the scan's frame."""

    def __init__(self, scene: Any, node: str) -> None:
        transform, geometry = scan_from_node(scene, node), scene.geometry[scene.graph[node][1]]
        self.vertices = np.asarray(geometry.vertices, np.float64) @ transform[:3, :3].T
        self.vertices += transform[:3, 3]
        self.faces = np.asarray(geometry.faces, np.int32)
        material = getattr(geometry.visual, "material", None)
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        self.linear = getattr(geometry.visual, "vertex_attributes", {}).get("color")
        uv = getattr(geometry.visual, "uv", None)
        self.uv = np.zeros((len(self.vertices), 2)) if uv is None else np.asarray(uv, np.float64)
        self.page: NDArray[np.uint8] | None = None
        self.bump: NDArray[np.uint8] | None = None
        if image is not None and uv is not None:
            self.page = np.asarray(image.convert("RGB"))
            self.uv -= np.floor(self.uv.min(axis=0, initial=1.0) + ON_THE_EDGE)
            bump = getattr(material, "normalTexture", None)
            self.bump = None if bump is None else np.asarray(bump.convert("RGB"))
        turn = np.linalg.inv(transform[:3, :3]).T
        self.normals = np.asarray(geometry.vertex_normals, np.float64) @ turn.T


def _textured(parts: list[_Part]) -> TexturedMesh:
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([p.faces + s for p, s in zip(parts, starts, strict=False)])
    pages = [part.page for part in parts if part.page is not None]
    page = np.cumsum([part.page is not None for part in parts]) - 1
    numbers = [
        np.full(len(p.faces), n if p.page is not None else -1)
        for p, n in zip(parts, page, strict=True)
    ]
    vertices, uv = (np.concatenate([getattr(p, k) for p in parts]) for k in ("vertices", "uv"))
    normals = np.concatenate([part.normals for part in parts])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    faces = faces.astype(np.int32)
    bumps = [part.bump for part in parts if part.page is not None and part.bump is not None]
    normal_map = None
    if bumps and len(bumps) == len(pages):
        tangents = tangent_frames(Mesh(vertices, faces), uv * (1, -1), faces)
        normal_map = NormalMap(tuple(bumps), tangents)
    return TexturedMesh(
        vertices, faces, uv, faces, np.concatenate(numbers).astype(np.int32), tuple(pages),
        normals, None, normal_map,
    )  # fmt: skip
