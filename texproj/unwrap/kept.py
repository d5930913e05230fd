"""The layout that a mesh brings as the atlas: its texture coordinates, its materials and tiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from texproj.arrays import Doubles, Ints
from texproj.errors import InputError
from texproj.layout import NO_PLACE, Layout
from texproj.mesh import Mesh, face_areas
from texproj.options import UnwrapOptions
from texproj.unwrap.atlas import Atlas, AtlasStats
from texproj.unwrap.stretch import flat_areas, signed_areas, stretch, weighted_quantiles
from texproj.unwrap.texel_faces import texels_covered

SHARED, HOMELESS = 0.002, 0.01
"""Part of the texture that several faces share, and part of the surface that has no place in it,
up to which "auto" keeps a layout: exporters leave a few slivers."""

ALL = 1 - 1e-9
"""Of the surface, up to rounding."""

SMALLEST_PAGE = 16
"""Texels along a side."""

LOOKED_AT = 2048
"""Texels along a page at which faces that share a place are looked for."""

ON_THE_EDGE = 1e-6
"""Of a tile: corners this far beyond its border lie on it."""

FIRST_TILE = 1001
"""Number of the tile at the origin in UDIM; ten make a row."""
TILES_IN_ROW = 10

NOTHING_BROUGHT = "the mesh brings no texture coordinates"


@dataclass(frozen=True, eq=False)
class Pages:
    """The pages that a layout has: one for each material and tile of it.

    page_of_face: (F,) int32, -1 = no place; names, materials: of each page; corner: (n, 2) of each
    page's tile, v up.
    """

    page_of_face: NDArray[np.int32]
    names: tuple[str, ...]
    materials: tuple[int, ...]
    corner: Doubles


@dataclass(frozen=True)
class Fitness:
    """How a layout can serve as a texture's. shared: part of the covered texture that several faces
    claim; homeless: part of the surface without a place in one tile; mirrored: part of the surface
    that lies turned over.
    """

    shared: float
    homeless: float
    mirrored: float

    @property
    def fault(self) -> str:
        """Why "auto" does not keep it; empty if it does."""
        if self.homeless > HOMELESS:
            return f"{_percent(self.homeless)} of its surface has no place in a tile of its own"
        if self.shared > SHARED:
            how = ", some of them mirrored" if self.mirrored > SHARED else ""
            return f"{_percent(self.shared)} of its texture is shared by several faces{how}"
        return ""

    @property
    def told(self) -> str:
        """What a person should know of a layout that is kept; empty if nothing."""
        parts = []
        if self.shared > 0:
            parts.append(
                f"{_percent(self.shared)} of the texture is shared by several faces, which get the"
                " color of one of them"
            )
        if self.homeless > 0:
            parts.append(f"{_percent(self.homeless)} of the surface has no place and stays grey")
        if self.mirrored > 0:
            parts.append(f"{_percent(self.mirrored)} of the surface lies mirrored, without harm")
        return "; ".join(parts)


def kept_pages(mesh: Mesh, options: UnwrapOptions) -> tuple[Pages | None, str]:
    """The pages of the mesh's own layout if the options and its fitness allow it, else None; and a
    sentence for people, empty where there is nothing to say.

    Raises InputError where `keep` is "on" and there is nothing to keep.
    """
    if mesh.layout is None:
        if options.keep == "on":
            raise InputError(f'keep = "on" in [unwrap]: {NOTHING_BROUGHT}; set it to "auto"')
        return None, ""
    if options.keep == "off":
        return None, "the mesh's own texture coordinates are not used, as [unwrap] says"
    pages = pages_of(mesh.layout)
    fitness = fitness_of(mesh, mesh.layout, pages)
    if options.keep == "on" and fitness.homeless >= ALL:
        raise InputError(
            'keep = "on" in [unwrap]: no face of the mesh has a place in its texture coordinates,'
            ' they are points or lines or reach over tiles; set it to "auto"'
        )
    if not pages.names:
        return None, "no face of the mesh has a place in a tile; the texture has its own layout"
    if options.keep == "auto" and fitness.fault:
        return None, (
            f"the mesh's own texture coordinates are not kept: {fitness.fault}; the texture has a"
            ' layout of its own (keep = "on" in [unwrap] keeps them all the same)'
        )
    told = fitness.told
    return pages, f"the mesh's own texture coordinates are kept{': ' if told else ''}{told}"


def pages_of(layout: Layout) -> Pages:
    """The pages of a layout. A face that reaches over several tiles has no place."""
    placed = layout.placed
    corners = layout.uv_up[np.where(layout.faces >= 0, layout.faces, 0)]
    tile = np.floor(corners.min(axis=1) + ON_THE_EDGE)
    placed &= (corners.max(axis=1) <= tile + 1 + ON_THE_EDGE).all(axis=1)
    tile = np.where(np.abs(tile) < 1e6, tile, 0).astype(np.int64)  # a sliver far away is its own
    keys = np.column_stack([layout.material_of_face, tile[:, ::-1]])[placed]
    unique, number = np.unique(keys, axis=0, return_inverse=True)
    page_of_face = np.full(len(layout.faces), NO_PLACE, np.int32)
    page_of_face[placed] = number.ravel()
    return Pages(
        page_of_face, _names(layout, unique), tuple(unique[:, 0].tolist()),
        unique[:, :0:-1].astype(np.float64),
    )  # fmt: skip


def _names(layout: Layout, keys: Ints) -> tuple[str, ...]:
    """A name for each page (material, row, column): the material's, with the number of the tile
    where it has several or where that is not the first.
    """
    names: list[str] = []
    for material, row, column in keys.tolist():
        name = layout.materials[material].name if material >= 0 else "material"
        several = np.count_nonzero(keys[:, 0] == material) > 1
        if several or row or column:
            name += f"_{FIRST_TILE + column + TILES_IN_ROW * row}"
        while name in names:
            name += "_"
        names.append(name)
    return tuple(names)


def fitness_of(mesh: Mesh, layout: Layout, pages: Pages) -> Fitness:
    """How many faces share their place, have none, or lie mirrored."""
    area = face_areas(mesh)
    total = max(float(area.sum()), 1e-300)
    faces = np.where(layout.faces >= 0, layout.faces, 0)
    signed = np.where(pages.page_of_face >= 0, signed_areas(layout.uv_up, faces), 0)
    homeless = float(area[(pages.page_of_face < 0) | (signed == 0)].sum()) / total
    covered = claimed = 0
    for page in range(len(pages.names)):
        rows = np.flatnonzero(pages.page_of_face == page)
        corners = (layout.uv_up[faces[rows]] - pages.corner[page]) * LOOKED_AT
        texels, claims = texels_covered(corners, LOOKED_AT)
        covered, claimed = covered + texels, claimed + claims
    shared = (claimed - covered) / max(covered, 1)
    return Fitness(shared, homeless, float(area[signed < 0].sum()) / total)


def kept_atlas(
    mesh: Mesh, pages: Pages, texels_per_unit: ArrayLike, options: UnwrapOptions
) -> Atlas:
    """The atlas of the mesh's own layout, on pages as large as the photos are sharp.

    pages: those of the layout; texels_per_unit: wanted, one number or one for each face (F,).
    """
    layout = mesh.layout
    if layout is None:
        raise ValueError(NOTHING_BROUGHT)
    density = np.broadcast_to(np.asarray(texels_per_unit, np.float64), len(mesh.faces))
    sizes, scale = _sizes(mesh, layout, pages, density, options)
    corners = layout.uv_up[np.where(layout.faces >= 0, layout.faces, 0)]
    page = np.maximum(pages.page_of_face, 0)
    in_page = corners - pages.corner[page][:, None]
    uv_px = np.stack([in_page[..., 0], 1 - in_page[..., 1]], axis=-1).clip(0, 1)
    uv_px *= np.array(sizes, np.float64)[page][:, None]
    uv_px[pages.page_of_face < 0] = 0
    faces = np.arange(3 * len(mesh.faces), dtype=np.int32).reshape(-1, 3)
    charts = _charts(layout, pages)
    flat = uv_px.reshape(-1, 2)
    home = pages.page_of_face >= 0
    area = np.where(home, face_areas(mesh), 0)
    ratio = np.where(home, stretch(mesh.vertices[mesh.faces], uv_px), 1.0)
    median, p95 = weighted_quantiles(ratio, area, (0.5, 0.95))
    texels = float(flat_areas(flat, faces)[home].sum())
    return Atlas(
        uv_px=flat, faces=faces, vertex_of_uv=mesh.faces.ravel(),
        page_of_face=pages.page_of_face, chart_of_face=charts, page_sizes=sizes,
        padding_px=0,
        stats=AtlasStats(
            int(charts.max()) + 1, median, p95, texels / sum(w * h for w, h in sizes), scale
        ),
    )  # fmt: skip


def _charts(layout: Layout, pages: Pages) -> NDArray[np.int32]:
    """(F,) parts of the layout whose faces hang together by shared rows of uv."""
    faces = np.where(layout.faces >= 0, layout.faces, 0)
    count = len(layout.uv)
    pairs = faces[pages.page_of_face >= 0][:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), (count, count))
    labels = connected_components(graph, directed=False)[1][faces[:, 0]]
    return np.unique(labels, return_inverse=True)[1].astype(np.int32)


def _sizes(
    mesh: Mesh, layout: Layout, pages: Pages, density: Doubles, options: UnwrapOptions
) -> tuple[tuple[tuple[int, int], ...], float]:
    """Width and height of each page: squares of a power of two, as graphics cards like them, the
    nearest to what the photos show, and texels per unit given / asked for over all pages.
    """
    page = pages.page_of_face
    home = page >= 0
    uv_area = np.abs(signed_areas(layout.uv_up, np.where(layout.faces >= 0, layout.faces, 0)))
    count = len(pages.names)
    wanted = np.bincount(page[home], (face_areas(mesh) * density**2)[home], count)
    covered = np.bincount(page[home], uv_area[home], count)
    side = np.sqrt(wanted / np.maximum(covered, 1e-12))
    largest = 2 ** int(np.log2(options.page_size))
    least = [layout.materials[m].least_px if m >= 0 else 0 for m in pages.materials]
    wished = np.maximum(2 ** np.round(np.log2(np.maximum(side, SMALLEST_PAGE))), least)
    sizes = np.minimum(2 ** np.ceil(np.log2(wished)), largest)
    room = options.max_pages * options.page_size**2
    while (sizes**2).sum() > room and sizes.max() > SMALLEST_PAGE:
        sizes = np.where(sizes == sizes.max(), sizes / 2, sizes)
    scale = float(np.sqrt((covered * sizes**2).sum() / max(float(wanted.sum()), 1e-300)))
    return tuple((int(s), int(s)) for s in sizes), min(scale, 1.0)


def _percent(part: float) -> str:
    return f"{100 * part:.1f} %" if part >= 0.0005 else "less than .1 %"
