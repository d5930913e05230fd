"""The atlas: where every face of a mesh lies in the texture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class AtlasStats:
    """How good an atlas is, for the report.

    charts: number of charts. stretch_median, stretch_p95: area-weighted quantiles over the
    faces of the ratio of the two singular values of the map from surface to texture (1 = no
    distortion). packed_fraction: area of the faces in the texture / area of the pages.
    scale: texels per unit given / asked for; below 1 where the pages were too small.
    overlap_splits: charts that were cut because they would have covered themselves.
    """

    charts: int
    stretch_median: float
    stretch_p95: float
    packed_fraction: float
    scale: float
    overlap_splits: int = 0


@dataclass(frozen=True, eq=False)
class Atlas:
    """A place on one of the pages of a texture for every face of a mesh.

    uv_px: (W, 2) float64 continuous texel coordinates on the page of the face: x right, y down,
    origin at the top-left corner of the page, texel centers at .5.
    faces: (F, 3) int32 rows of uv_px, in the order of the mesh's faces and of their corners.
    vertex_of_uv: (W,) int32 rows of mesh.vertices. page_of_face, chart_of_face: (F,) int32.
    page_sizes: (width, height) of each page, texels.
    padding_px: texels between any two charts, and half of it to the border of the page.
    Charts may be mirrored: the winding of a face in the texture says nothing.
    """

    uv_px: NDArray[np.float64]
    faces: NDArray[np.int32]
    vertex_of_uv: NDArray[np.int32]
    page_of_face: NDArray[np.int32]
    chart_of_face: NDArray[np.int32]
    page_sizes: tuple[tuple[int, int], ...]
    padding_px: int
    stats: AtlasStats
