"""USDZ: a textured mesh as text (USDA) with its images, in a zip without compression.

Each file begins at a multiple of 64 bytes, the layer first (openusd.org/release/spec_usdz.html).
Surfaces are UsdPreviewSurface; what is unlit emits its texture and reflects nothing.
"""

from __future__ import annotations

import errno
import json
import math
import struct
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.precision import single_is_enough
from texproj.formats.models.text import Text, decimals, integers, lines
from texproj.mesh import TexturedMesh
from texproj.provenance import GENERATOR, NOTHING, Provenance
from texproj.standing import Standing

ALIGNMENT = 64
LOCAL_HEADER = 30
"""Bytes of a zip's head of a file, before name and extra fields."""
PADDING_ID = 0x1986
"""Kind of the extra field that fills the space before a file; Pixar's own tools use it."""
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of each file: the same inputs make the same bytes."""
MOST_BYTES = (1 << 32) - 1
RELATIVE_DIGITS, UV_DIGITS, NORMAL_DIGITS = 9, 7, 6
BLOCK = 1 << 14
"""Lines that are made at once: they fit the processor's cache."""
GREY = "0.2, 0.2, 0.2"
"""Surface that no photo sees."""


def write_usdz(
    path: Path,
    model: TexturedMesh,
    images: Sequence[Path],
    unlit: bool = True,
    standing: Standing | None = None,
    provenance: Provenance = NOTHING,
) -> None:
    """Write a mesh and a material per page of the texture.

    images: the files of the pages, png or jpeg; positions stay those of the mesh file, moved and
    turned by the node above them. Raises OSError, also for more than the 4 GB that a zip holds.
    """
    layer = b"".join(_layer(model, images, unlit, standing, provenance))
    parts = [(f"{path.stem}.usda", layer)]
    parts += [(f"textures/{image.name}", image.read_bytes()) for image in images]
    if sum(len(data) + 4 * ALIGNMENT for _, data in parts) > MOST_BYTES:
        raise OSError(errno.EFBIG, "a usdz holds at most 4 GB; write an obj or fewer pages")
    with path.open("wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as package:
        for name, data in parts:
            entry = zipfile.ZipInfo(name, EPOCH)
            start = file.tell() + LOCAL_HEADER + len(name.encode()) + 4
            padding = -start % ALIGNMENT
            entry.extra = struct.pack("<HH", PADDING_ID, padding) + b"\0" * padding
            package.writestr(entry, data)


def _layer(
    model: TexturedMesh, images: Sequence[Path], unlit: bool,
    standing: Standing | None, provenance: Provenance,
) -> Iterator[bytes]:  # fmt: skip
    told = {"generator": GENERATOR, "copyright": provenance.copyright,
            "texproj": json.dumps(dict(provenance.facts))}  # fmt: skip
    kept = "".join(f"        string {k} = {_quoted(v)}\n" for k, v in told.items() if v != "{}")
    yield (
        f'#usda 1.0\n(\n    customLayerData = {{\n{kept}    }}\n    defaultPrim = "Model"\n'
        '    metersPerUnit = 1\n    upAxis = "Y"\n)\n\n'
        f'def Xform "Model"\n{{\n{_upright(standing)}'
    ).encode()
    offset = np.zeros(3)
    if not single_is_enough(model.vertices):
        offset = np.round((model.vertices.min(0) + model.vertices.max(0)) / 2)
    pages = [int(page) for page in np.unique(model.page_of_face)]
    for page in pages:
        yield from _mesh(model, page, offset)
    yield b'    def Scope "Materials"\n    {\n'
    for page in pages:
        yield _material(page, images[page].name if page >= 0 else "", unlit).encode()
    yield b"    }\n}\n"


def _quoted(text: str) -> str:
    """A text as USDA has it, on one line."""
    return json.dumps(text, ensure_ascii=False)


def _upright(standing: Standing | None) -> str:
    if standing is None or standing.as_is:
        return ""
    x, y, z, w = standing.rotation
    m = standing.metres
    return (
        f"    quatd xformOp:orient = ({w!r}, {x!r}, {y!r}, {z!r})\n"
        f"    double3 xformOp:scale = ({m!r}, {m!r}, {m!r})\n"
        '    uniform token[] xformOpOrder = ["xformOp:orient", "xformOp:scale"]\n'
    )


def _name(page: int) -> str:
    return f"page_{page}" if page >= 0 else "untextured"


def _mesh(model: TexturedMesh, page: int, offset: NDArray[np.float64]) -> Iterator[bytes]:
    """The faces of one page with the vertices that they use."""
    rows = model.page_of_face == page
    used, corners = np.unique(model.faces[rows], return_inverse=True)
    points = model.vertices[used] - offset
    low, high = points.min(0), points.max(0)
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    digits = max(1, RELATIVE_DIGITS - math.floor(math.log10(diagonal)))
    extent = ", ".join(f"({', '.join(map(repr, corner.tolist()))})" for corner in (low, high))
    yield (
        f'    def Mesh "{_name(page)}" (prepend apiSchemas = ["MaterialBindingAPI"])\n    {{\n'
        f"        uniform bool doubleSided = 1\n        float3[] extent = [{extent}]\n"
        f"        rel material:binding = </Model/Materials/{_name(page)}>\n"
        '        uniform token subdivisionScheme = "none"\n'
    ).encode()
    if offset.any():
        moved = ", ".join(map(repr, offset.tolist()))
        yield f"        double3 xformOp:translate = ({moved})\n".encode()
        yield b'        uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    yield from _array(b"int[] faceVertexCounts", _whole(np.full(int(rows.sum()), 3)))
    yield from _array(b"int[] faceVertexIndices", _whole(corners.ravel()))
    yield from _array(b"point3f[] points", _tuples(points, digits))
    if model.normals is not None:
        normals = model.normals[used]
        normals = np.where(normals.any(axis=1, keepdims=True), normals, (0.0, 0.0, 1.0))
        tail = b' (\n            interpolation = "vertex"\n        )'
        yield from _array(b"normal3f[] normals", _tuples(normals, NORMAL_DIGITS), tail)
    if page >= 0:
        texels, at = np.unique(model.uv_faces[rows], return_inverse=True)
        tail = b' (\n            interpolation = "faceVarying"\n        )'
        yield from _array(b"texCoord2f[] primvars:st", _tuples(model.uv[texels], UV_DIGITS), tail)
        yield from _array(b"int[] primvars:st:indices", _whole(at.ravel()))
    yield b"    }\n\n"


def _array(head: bytes, values: Iterator[bytes], tail: bytes = b"") -> Iterator[bytes]:
    yield b"        " + head + b" = [\n"
    yield from values
    yield b"        ]" + tail + b"\n"


def _whole(numbers: NDArray[np.integer]) -> Iterator[bytes]:
    for start in range(0, len(numbers), BLOCK):
        yield lines([integers(numbers[start : start + BLOCK]), b",\n"])


def _tuples(values: NDArray[np.float64], digits: int) -> Iterator[bytes]:
    for start in range(0, len(values), BLOCK):
        parts: list[bytes | Text] = [b"("]
        for i, column in enumerate(values[start : start + BLOCK].T):
            parts += [b", " if i else b"", decimals(column, digits)]
        yield lines([*parts, b"),\n"])


def _material(page: int, image: str, unlit: bool) -> str:
    """A surface that shows the page, or grey."""
    name = _name(page)
    at = f"/Model/Materials/{name}"
    shown, other = ("emissiveColor", "diffuseColor") if unlit else ("diffuseColor", "emissiveColor")
    value = f".connect = <{at}/texture.outputs:rgb>" if image else f" = ({GREY})"
    texture = f"""
            def Shader "coordinates"
            {{
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }}

            def Shader "texture"
            {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @textures/{image}@
                token inputs:sourceColorSpace = "sRGB"
                float2 inputs:st.connect = <{at}/coordinates.outputs:result>
                token inputs:wrapS = "clamp"
                token inputs:wrapT = "clamp"
                float3 outputs:rgb
            }}
""" if image else ""  # fmt: skip
    return f"""        def Material "{name}"
        {{
            token outputs:surface.connect = <{at}/surface.outputs:surface>

            def Shader "surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:{shown}{value}
                color3f inputs:{other} = (0, 0, 0)
                float inputs:metallic = 0
                float inputs:roughness = 1
                token outputs:surface
            }}
{texture}        }}

"""
