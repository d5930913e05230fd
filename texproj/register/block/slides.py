"""Motions that leave a mesh as it is: a vase turned about its axis, a wall slid along itself.

Where such a motion changes nothing that photos could see of the bare mesh, neither its shape nor
its edges can tell where along the motion a photo belongs: what decides is what somebody said.
The motions are the small eigenvectors of the point-to-plane normal equations (Gelfand and Guibas,
"Shape segmentation using local slippage analysis", SGP 2004); that edges are asked too: ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.photo import Photo
from texproj.register.block.similarity import Similarity
from texproj.register.structure.solve import CHECK, found_share
from texproj.register.structure.view import StructureView
from texproj.render import Render

SLIPPERY = 0.1
"""Motion across the surface relative to the whole motion, root mean squares over the surface, below
which the mesh slides along itself: a vase of few faces has .01, a cushion .2, facades .33."""
STEPS = (-0.12, -0.04, 0.04, 0.12)
"""How far it is slid to look at its edges, sizes of the mesh: beyond the reach of the patches."""
AS_GOOD = 0.6
"""Share of the edges found after a slide, relative to those found before it, from which on they do
not tell the two places apart."""
WORKING_PX = 768
LEAST_FOUND = 0.15
"""Share of the mesh's edges in place below which they tell nothing: by chance .05 are found."""

Kind = Literal["turn", "slide"]


@dataclass(frozen=True, eq=False)
class Slide:
    """A motion of the mesh in itself. kind: a turn about an axis or a slide along a direction;
    twist: (7,) turn about the middle (rad), shift (sizes of the mesh), log scale, so long that the
    surface moves by one size of the mesh, root mean square; across: how far off itself it moves
    then; middle: (3,) world; size: mesh units.
    """

    kind: Kind
    twist: Doubles
    across: float
    middle: Doubles
    size: float

    def by(self, amount: float) -> Similarity:
        """The motion by so many sizes of the mesh."""
        return Similarity.identity().step(amount * self.twist, self.middle, self.size)

    @property
    def words(self) -> str:
        return "turned about its axis" if self.kind == "turn" else "slid along itself"


def slides(xyz: Doubles, normal: Doubles) -> tuple[Slide, ...]:
    """The motions that leave a surface as it is. xyz, normal: (n, 3) points spread over it, world,
    and unit normals.
    """
    middle = np.median(xyz, axis=0)
    size = float(np.sqrt(((xyz - middle) ** 2).sum(axis=1).mean()))
    arm = (xyz - middle) / size
    across = np.concatenate(
        [np.cross(arm, normal), normal, np.einsum("ni,ni->n", arm, normal)[:, None]], axis=1
    )
    turn = -np.cross(arm[:, None], np.eye(3)[None]).transpose(0, 2, 1)
    whole = np.concatenate([turn, np.broadcast_to(np.eye(3), turn.shape), arm[:, :, None]], axis=2)
    moved = np.einsum("nij,nik->jk", whole, whole) / len(xyz)
    off = across.T @ across / len(xyz)
    root = np.linalg.inv(np.linalg.cholesky(moved + 1e-9 * np.eye(7)))
    value, vector = np.linalg.eigh(root @ off @ root.T)
    found = []
    for k in np.flatnonzero(value < SLIPPERY**2):
        twist = root.T @ vector[:, k]
        kind: Kind = "turn" if np.linalg.norm(twist[:3]) > np.linalg.norm(twist[3:]) else "slide"
        found.append(Slide(kind, twist, float(np.sqrt(max(value[k], 0.0))), middle, size))
    return tuple(found)


def found_at(
    cameras: Sequence[Camera], photos: Sequence[Photo], render: Render, moved: Similarity
) -> float:
    """Mean share of the mesh's edges that photos show where cameras (full size), moved with all
    of the world, put them.
    """
    shares = []
    for camera, photo in zip(cameras, photos, strict=True):
        there = moved.camera(camera)
        view = StructureView.of(photo, render, WORKING_PX, there)
        shares.append(found_share(view.observe(there, CHECK)))
    return float(np.mean(shares)) if shares else 0.0


def untold(
    cameras: Sequence[Camera],
    photos: Sequence[Photo],
    render: Render,
    motions: Sequence[Slide],
) -> tuple[Slide, ...]:
    """Those of the mesh's motions in itself after which its edges are found in the photos about as
    well, or of which its edges tell nothing.

    render: depth, normal and ambient occlusion for a camera.
    """
    if not motions:
        return ()
    own = found_at(cameras, photos, render, Similarity.identity())
    if own < LEAST_FOUND:
        return tuple(motions)
    return tuple(
        motion for motion in motions
        if any(found_at(cameras, photos, render, motion.by(a)) >= AS_GOOD * own for a in STEPS)
    )  # fmt: skip
