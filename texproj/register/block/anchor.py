"""A block of photos put onto the mesh by those of its photos that are registered already.

A registered photo shows where on the mesh the block's points in it are. From such pairs of points
all seven numbers follow by weighted least squares (Umeyama, "Least-squares estimation of
transformation parameters between two point patterns", PAMI 1991), one photo being enough. What a
registration confuses, a photo's focal length with its distance, does not matter for them. Robust
loss, and how sure the result is: ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Bools, Doubles, Floats, Index
from texproj.camera import Camera
from texproj.errors import RegistrationError
from texproj.photo import Correspondences
from texproj.register.block.reconstruction import Reconstruction
from texproj.register.block.similarity import Similarity
from texproj.register.surface_lookup import surface_at

LEAST_PAIRS = 30
"""Points of the block that lie on the mesh below which nothing is concluded."""
MOST_ERROR_PX, LEAST_ANGLE_RAD = 1.5, np.radians(2.0)
"""Of the block's points that are used."""
TRIPLES, JUDGES = 400, 600
"""Places tried from three pairs each, and pairs that judge them."""
NEARBY = 0.02
"""Distance, widths of the photo, within which a pair agrees with a place that is tried."""
ROUNDS = 12
LEAST_SCALE_PX = 0.3
OUTSIDE = 3.0
"""Scales of the residuals beyond which a pair does not lie on the mesh: a tree, a visitor."""
BLOCK_ERROR = 3e-4
"""How exact a block is in itself, widths of the photo: blocks of real photos had .0001 - .0005."""
LEAST_SHARE = 0.25
"""Of the pairs that agree: with fewer the block is not what the mesh shows there."""
CONTRADICTS = 0.4
"""Share of an anchor's pairs that agree, relative to all anchors', below which it is wrong."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """A registered photo of a block. camera: world, full size; depth: (h, w) of the mesh as it
    sees it at a reduced size, inf where it does not; expected_error_px: of its registration; picks:
    from which it was registered, if it was, and their noise pick_sigma_px.
    """

    name: str
    camera: Camera
    depth: Floats
    expected_error_px: float
    picks: Correspondences | None = None
    pick_sigma_px: float = 0.0


@dataclass(frozen=True, eq=False)
class Anchored:
    """world_from_block: where the block is; sigma: (7,) standard deviations of its rotation about
    `pivot` (3,) world (rad, world axes), of the pivot's place (mesh units) and of the logarithm
    of its scale. expected_error_px: (p,) one standard deviation of the surface's image in each of
    the block's photos, full-size pixels. agreeing: (a,) share of each anchor's pairs that agree;
    residual_px: median distance on the mesh between a pair's points, pixels of the photo that
    shows them; contradicts: names of the anchors that the others and the block's shape contradict.
    """

    world_from_block: Similarity
    sigma: Doubles
    pivot: Doubles
    expected_error_px: Doubles
    agreeing: Doubles
    residual_px: float
    contradicts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """block, world: (n, 3) the same points; px: (n,) pixels per mesh unit where they were seen;
    anchor: (n,) row of the photo that saw them.
    """

    block: Doubles
    world: Doubles
    px: Doubles
    anchor: Index

    def __len__(self) -> int:
        return len(self.px)

    def __getitem__(self, rows: Index) -> _Pairs:
        return _Pairs(self.block[rows], self.world[rows], self.px[rows], self.anchor[rows])

    def offset_px(self, place: Similarity) -> Doubles:
        """(n,) distances on the mesh, in pixels of the photo that shows them."""
        return np.linalg.norm(place.apply(self.block) - self.world, axis=1) * self.px


def anchored(block: Reconstruction, anchors: Sequence[Anchor], seed: int = 0) -> Anchored:
    """The block where its registered photos put it.

    Raises RegistrationError where they show too little of the mesh, where it is of another shape
    there than the block, or where they contradict each other. The same seed gives the same result.
    """
    pairs = _pairs(block, anchors)
    if len(pairs) < LEAST_PAIRS:
        raise RegistrationError(
            f"only {len(pairs)} points of the photos lie on the mesh where {_names(anchors)} "
            "shows it; register a photo that shows more of it"
        )
    near = NEARBY * max(anchor.camera.width for anchor in anchors)
    noise_px = np.array([anchor.expected_error_px for anchor in anchors])
    first = _best_triple(pairs, near, np.random.default_rng(seed))
    place, scale = _settled(first, pairs, near, noise_px)
    agree = pairs.offset_px(place) < min(near, OUTSIDE * scale)
    if agree.mean() < LEAST_SHARE or agree.sum() < LEAST_PAIRS:
        raise RegistrationError(
            f"the photos' points and the mesh where {_names(anchors)} shows it differ in shape; "
            "check that registration, and that the mesh is of this thing"
        )
    return _concluded(block, anchors, pairs, place, agree, scale)


def _names(anchors: Sequence[Anchor]) -> str:
    return ", ".join(anchor.name for anchor in anchors)


def _pairs(block: Reconstruction, anchors: Sequence[Anchor]) -> _Pairs:
    good = (block.error_px < MOST_ERROR_PX) & (block.angle_rad > LEAST_ANGLE_RAD)
    parts = [_pairs_of(block, anchor, k, good) for k, anchor in enumerate(anchors)]
    return _Pairs(
        np.concatenate([part.block for part in parts]),
        np.concatenate([part.world for part in parts]),
        np.concatenate([part.px for part in parts]),
        np.concatenate([part.anchor for part in parts]),
    )


def _pairs_of(block: Reconstruction, anchor: Anchor, row: int, good: Bools) -> _Pairs:
    points, xy = block.seen_from(block.names.index(anchor.name))
    points, xy = points[good[points]], xy[good[points]]
    use, world = surface_at(anchor.camera, anchor.depth, xy.astype(np.float64))
    depth = anchor.camera.pose.apply(world)[:, 2]
    px = anchor.camera.intrinsics.fx / depth
    return _Pairs(block.points[points[use]], world, px, np.full(len(use), row))


def _best_triple(pairs: _Pairs, near: float, rng: np.random.Generator) -> Similarity:
    """The place from three pairs with which most others agree (MSAC)."""
    judges = pairs[rng.permutation(len(pairs))[:JUDGES]]
    rows = rng.integers(len(pairs), size=(TRIPLES, 3))
    scale, R, t = _fits(pairs.block[rows], pairs.world[rows], np.ones((TRIPLES, 3)))
    placed = scale[:, None, None] * judges.block @ R.transpose(0, 2, 1) + t[:, None]
    offset2 = ((placed - judges.world) ** 2).sum(axis=2) * judges.px**2
    best = int(np.minimum(offset2, near**2).mean(axis=1).argmin())
    return Similarity(float(scale[best]), R[best], t[best])


def _settled(
    place: Similarity, pairs: _Pairs, near: float, noise_px: Doubles
) -> tuple[Similarity, float]:
    """The place after rounds of least squares with a Cauchy loss, and its scale, pixels.

    noise_px: (a,) what all pairs of an anchor may be off together.
    """
    scale = near / 2
    number = np.bincount(pairs.anchor, minlength=len(noise_px))[pairs.anchor]
    for _ in range(ROUNDS):
        offset = pairs.offset_px(place)
        close = offset < near
        if close.sum() < 3:
            break
        scale = max(LEAST_SCALE_PX, float(np.median(offset[close])))
        trust = 1 / (number * noise_px[pairs.anchor] ** 2 + scale**2)
        place = _fitted(pairs, trust * pairs.px**2 / (1 + (offset / scale) ** 2))
    return place, scale


def _fitted(pairs: _Pairs, weight: Doubles) -> Similarity:
    """The similarity of least weighted squares."""
    scale, R, t = _fits(pairs.block[None], pairs.world[None], weight[None])
    return Similarity(float(scale[0]), R[0], t[0])


def _fits(block: Doubles, world: Doubles, weight: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    """Scales (h,), R (h, 3, 3), t (h, 3) of least weighted squares for h sets of n pairs.

    block, world: (h, n, 3); weight: (h, n). Umeyama's equations 38 to 42, weighted.
    """
    weight = weight / weight.sum(axis=1, keepdims=True)
    middle, there = (np.einsum("hn,hni->hi", weight, xyz) for xyz in (block, world))
    a, b = block - middle[:, None], world - there[:, None]
    u, d, vt = np.linalg.svd(np.einsum("hn,hni,hnj->hij", weight, b, a))
    flip = np.ones_like(d)
    flip[:, 2] = np.where(np.linalg.det(u) * np.linalg.det(vt) < 0, -1.0, 1.0)
    R = (u * flip[:, None]) @ vt
    spread = np.einsum("hn,hni->h", weight, a**2)
    scale = (d * flip).sum(axis=1) / np.maximum(spread, 1e-300)
    return scale, R, there - scale[:, None] * np.einsum("hij,hj->hi", R, middle)


def _concluded(
    block: Reconstruction,
    anchors: Sequence[Anchor],
    pairs: _Pairs,
    place: Similarity,
    agree: Bools,
    scale: float,
) -> Anchored:
    rows = range(len(anchors))
    total = np.bincount(pairs.anchor, minlength=len(anchors))
    share = np.bincount(pairs.anchor, agree, len(anchors)) / np.maximum(total, 1)
    wrong = (total > 0) & (share < CONTRADICTS * agree.mean())
    if wrong.any() and wrong.sum() >= ((total > 0) & ~wrong).sum():
        raise RegistrationError(
            f"{_names(anchors)} contradict each other, and which is wrong cannot be told; correct "
            "one of them"
        )
    pivot = pairs.world[agree].mean(axis=0)
    information = np.zeros((7, 7))
    for k in rows:
        own = agree & (pairs.anchor == k)
        if not wrong[k] and own.any():
            motion = _motion(pairs.world[own], pivot) * pairs.px[own, None, None]
            noise2 = anchors[k].expected_error_px ** 2 + scale**2
            information += 7 * np.einsum("nij,nik->jk", motion, motion) / (own.sum() * noise2)
    covariance = np.asarray(np.linalg.pinv(information), np.float64)
    return Anchored(
        world_from_block=place,
        sigma=np.sqrt(np.diag(covariance)),
        pivot=pivot,
        expected_error_px=_image_errors(block, place, pivot, covariance),
        agreeing=share,
        residual_px=scale,
        contradicts=tuple(anchor.name for anchor, bad in zip(anchors, wrong, strict=True) if bad),
    )


def _motion(world: Doubles, pivot: Doubles) -> Doubles:
    """(n, 3, 7) how points (n, 3) move with rotation about the pivot, shift, and log scale."""
    arm = world - pivot
    turn = -np.cross(arm[:, None, :], np.eye(3)[None])  # d(w x arm) / dw, by rows of w
    shift = np.broadcast_to(np.eye(3), turn.shape)
    return np.concatenate([turn.transpose(0, 2, 1), shift, arm[:, :, None]], axis=2)


def _image_errors(
    block: Reconstruction, place: Similarity, pivot: Doubles, covariance: Doubles
) -> Doubles:
    """(p,) root mean square motion of what each photo shows, pixels."""
    errors = []
    for k, camera in enumerate(block.cameras):
        world = place.apply(block.points[block.seen_from(k)[0]])
        ray = world - place.camera(camera).center
        length = np.linalg.norm(ray, axis=1)
        ray /= length[:, None]
        motion = _motion(world, pivot)
        motion -= ray[:, :, None] * np.einsum("ni,nij->nj", ray, motion)[:, None]
        px = camera.intrinsics.fx / length
        variance = np.einsum("nij,jk,nik->n", motion, covariance, motion) * px**2
        own = (BLOCK_ERROR * camera.width) ** 2
        errors.append(np.sqrt(own + variance.mean()) if len(variance) else np.inf)
    return np.array(errors)
