"""The colored model as the report's page holds it: turned by hand, without any other file.

What is packed here, `preview/web/src/reportmodel.ts` unpacks.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from texproj.formats.jpeg import jpeg_bytes
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh, face_areas
from texproj.photo import srgb_from_linear

MOST_FACES = 300_000
"""More are drawn slowly and make the page large: 300 k take 3 MB."""

PAGE_PX = 2048
"""Longer side of all pages of the texture together, about: half a megabyte of JPEG."""

PAGE_QUALITY = 82
STEPS = 65535
"""Positions count in such parts of the model's size, places on a page of the page."""


@dataclass(frozen=True, eq=False)
class _Corners:
    """Vertices as a graphics card wants them. vertex: (n,) rows of the model's vertices; uv: (n, 2)
    from the top left corner, or None; faces: (F, 3).
    """

    vertex: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    faces: NDArray[np.int64]


def packed_model(
    model: TexturedMesh | ColoredMesh, up: NDArray[np.float64], front: NDArray[np.float64]
) -> dict[str, Any]:
    """The model for JSON. up, front: (3,) unit vectors at right angles: upward, to the viewer."""
    model = _light_enough(model)
    pages: list[dict[str, Any]]
    if isinstance(model, TexturedMesh):
        order = np.argsort(model.page_of_face, kind="stable")
        corners, pages = _textured(model, order), _pages(model, order)
    else:
        every = np.arange(len(model.vertices))
        corners = _Corners(every, None, model.faces.astype(np.int64))
        pages = [{"image": None, "first": 0, "count": len(model.faces)}]
    xyz = model.vertices[corners.vertex]
    used = xyz[np.unique(corners.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    size = np.maximum(high - low, 1e-6 * float(np.max(high - low)) + 1e-30)
    steps = np.diff(corners.faces.ravel(), prepend=0)
    return {
        "up": up.tolist(),
        "front": front.tolist(),
        "low": low.tolist(),
        "size": size.tolist(),
        "positions": _text(np.round(((xyz - low) / size).clip(0, 1) * STEPS), "<u2"),
        "uv": None if corners.uv is None else _text(corners.uv.clip(0, 1) * STEPS, "<u2"),
        "colors": _text(_srgb8(model.colors), "u1") if isinstance(model, ColoredMesh) else None,
        "faces": _text(steps, "<i4"),
        "pages": pages,
    }


def _textured(model: TexturedMesh, order: NDArray[np.intp]) -> _Corners:
    """One vertex for each pair of a vertex and a place on a page."""
    vertex, texel = (faces[order].ravel() for faces in (model.faces, model.uv_faces))
    texel = np.maximum(texel, 0)
    pairs, first, faces = np.unique(
        vertex * np.int64(len(model.uv)) + texel, return_index=True, return_inverse=True
    )
    del pairs
    uv = model.uv[texel[first]] * (1, -1) + (0, 1)
    return _Corners(vertex[first].astype(np.int64), uv, faces.reshape(-1, 3))


def _pages(model: TexturedMesh, order: NDArray[np.intp]) -> list[dict[str, Any]]:
    """The images, and which of the faces in their order are on each; None: on none."""
    numbers, first, count = np.unique(
        model.page_of_face[order], return_index=True, return_counts=True
    )
    longest = PAGE_PX / np.sqrt(max(len(model.pages), 1))
    return [
        {
            "image": _image(model.pages[number], longest) if number >= 0 else None,
            "first": int(start),
            "count": int(faces),
        }
        for number, start, faces in zip(numbers, first, count, strict=True)
    ]


def _image(page: NDArray[Any], longest: float) -> str:
    """A page as a URL of data."""
    small = _srgb8(page[..., :3])
    scale = min(1.0, longest / max(small.shape[:2]))
    if scale < 1:
        size = tuple(max(1, round(side * scale)) for side in small.shape[1::-1])
        small = cv2.resize(small, size, interpolation=cv2.INTER_AREA)
    data = base64.b64encode(jpeg_bytes(np.ascontiguousarray(small), PAGE_QUALITY))
    return f"data:image/jpeg;base64,{data.decode()}"


def _srgb8(colors: NDArray[Any]) -> NDArray[np.uint8]:
    """Colors of any kind as 8-bit sRGB."""
    if colors.dtype.kind == "f":
        return np.round(srgb_from_linear(colors[..., :3]) * 255).astype(np.uint8)
    top = int(np.iinfo(colors.dtype).max)
    return (colors[..., :3] // ((top + 1) // 256)).astype(np.uint8)


def _text(values: NDArray[Any], kind: str) -> str:
    """Numbers, deflated, as text."""
    return base64.b64encode(zlib.compress(values.astype(kind).tobytes(), 9)).decode()


def _light_enough(model: TexturedMesh | ColoredMesh) -> TexturedMesh | ColoredMesh:
    """About `MOST_FACES` of a model of more: the vertices of each cube of a grid in their mean,
    with their mean color (Rossignac and Borrel 1993).
    """
    if len(model.faces) <= MOST_FACES:
        return model
    area = float(face_areas(Mesh(model.vertices, model.faces)).sum())
    cell = np.sqrt(2 * area / MOST_FACES)
    where = np.floor((model.vertices - model.vertices.min(axis=0)) / cell).astype(np.int64)
    size = where.max(axis=0) + 1
    key = (where[:, 0] * size[1] + where[:, 1]) * size[2] + where[:, 2]
    number = np.unique(key, return_inverse=True)[1]
    count = np.bincount(number)

    def means(columns: NDArray[Any]) -> NDArray[np.float64]:
        return np.stack([np.bincount(number, column) / count for column in columns.T], axis=1)

    faces = number[model.faces].astype(np.int32)
    a, b, c = faces.T
    colors = np.round(means(_vertex_colors(model))).astype(np.uint8)
    return ColoredMesh(means(model.vertices), faces[(a != b) & (b != c) & (c != a)], colors)


def _vertex_colors(model: TexturedMesh | ColoredMesh) -> NDArray[np.uint8]:
    """(V, 3) the color at each vertex: of a texture, the texel there."""
    if isinstance(model, ColoredMesh):
        return _srgb8(model.colors)
    out = np.full((len(model.vertices), 3), 123, np.uint8)
    for number, page in enumerate(model.pages):
        mine = model.page_of_face == number
        height, width = page.shape[:2]
        x, y = ((model.uv[model.uv_faces[mine].ravel()] * (1, -1) + (0, 1)) * (width, height)).T
        rows, columns = y.astype(int).clip(0, height - 1), x.astype(int).clip(0, width - 1)
        out[model.faces[mine].ravel()] = _srgb8(page[rows, columns])
    return out
