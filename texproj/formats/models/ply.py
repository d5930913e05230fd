"""Binary PLY with a color per vertex."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.models.precision import single_is_enough

ROWS = 1 << 16
"""Rows that are put together at once: no second copy of a large mesh."""

PLY_TYPES = {"u1": "uchar", "u2": "ushort", "f4": "float", "f8": "double"}


def write_ply(
    path: Path,
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    colors: NDArray[np.uint8] | NDArray[np.uint16] | None,
    normals: NDArray[np.float64] | None = None,
    comments: Sequence[str] = (),
) -> None:
    """Write a mesh, with sRGB-encoded vertex colors if there are any, in the order given.

    vertices: (V, 3), written as double where single precision would move them; faces: (F, 3);
    colors: (V, 3 or 4), uint8 for viewers (few read uint16), or None; normals: (V, 3) or None;
    comments: lines of the head, where the format has no letters but those of ASCII.
    Raises OSError.
    """
    real = "f4" if single_is_enough(vertices) else "f8"
    columns: dict[str, tuple[NDArray[Any], str]] = {"xyz": (vertices, real)}
    if normals is not None:
        columns["normal"] = (normals, "f4")
    if colors is not None:
        columns["color"] = (colors, f"u{colors.itemsize}")
    names = {
        "xyz": ("x", "y", "z"),
        "normal": ("nx", "ny", "nz"),
        "color": ("red", "green", "blue", "alpha"),
    }
    properties = [
        f"property {PLY_TYPES[kind]} {name}"
        for key, (values, kind) in columns.items()
        for name in names[key][: values.shape[1]]
    ]
    header = [
        "ply", "format binary_little_endian 1.0",
        *(_comment(line) for line in comments),
        f"element vertex {len(vertices)}", *properties,
        f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n",
    ]  # fmt: skip
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii", "replace"))
        file.writelines(_rows([(values, f"<{kind}") for values, kind in columns.values()]))
        corners = np.broadcast_to(np.uint8(3), (len(faces), 1))
        file.writelines(_rows([(corners, "u1"), (faces, "<i4")]))


def _comment(line: str) -> str:
    """A line of the head; no word in it may look like the head's end, where readers stop."""
    plain = line.replace("\u00a9", "(c)").replace("end_header", "end header")
    return f"comment {' '.join(plain.split())}"


def _rows(blocks: list[tuple[NDArray[Any], str]]) -> Iterator[bytes]:
    """Blocks of columns beside each other, row by row, a part of the rows at a time."""
    dtype = [(str(i), kind, values.shape[1]) for i, (values, kind) in enumerate(blocks)]
    for start in range(0, len(blocks[0][0]), ROWS):
        part = slice(start, start + ROWS)
        rows = np.empty((len(blocks[0][0][part]), 1), dtype)
        for i, (values, _) in enumerate(blocks):
            rows[str(i)] = values[part, None]
        yield rows.tobytes()
