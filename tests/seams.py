"""How far the seams of a texture show: color steps across the borders of charts against steps of
the same length on the surface inside of charts, and both in the photos.

    python tests/seams.py PROJECT [--distance 1.25]

Two points are taken on either side of an edge, a fixed distance away from it in the planes of its
faces. A border may follow a true edge of colors, so the same pairs of points are also looked up in
the photos that see both of them: what the photos show there is not the texture's fault.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from texproj.camera import Camera
from texproj.formats.models import read_model
from texproj.mesh import Mesh, TexturedMesh
from texproj.options import RenderOptions
from texproj.project import Project
from texproj.render import Renderer, open_renderer

ALONG = (0.2, 0.5, 0.8)
"""Where on an edge the pairs of points are."""

LONGEST = 0.4
"""Of a face's height: no point is farther from its edge."""

INSIDE = 40_000
"""Edges inside of charts that are looked at."""

DEPTH_TOLERANCE = 1e-3
"""Part of the distance by which a visible point may lie off the rendered depth."""

DEPTH_TOLERANCE_PX = 1.5
"""Pixels by which point and depth sample may be apart, times the slope of the surface."""

GLANCING = 0.1
"""Least cosine between the surface's normal and the line of sight."""

OBLIQUE = 3.0
"""Sizes of pixels and texels up to which a photo says something about a pair of points."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Points on both sides of edges, with the (n,) lengths that they stand for.

    xyz, normal: (n, 2, 3) world; texel: (n, 2, 3) column and row on their page (texel centers at
    .5) and the page; border: (n,) bool, the edge is the border of a chart; texel_size: (n,) mesh
    units.
    """

    xyz: np.ndarray
    normal: np.ndarray
    texel: np.ndarray
    length: np.ndarray
    border: np.ndarray
    texel_size: np.ndarray


@dataclass(frozen=True)
class Seams:
    """Mean steps of 8-bit sRGB values.

    borders, inside: in the texture across borders of charts and across other edges; the same with
    `shared` where photos see both points, and with `photo` in these photos; shared: part of the
    borders' length that photos see on both sides.
    """

    borders: float
    inside: float
    shared: float = float("nan")
    shared_borders: float = float("nan")
    shared_inside: float = float("nan")
    photo_borders: float = float("nan")
    photo_inside: float = float("nan")

    @property
    def ratio(self) -> float:
        """Steps at borders against those inside."""
        return self.borders / self.inside

    @property
    def shared_ratio(self) -> float:
        """The same where photos see both sides."""
        return self.shared_borders / self.shared_inside

    @property
    def photo_ratio(self) -> float:
        """The same in the photos: what of it is the surface's own."""
        return self.photo_borders / self.photo_inside

    @property
    def excess(self) -> float:
        """What the texture adds: `shared_ratio` against `photo_ratio`."""
        return self.shared_ratio / self.photo_ratio

    def __str__(self) -> str:
        return (
            f"{self.borders:.2f} / {self.inside:.2f} = {self.ratio:.3f}; seen on both sides "
            f"({100 * self.shared:.0f} %): {self.shared_ratio:.3f}, in the photos "
            f"{self.photo_ratio:.3f}, excess {self.excess:.3f}"
        )


def seams_of(
    model: TexturedMesh,
    photos: Iterable[tuple[Camera, np.ndarray]] = (),
    renderer: Renderer | None = None,
    distance: float = 1.25,
) -> Seams:
    """Measure a texture; distance: of the points from the edges, in texels (of the larger kind
    of the two faces); photos: full-size cameras and (h, w, 3) uint8 sRGB, with a renderer.
    """
    pairs = pairs_of(model, distance)
    step = np.abs(np.diff(_texture_at(model, pairs), axis=1)).mean(axis=(1, 2))
    border, inside = pairs.border, ~pairs.border
    plain = _mean(step, pairs, border), _mean(step, pairs, inside)
    if renderer is None:
        return Seams(*plain)
    shown = photo_steps(model, pairs, photos, renderer)
    seen = np.isfinite(shown)
    shared = pairs.length[border & seen].sum() / max(pairs.length[border].sum(), 1e-30)
    rows = [(v, m & seen) for v in (step, shown) for m in (border, inside)]
    return Seams(*plain, float(shared), *(_mean(v, pairs, m) for v, m in rows))


def _mean(values: np.ndarray, pairs: Pairs, chosen: np.ndarray) -> float:
    total = pairs.length[chosen].sum()
    return float((values * pairs.length)[chosen].sum() / total) if total > 0 else float("nan")


