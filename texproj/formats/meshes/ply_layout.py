"""Texture coordinates of a PLY: at each corner of the faces (texcoord, as MeshLab writes it), or at
each vertex (texture_u, s, u); the images stand in comments (TextureFile).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.foreign import Broken
from texproj.formats.meshes.mtl import beside
from texproj.formats.meshes.ply import CORNERS, TEXCOORD, Element, Header, binary_rows, text_rows
from texproj.formats.meshes.polygons import Faces, Ints, fans
from texproj.layout import NO_PLACE, Layout, Material, Node

AT_VERTICES = (("texture_u", "texture_v"), ("s", "t"), ("u", "v"))
IMAGE_NUMBER = "texnumber"
UNNAMED = "texture"
LONGEST_NAME = 200


def ply_images(header: Header) -> list[str]:
    """What the comments name as images, in their order."""
    found = [line.partition("TextureFile") for line in header.comments]
    return [name.strip() for _, word, name in found if word and name.strip()]


def ply_layout(path: Path, data: bytes, header: Header, faces: Faces) -> Layout | None:
    """Where the triangles `faces` (F, 3) of the file lie in textures; None where it does not say.

    Raises Broken where what it says does not belong to them: polygons in a binary file, or counts
    that contradict each other.
    """
    wedges = TEXCOORD in [name for name, _ in header.element("face").properties]
    vertex = [name for name, _ in header.element("vertex").properties]
    pair = next((pair for pair in AT_VERTICES if set(pair) <= set(vertex)), None)
    if wedges:
        read = _of_text if header.kind == "ascii" else _of_binary
        uv, corners, image = read(path, data, header, faces)
    elif pair is not None:
        rows = _vertices(path, data, header, pair)
        inside = (faces >= 0) & (faces < len(rows))
        uv, corners = rows, np.where(inside, faces, NO_PLACE)
        image = np.zeros(len(faces), np.int64)
    else:
        return None
    if len(corners) != len(faces):
        raise Broken("they do not belong to its faces")
    if not np.isfinite(uv).all():
        raise Broken("texture coordinates that are no numbers")
    if not (corners >= 0).all(axis=1).any():
        return None
    uv, places = np.unique(uv, axis=0, return_inverse=True)
    placed = np.where(corners >= 0, places.ravel()[np.maximum(corners, 0)], NO_PLACE)
    materials = _materials(path, header)
    known = (image >= 0) & (image < len(materials))
    return Layout(
        uv, placed.astype(np.int32), np.where(known, image, NO_PLACE).astype(np.int32),
        np.zeros(len(faces), np.int32), materials, (Node(path.stem),),
    )  # fmt: skip


def _materials(path: Path, header: Header) -> tuple[Material, ...]:
    out = []
    for name in ply_images(header):
        file = beside(path, name)
        why = "" if file is not None else f"there is no {name}"
        out.append(Material(Path(name).stem[:LONGEST_NAME] or UNNAMED, file, why=why))
    return tuple(out) or (Material(UNNAMED),)


def _of_binary(
    path: Path, data: bytes, header: Header, faces: Faces
) -> tuple[NDArray[np.float64], Ints, Ints]:
    """(3F, 2) coordinates, the rows of each triangle's corners, and the number of its image."""
    del data
    rows = binary_rows(path)["face"].data
    name = next(name for name in CORNERS if name in rows.dtype.names)
    if len(rows) != len(faces) or not np.array_equal(rows[name].reshape(-1, 3), faces):
        raise Broken("its faces are no triangles; export it as triangles, or as obj")
    uv = np.asarray(rows[TEXCOORD], np.float64).reshape(-1, 2)
    image = np.zeros(len(faces), np.int64)
    if IMAGE_NUMBER in rows.dtype.names:
        image = np.asarray(rows[IMAGE_NUMBER], np.int64)
    return uv, np.arange(len(uv)).reshape(-1, 3), image


def _of_text(
    path: Path, data: bytes, header: Header, faces: Faces
) -> tuple[NDArray[np.float64], Ints, Ints]:
    """The same of polygons, whose triangles are fans around their first corner."""
    del path, faces
    element, lines = header.element("face"), text_rows(data, header)["face"]
    values: list[float] = []
    counts = np.zeros(len(lines), np.int64)
    told = np.zeros(len(lines), bool)
    image = np.zeros(len(lines), np.int64)
    for i, line in enumerate(lines):
        row = _row(line.split(), element)
        corners = next(len(row[name]) for name in CORNERS if name in row)
        uv = row.get(TEXCOORD, [])
        counts[i], told[i] = corners, len(uv) == 2 * corners
        values += uv if told[i] else [0.0] * 2 * corners
        image[i] = int(row.get(IMAGE_NUMBER, [0])[0])
    triangles = np.maximum(counts - 2, 0)
    places = fans(np.arange(counts.sum()), counts).astype(np.int64)
    places[~np.repeat(told, triangles)] = NO_PLACE
    return np.array(values, np.float64).reshape(-1, 2), places, np.repeat(image, triangles)


def _row(words: list[bytes], element: Element) -> dict[str, list[float]]:
    """The properties of a line by name. Raises Broken."""
    row, at = {}, 0
    try:
        for name, is_list in element.properties:
            count = int(words[at]) if is_list else 1
            at += is_list
            row[name] = [float(word) for word in words[at : at + count]]
            if len(row[name]) != count:
                raise Broken("a face is cut off")
            at += count
    except (ValueError, IndexError):
        raise Broken("a word where a number should be") from None
    return row


def _vertices(
    path: Path, data: bytes, header: Header, pair: tuple[str, str]
) -> NDArray[np.float64]:
    """(V, 2) coordinates at the vertices."""
    if header.kind != "ascii":
        rows: Any = binary_rows(path)["vertex"].data
        return np.stack([np.asarray(rows[name], np.float64) for name in pair], axis=1)
    names = [name for name, _ in header.element("vertex").properties]
    columns = [names.index(name) for name in pair]
    lines = [line.split() for line in text_rows(data, header)["vertex"]]
    try:
        return np.array([[words[c] for c in columns] for words in lines], np.float64)
    except (ValueError, IndexError):
        raise Broken("a word where a texture coordinate should be") from None
