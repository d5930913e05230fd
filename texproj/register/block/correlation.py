"""Where a block of points fits a mesh as a whole: voxels of both, correlated over all shifts, for
many rotations and scales.

A voxel with points of the block wants the mesh there; a voxel that a line of sight crosses wants
it empty. Method: ours; the correlation by fast Fourier transform as in Katchalski-Katzir et al.,
"Molecular surface recognition", PNAS 1992.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from texproj.arrays import Doubles, Floats, Ints
from texproj.register.block.cloud import Cloud
from texproj.register.block.hypotheses import Hypotheses
from texproj.register.block.scan_samples import ScanSamples

Complexes = NDArray[np.complexfloating]

VOXEL = 1 / 6
"""Edge of a voxel, sizes of the mesh: about what the rotations tried leave undecided."""
TEMPLATE_POINTS = 6000
SIGHT_LINES, ON_A_LINE = 500, 16
SIGHT_SPAN = (0.3, 0.93)
"""Part of a line of sight, from the camera to the point, that must be free."""
FREE_WEIGHT = 0.5
MOST_POINTS = 4
"""Points in a voxel beyond which more do not count: texture is not evidence of shape."""
REACH = 1.8
"""Radius of the template, sizes of the block."""
SHIFTS_EACH = 2
CLEARANCE = 2
"""Voxels around a shift in which no second one is taken."""
LARGEST_GRID = 96
"""Voxels along an edge; a mesh with parts far away is cut to its middle."""
WORKERS = 2
BATCH = 8


@dataclass(frozen=True, eq=False)
class _Template:
    """The block as points (n, 3) and points on lines of sight (k, 3), sizes of the block."""

    points: Floats
    free: Floats

    @classmethod
    def of(cls, cloud: Cloud) -> _Template:
        points = cloud.xyz[:TEMPLATE_POINTS]
        along = np.linspace(*SIGHT_SPAN, ON_A_LINE, dtype=np.float32)[:, None, None]
        end, eye = cloud.xyz[:SIGHT_LINES], cloud.eye[:SIGHT_LINES]
        free = (eye + along * (end - eye)).reshape(-1, 3)
        return cls(_within(points), _within(free))

    def voxels(self, turn: Floats, edge: int, center: int) -> Floats:
        """(edge, edge, edge) what each voxel wants; turn: (3, 3) rotation times scale in voxels."""
        points = _cells(self.points, turn, edge, center)
        count = np.bincount(points, minlength=edge**3)
        wanted = np.sqrt(np.minimum(count, MOST_POINTS)).astype(np.float32)
        crossed = np.zeros(edge**3, bool)
        crossed[_cells(self.free, turn, edge, center)] = True
        wanted[crossed & (count == 0)] = -FREE_WEIGHT
        return wanted.reshape(edge, edge, edge)


def correlated(
    cloud: Cloud, scan: ScanSamples, rotations: Doubles, scales: tuple[float, ...]
) -> Hypotheses:
    """The `SHIFTS_EACH` best shifts for each rotation and scale, with their correlation."""
    low, occupied = _occupied(scan, max(scales))
    edge = occupied.shape[0]
    center = edge // 2
    spectrum = fft.rfftn(occupied, workers=WORKERS)
    template = _Template.of(cloud)
    turns = np.repeat(rotations, len(scales), axis=0)
    sizes = np.tile(np.array(scales), len(rotations))
    shifts, scores = [], []
    for k in range(0, len(turns), BATCH):
        batch = (turns[k : k + BATCH] * sizes[k : k + BATCH, None, None] / VOXEL).astype(np.float32)
        wanted = np.stack([template.voxels(turn, edge, center) for turn in batch])
        shift, score = _best_shifts(wanted, spectrum, center)
        shifts.append(low + VOXEL * (shift + 0.5))
        scores.append(score)
    return Hypotheses(
        np.repeat(turns, SHIFTS_EACH, axis=0),
        np.repeat(sizes, SHIFTS_EACH),
        np.concatenate(shifts).reshape(-1, 3),
        np.concatenate(scores).ravel().astype(np.float64),
    )


def _within(xyz: Floats) -> Floats:
    return xyz[np.einsum("ij,ij->i", xyz, xyz) < REACH**2]


def _cells(xyz: Floats, turn: Floats, edge: int, center: int) -> Ints:
    """Flat numbers of the voxels in which points lie, the block's middle in voxel `center`."""
    where = np.floor(xyz @ turn.T + np.float32(0.5)).astype(np.int64) + center
    where = where[((where >= 0) & (where < edge)).all(axis=1)]
    return (where[:, 0] * edge + where[:, 1]) * edge + where[:, 2]


def _occupied(scan: ScanSamples, scale: float) -> tuple[Doubles, Floats]:
    """Lower corner, and how much mesh each voxel holds, with room for the template around."""
    room = int(np.ceil(REACH * scale / VOXEL / 2)) + 1
    reach = VOXEL * (LARGEST_GRID / 2 - room)
    xyz = scan.xyz[(np.abs(scan.xyz) < reach).all(axis=1)]
    cells = np.floor((xyz - xyz.min(axis=0)) / VOXEL).astype(int) + room
    edge = fft.next_fast_len(int(cells.max()) + room + 1, real=True)
    held = np.zeros((edge,) * 3, np.float32)
    held[tuple(cells.T)] = 1
    low = xyz.min(axis=0).astype(np.float64) - VOXEL * room
    return low, ndimage.gaussian_filter(held, 0.6)


def _best_shifts(wanted: Floats, spectrum: Complexes, center: int) -> tuple[Floats, Floats]:
    """(n, SHIFTS_EACH, 3) voxels in which the block's middle fits best, and (n, SHIFTS_EACH)."""
    n, edge = len(wanted), wanted.shape[1]
    axes = (1, 2, 3)
    product = spectrum * np.conj(fft.rfftn(wanted, axes=axes, workers=WORKERS))
    fits = fft.irfftn(product, wanted.shape[1:], axes=axes, workers=WORKERS)
    shift = np.zeros((n, SHIFTS_EACH, 3), np.float32)
    score = np.zeros((n, SHIFTS_EACH), np.float32)
    around = np.arange(-CLEARANCE, CLEARANCE + 1)
    for i, k in np.ndindex(n, SHIFTS_EACH):
        at = np.array(np.unravel_index(int(fits[i].argmax()), fits[i].shape))
        score[i, k] = fits[i][tuple(at)]
        shift[i, k] = (at + center) % edge
        fits[i][np.ix_(*((a + around) % edge for a in at))] = -np.inf
    return shift, score