def pairs_of(model: TexturedMesh, distance: float) -> Pairs:
    """The pairs of points at all borders of charts and at some edges inside."""
    corners = model.vertices[model.faces]
    size = np.array([page.shape[1::-1] for page in model.pages], float)[model.page_of_face]
    flat = model.uv[model.uv_faces] * [1, -1] + [0, 1]
    flat = flat * size[:, None]
    one, two, border = _edges(model, flat)
    heights = _heights(corners)
    texel = np.sqrt(_areas(corners) / np.maximum(_areas(flat), 1e-12))
    wide = np.maximum(texel[one // 3], texel[two // 3])
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-30)
    xyz, uv, page, normal = [], [], [], []
    for half in (one, two):
        face, side = half // 3, half % 3
        inwards = np.minimum(distance * wide / heights[face, side], LONGEST)
        at = _barycentric(side, inwards, half is two)
        xyz.append(np.einsum("nsk,nkc->nsc", at, corners[face]).reshape(-1, 3))
        uv.append(np.einsum("nsk,nkc->nsc", at, flat[face]).reshape(-1, 2))
        normal.append(np.repeat(facing[face], len(ALONG), axis=0))
        page.append(np.repeat(model.page_of_face[face], len(ALONG)))
    ends = corners[one // 3, one % 3], corners[one // 3, (one % 3 + 1) % 3]
    length = np.linalg.norm(ends[0] - ends[1], axis=1)
    texels = [np.column_stack([u, p]) for u, p in zip(uv, page, strict=True)]
    n = len(ALONG)
    return Pairs(
        np.stack(xyz, 1), np.stack(normal, 1), np.stack(texels, 1),
        np.repeat(length / n, n), np.repeat(border, n), np.repeat(wide, n),
    )  # fmt: skip


def _edges(model: TexturedMesh, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half-edges (3 face + side) on both sides of edges, and whether charts end there."""
    welded = np.unique(model.vertices, axis=0, return_inverse=True)[1].ravel()[model.faces]
    start, end = welded.ravel().astype(np.int64), np.roll(welded, -1, axis=1).ravel()
    key = np.minimum(start, end) * (int(welded.max()) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    twice = first[np.diff(first, append=len(order)) == 2]
    one, two = order[twice], order[twice + 1]
    turned = start[one] == end[two]
    one, two = one[turned], two[turned]
    page = model.page_of_face
    textured = (page[one // 3] >= 0) & (page[two // 3] >= 0)
    one, two = one[textured], two[textured]
    begin, stop = flat.reshape(-1, 2), np.roll(flat, -1, axis=1).reshape(-1, 2)
    apart = np.maximum(np.abs(begin[one] - stop[two]), np.abs(stop[one] - begin[two])).max(axis=1)
    border = (apart > 0.01) | (page[one // 3] != page[two // 3])
    inner = np.flatnonzero(~border)
    if len(inner) > INSIDE:
        inner = np.random.default_rng(0).choice(inner, INSIDE, replace=False)
    kept = np.sort(np.concatenate([np.flatnonzero(border), inner]))
    return one[kept], two[kept], border[kept]


def _areas(corners: np.ndarray) -> np.ndarray:
    """(F,) areas of triangles (F, 3, 2 or 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    ab = (a * b).sum(axis=1)
    return 0.5 * np.sqrt(np.maximum((a * a).sum(axis=1) * (b * b).sum(axis=1) - ab**2, 0))


def _heights(corners: np.ndarray) -> np.ndarray:
    """(F, 3) height of each face over each of its sides."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return np.maximum(2 * _areas(corners)[:, None] / np.maximum(sides, 1e-30), 1e-30)


def _barycentric(side: np.ndarray, inwards: np.ndarray, turned: bool) -> np.ndarray:
    """(n, s, 3) weights of the corners for points `inwards` (of the height) from their sides."""
    along = np.array(ALONG)
    along = 1 - along if turned else along
    out = np.zeros((len(side), len(along), 3))
    row = np.arange(len(side))[:, None], np.arange(len(along))[None]
    out[(*row, side[:, None])] = (1 - inwards[:, None]) * (1 - along)
    out[(*row, (side[:, None] + 1) % 3)] = (1 - inwards[:, None]) * along
    out[(*row, (side[:, None] + 2) % 3)] = inwards[:, None]
    return out


def _texture_at(model: TexturedMesh, pairs: Pairs) -> np.ndarray:
    """(n, 2, 3) colors, bilinear."""
    flat = pairs.texel.reshape(-1, 3)
    out = np.zeros((len(flat), 3), np.float32)
    for number, page in enumerate(model.pages):
        here = flat[:, 2] == number
        scale = 1 if page.dtype == np.uint8 else 1 / 257
        out[here] = bilinear(page[..., :3], flat[here, :2]) * scale
    return out.reshape(-1, 2, 3)


def bilinear(image: np.ndarray, xy_px: np.ndarray) -> np.ndarray:
    """(n, 3) float32 values at pixels whose centers are at .5."""
    scale = 256 if image.dtype == np.uint8 else 1  # OpenCV rounds to the kind of the image
    image = image.astype(np.uint16) * np.uint16(scale)
    parts = np.array_split((xy_px - 0.5).astype(np.float32), len(xy_px) // 30_000 + 1)
    values = [
        cv2.remap(image, part[:, None, :], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for part in parts
    ]
    return np.concatenate(values).reshape(-1, 3).astype(np.float32) / scale


def photo_steps(
    model: TexturedMesh, pairs: Pairs, photos: Iterable[tuple[Camera, np.ndarray]],
    renderer: Renderer,
) -> np.ndarray:  # fmt: skip
    """(n,) median over the photos that see both points of their step there; NaN = none."""
    found = []
    with renderer.load(Mesh(model.vertices, model.faces)) as scene:
        for camera, pixels in photos:
            depth = scene.gbuffer(camera, ("depth",)).depth
            found.append(_photo_step(pairs, camera, pixels, depth))
    steps = np.stack(found)
    none = np.isnan(steps).all(axis=0)
    steps[:, none] = -1
    return np.where(none, np.nan, np.nanmedian(steps, axis=0))


def _photo_step(pairs: Pairs, camera: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    xy, z = camera.project(pairs.xyz.reshape(-1, 3))
    xy = np.nan_to_num(xy, nan=-1.0)
    column, row = np.floor(xy).astype(int).T
    inside = (column >= 1) & (row >= 1) & (column < camera.width - 1) & (row < camera.height - 1)
    nearest = np.zeros(len(z))
    nearest[inside] = depth[row[inside], column[inside]]
    ray = camera.center - pairs.xyz.reshape(-1, 3)
    cosine = (ray * pairs.normal.reshape(-1, 3)).sum(axis=1) / np.linalg.norm(ray, axis=1)
    slope = np.sqrt(np.maximum(1 - cosine**2, 0)) / np.maximum(cosine, GLANCING)
    tolerance = DEPTH_TOLERANCE + DEPTH_TOLERANCE_PX / camera.intrinsics.fx * slope
    seen = inside & (cosine > GLANCING) & (np.abs(z - nearest) <= tolerance * z)
    seen = seen.reshape(-1, 2).all(axis=1)
    # oblique photos show the pair squeezed together
    apart = np.linalg.norm(np.diff(xy.reshape(-1, 2, 2), axis=1)[:, 0], axis=1)
    texels = np.linalg.norm(np.diff(pairs.xyz, axis=1)[:, 0], axis=1) / pairs.texel_size
    seen &= apart * OBLIQUE >= texels
    step = np.full(len(seen), np.nan)
    both = np.repeat(seen, 2)
    colors = bilinear(pixels, xy[both]).reshape(-1, 2, 3)
    step[seen] = np.abs(np.diff(colors, axis=1)).mean(axis=(1, 2))
    return step


def project_seams(folder: Path, distance: float = 1.25, photos: bool = True) -> Seams:
    """The seams of a colored project's model.glb."""
    project = Project.open(folder)
    model = read_model(project.out / "model.glb")
    assert isinstance(model, TexturedMesh)
    with open_renderer(RenderOptions()) as renderer:
        looked_at = _photos(project) if photos else ()
        return seams_of(model, looked_at, renderer if photos else None, distance)


def _photos(project: Project) -> Iterable[tuple[Camera, np.ndarray]]:
    for name, record in project.load_cameras().items():
        camera = record.registered_camera
        if camera is not None and name in project.photo_paths:
            yield camera, project.load_photo(name).pixels


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("project", type=Path, nargs="+")
    parser.add_argument("--distance", type=float, default=1.25)
    given = parser.parse_args()
    for folder in given.project:
        print(folder.name, project_seams(folder, given.distance))


if __name__ == "__main__":
    main()
