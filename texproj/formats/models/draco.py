"""Geometry of a glb compressed by Draco (KHR_draco_mesh_compression), by Google's own library."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.errors import OutputError
from texproj.formats.models.binary import Box, Document
from texproj.mesh import TexturedMesh

DRACO = "KHR_draco_mesh_compression"

STEPS_PER_EDGE = 100
"""A position is off by at most half a hundredth of a mean edge: less than the scan knows."""
STEPS_PER_TEXEL = 16
"""A texture coordinate is off by at most 1/32 texel, which no filter shows."""
POSITION_BITS, UV_BITS = (11, 24), (8, 24)
"""Fewest and most. Beyond 24, float32 has no finer steps."""
NORMAL_BITS = 10
"""Of each of the two octahedral coordinates: .1 degrees."""
EFFORT = 7
"""Of 10: what Draco's own encoder takes; more makes viewers slower and files 1 % smaller."""

POSITION, NORMAL, TEX_COORD, GENERIC = 0, 1, 3, 4
"""Draco's kinds of attributes."""
KINDS = {"POSITION": POSITION, "NORMAL": NORMAL, "TEXCOORD_0": TEX_COORD, "TANGENT": GENERIC}


@dataclass(frozen=True)
class Fineness:
    """Bits of each coordinate; uv_bits: None keeps texture coordinates to the last bit."""

    position_bits: int
    uv_bits: int | None


def fineness_of(model: TexturedMesh) -> Fineness:
    """As fine as the faces and the texels are; kept texture coordinates are not rounded."""
    side = float(np.ptp(model.vertices, axis=0).max(initial=0.0))
    a, b, c = (model.vertices[model.faces[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).mean() / 2
    edge = np.sqrt(4 / np.sqrt(3) * area)  # of an equilateral face
    largest = max((max(page.shape[:2]) for page in model.pages), default=1)
    return Fineness(
        _bits(STEPS_PER_EDGE * side / edge if edge > 0 else np.inf, POSITION_BITS),
        None if model.parts is not None else _bits(STEPS_PER_TEXEL * largest, UV_BITS),
    )


def _bits(steps: float, bounds: tuple[int, int]) -> int:
    return int(np.clip(np.ceil(np.log2(max(steps, 1.0))), *bounds))


class DracoDocument(Document):
    """A glb whose primitives are compressed: each vertex once, in an order of Draco's own."""

    extension = DRACO

    def __init__(self, fineness: Fineness) -> None:
        super().__init__()
        self._fineness = fineness

    def primitive(
        self, attributes: Mapping[str, NDArray[Any]], corners: NDArray[Any], box: Box
    ) -> dict[str, Any]:
        """See `Document.primitive`. Positions lie on a grid of `box`, so that parts that touch
        still do. Raises OutputError where Draco cannot hold them.
        """
        data, decoded, faces = _compressed(attributes, corners, box, self._fineness)
        numbers, accessors = {}, {}
        for name, (number, values) in decoded.items():
            numbers[name] = number
            accessors[name] = self.promised(values, name == "POSITION")
        told = {"bufferView": self.view(np.frombuffer(data, np.uint8)), "attributes": numbers}
        return {
            "attributes": accessors,
            "indices": self.promised(np.empty((3 * faces, 1), "<u4")),
            "extensions": {DRACO: told},
        }


def _compressed(
    attributes: Mapping[str, NDArray[Any]], corners: NDArray[Any], box: Box, fineness: Fineness
) -> tuple[bytes, dict[str, tuple[int, NDArray[Any]]], int]:
    """The Draco file; by attribute its number there and (n, k) values as viewers will find them;
    how many faces.
    """
    import DracoPy  # noqa: PLC0415 - only where it is asked for

    low, side = box
    tangents = attributes.get("TANGENT")
    try:
        data = DracoPy.encode(
            np.asarray(attributes["POSITION"], np.float32), np.uint32(corners.reshape(-1, 3)),
            quantization_bits=fineness.position_bits, compression_level=EFFORT,
            quantization_range=side, quantization_origin=low,
            tex_coord=_doubles(attributes, "TEXCOORD_0"), normals=_doubles(attributes, "NORMAL"),
            tex_coord_quantization_bits=fineness.uv_bits, normal_quantization_bits=NORMAL_BITS,
            generic_attributes=None if tangents is None else {0: tangents.astype(np.float32)},
        )  # fmt: skip
        mesh = DracoPy.decode(data)
    except (DracoPy.EncodingFailedException, DracoPy.FileTypeException, ValueError) as error:
        raise OutputError(
            f'Draco cannot compress the model ({error}); set compression = "none" in [output]'
        ) from None
    found = {int(a["attribute_type"]): a for a in mesh.attributes}
    decoded = {
        name: (int(found[kind]["unique_id"]), np.asarray(found[kind]["data"]))
        for name, kind in KINDS.items()
        if name in attributes
    }
    return data, decoded, len(mesh.faces)


def _doubles(attributes: Mapping[str, NDArray[Any]], name: str) -> Doubles | None:
    """As the library takes them."""
    return np.asarray(attributes[name], np.float64) if name in attributes else None
