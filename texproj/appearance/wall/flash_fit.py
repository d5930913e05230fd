"""Vignetting, flash profile and the lamp's place by one fit to a white wall.

Ours: log y = g + h.x + log n.l - 2 log d + sum a_i rho^i + sum b_j (3 (1 - cos theta))^j, g and h
of each photo, with the lamp's place and axis; h, times directions x in the picture, stands for what
the pose of the photo is off, and is small. What the lens does stays where it is in the picture;
what the flash does moves with distance and tilt, since the lamp is beside the lens: that parts
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_array

from texproj.appearance.flash.lamp import ANGLE_SCALE, Lamp, polynomial
from texproj.appearance.wall.wall_squares import WallPatches
from texproj.arrays import Doubles

LENS_TERMS, FLASH_TERMS = 3, 6
"""Fewer terms of the flash leave 1.7 % in the vignetting."""

FEWEST_PHOTOS = 6
SOFT = 0.01
"""Relative difference from which on a square counts less (soft L1): dirt, shadows."""

RIDGE = 1e-9
"""Pull of the coefficients to 0, a part of the squares: for terms that the angles do not tell."""

POSE_PULL = 1.0
"""Of the slopes h: noise of a square over that of a slope, squared. Both are about .003, the latter
where poses are known to a milliradian.
"""

SEARCHED = 3
"""Of so many squares one is used where the flash is sought: neighbors say the same."""

STARTS = ((2, 0.1), (2, 0.01), (FLASH_TERMS, 0.1), (FLASH_TERMS, 0.01))
"""Terms of the flash and size of the steps of each search: other places and axes fit to a third of
a percent or so, and one search alone ends in them.
"""

ROUNDS = 3
RIVAL = 1.3
"""How much worse every other place has to fit."""

SAME_PLACE, SAME_AXIS = 0.02, 0.1
"""Part of the distance, and slope, within which two searches found the same."""

MOST_TILT = 0.4
"""Slope of the axis against the lens's beyond which it is no flash on a camera."""

LENS_SURE, FLASH_SURE, LAMP_SURE = 0.02, 0.03, 0.01
"""Largest rms difference between what both halves of the photos tell: of the lens's light, of the
flash's, and of the lamp's place as a part of the distance to the wall.
"""

SPREAD_SURE = 0.003
"""Largest median relative difference of a white wall: exact poses leave .0012, a lens whose middle
is 8 pixels off .0039, with a place of the flash that is wrong by its distance from the lens.
"""

LEAST_RATIO, LEAST_TILT_DEG = 1.3, 10.0
"""Of the distances, and of the steepest photo: without either the flash's light and the lens's lie
in the same places of all pictures.
"""

LEAST_REACH = 0.7
"""Part of the squared half diagonal up to which the wall has to fill some photo."""


TAKE = (
    "photograph the wall from half to two times the usual distance, tilted up to 30 degrees to all"
    " sides, in a dark room"
)


@dataclass(frozen=True, eq=False)
class FlashFit:
    """lamp: found; gains: (p,) log of each photo's light; spread: median of the absolute relative
    differences; lens_apart, flash_apart, place_apart: rms differences between what each half
    of the photos tells, the last in units of the wall's frame; reason: why it is refused, empty
    where it is not.
    """

    lamp: Lamp
    gains: Doubles
    spread: float
    lens_apart: float
    flash_apart: float
    place_apart: float
    reason: str


def fit_flash(patches: WallPatches) -> FlashFit:
    """The flash, and whether the photos tell it. Raises ValueError for fewer photos than
    `FEWEST_PHOTOS`.
    """
    if patches.photos < FEWEST_PHOTOS:
        raise ValueError(f"{patches.photos} photos of the wall; {FEWEST_PHOTOS} are needed")
    distance = float(np.median(patches.xyz[:, 2]))
    x, alone = _sought(patches, distance)
    lamp, gains, spread = _settled(patches, distance, x)
    parts = [patches.of(range(first, patches.photos, 2)) for first in (0, 1)]
    halves = [_settled(part, distance, x)[0] for part in parts]
    rho, cosine = np.linspace(0, lamp.reach, 50), np.linspace(1, lamp.widest, 50)
    lens = [np.exp(polynomial(one.vignetting, rho)) for one in halves]
    flash = [np.exp(polynomial(one.profile, ANGLE_SCALE * (1 - cosine))) for one in halves]
    apart = [float(np.sqrt(np.mean((a / b - 1) ** 2))) for a, b in (lens, flash)]
    place = float(np.linalg.norm(halves[0].place - halves[1].place))
    reason = _reason(lamp, _varied(patches), spread, (apart[0], apart[1], place / distance))
    if not reason and not (alone and np.linalg.norm(x[3:]) < MOST_TILT):
        reason = f"more than one place of the flash explains these photos: {TAKE}"
    return FlashFit(lamp, gains, spread, apart[0], apart[1], place, reason)


def _sought(patches: WallPatches, distance: float) -> tuple[Doubles, bool]:
    """(5,) place over the distance and slopes of the axis; whether no others fit as well."""
    patches = patches.every(SEARCHED)
    even = np.ones(len(patches.log_light))
    whole = _Task(patches, distance, even, FLASH_TERMS)
    found = []
    for terms, step in STARTS:
        first = _Task(patches, distance, even, terms)
        x = least_squares(first.differences, np.zeros(5), x_scale=step, max_nfev=60).x
        last = least_squares(whole.differences, x, x_scale=0.01, max_nfev=60)
        found.append((float(np.sqrt(2 * last.cost / len(even))), last.x))
    cost, best = min(found, key=lambda one: one[0])
    others = [c for c, x in found if not _same(x, best)]
    return best, all(other > RIVAL * cost for other in others)


def _varied(patches: WallPatches) -> bool:
    """Whether the photos are from several distances, or aslant."""
    number = np.maximum(np.bincount(patches.photo, minlength=patches.photos), 1)
    distance = np.bincount(patches.photo, patches.xyz[:, 2], patches.photos) / number
    steepest = np.degrees(np.arccos(np.clip(np.abs(patches.normal[:, 2]).min(), 0, 1)))
    return bool(distance.max() > LEAST_RATIO * distance.min() or steepest > LEAST_TILT_DEG)


def _same(x: Doubles, other: Doubles) -> bool:
    place, axis = np.linalg.norm(x[:3] - other[:3]), np.linalg.norm(x[3:] - other[3:])
    return bool(place < SAME_PLACE and axis < SAME_AXIS)


def _reason(lamp: Lamp, varied: bool, spread: float, apart: tuple[float, float, float]) -> str:
    lens, flash, place = apart
    if lamp.reach < LEAST_REACH:
        return f"the wall fills no photo up to its corners: {TAKE}"
    if not varied:
        return f"all photos look at the wall from one distance, squarely: {TAKE}"
    if spread > SPREAD_SURE:
        return (
            f"the photos show more than an evenly white wall ({100 * spread:.1f} % is left): take"
            " off what hangs there, or choose another wall, in a dark room"
        )
    if lens > LENS_SURE or flash > FLASH_SURE or place > LAMP_SURE:
        return (
            "the flash cannot be told from the lens by these photos (the halves of them differ by"
            f" {100 * lens:.1f} % in the lens, {100 * flash:.1f} % in the flash,"
            f" {100 * place:.1f} % of the distance in the lamp's place): {TAKE}"
        )
    return ""


def _settled(patches: WallPatches, distance: float, x: Doubles) -> tuple[Lamp, Doubles, float]:
    """The lamp near x, log light of each photo, and the spread of what is left; by the soft loss.

    Place and axis are sought, the rest is linear in them (Golub and Pereyra 1973).
    """
    weight = np.ones(len(patches.log_light))
    for _ in range(ROUNDS):
        task = _Task(patches, distance, np.sqrt(weight), FLASH_TERMS)
        x = least_squares(task.differences, x, x_scale=0.01, max_nfev=30).x
        coefficients, off = task.linear(x)
        weight = 1 / np.sqrt(1 + (off / SOFT) ** 2)
    gains, lens, flash = coefficients
    place, axis = _moved(x, distance)
    reach, widest = float(patches.rho.max()), float(_cosine(patches, place, axis).min())
    lamp = Lamp(place, axis, tuple(flash), widest, tuple(lens), reach)
    return lamp, gains, float(np.median(np.abs(off)))


def _moved(x: Doubles, distance: float) -> tuple[Doubles, Doubles]:
    """(3,) place and (3,) unit axis."""
    axis = np.append(x[3:], 1.0)
    return x[:3] * distance, axis / np.linalg.norm(axis)


def _cosine(patches: WallPatches, place: Doubles, axis: Doubles) -> Doubles:
    away = patches.xyz - place
    return away @ axis / np.linalg.norm(away, axis=1)


@dataclass(frozen=True, eq=False)
class _Task:
    """One round. root: (n,) of the weights; terms: of the flash."""

    patches: WallPatches
    distance: float
    root: Doubles
    terms: int

    def differences(self, x: Doubles) -> Doubles:
        """(n,) weighted, and (2 p,) the slopes of the photos."""
        off, own = self._solved(x)[1:]
        return np.concatenate([off, np.sqrt(POSE_PULL) * own[:, 1:].ravel()])

    def linear(self, x: Doubles) -> tuple[tuple[Doubles, Doubles, Doubles], Doubles]:
        """Coefficients of photos, lens and flash, and (n,) what is left."""
        coefficients, off, own = self._solved(x)
        lens, flash = np.split(coefficients, [LENS_TERMS])
        return (own[:, 0], lens, flash), off / self.root

    def _solved(self, x: Doubles) -> tuple[Doubles, Doubles, Doubles]:
        """Coefficients of lens and flash, (n,) what they and the photos' own leave, weighted, and
        (p, 3) those of each photo: log light and slopes, which are eliminated first.
        """
        patches = self.patches
        place, axis = _moved(x, self.distance)
        away = patches.xyz - place
        far = np.linalg.norm(away, axis=1)
        nl = np.maximum(-np.einsum("ij,ij->i", away, patches.normal) / far, 1e-6)
        angle = ANGLE_SCALE * (1 - away @ axis / far)
        wanted = (patches.log_light - np.log(nl) + 2 * np.log(far)) * self.root
        lens = patches.rho[:, None] ** np.arange(1, LENS_TERMS + 1)
        flash = angle[:, None] ** np.arange(1, self.terms + 1)
        terms = np.column_stack([lens, flash]) * self.root[:, None]
        both = np.column_stack([terms, wanted])
        alone = both - self._of_photos(self._own(both))
        normal, right = terms.T @ alone[:, :-1], terms.T @ alone[:, -1]
        normal += RIDGE * len(terms) * np.eye(len(normal))
        # angles that no photo shows tell nothing
        coefficients: Doubles = np.linalg.lstsq(normal, right)[0].astype(np.float64)
        left = wanted - terms @ coefficients
        own = self._own(left[:, None])
        return coefficients, left - self._of_photos(own)[:, 0], own[..., 0]

    @cached_property
    def _basis(self) -> Doubles:
        """(n, 3) 1 and the directions across and down the picture, weighted."""
        xyz = self.patches.xyz
        basis = np.column_stack([np.ones(len(xyz)), xyz[:, :2] / xyz[:, 2:]])
        return basis * self.root[:, None]

    @cached_property
    def _sums(self) -> Any:
        """(p, n) sparse sums over each photo's squares."""
        count = len(self.root)
        place = self.patches.photo, np.arange(count)
        return csr_array((np.ones(count), place), shape=(self.patches.photos, count))

    @cached_property
    def _inverse(self) -> Doubles:
        """(p, 3, 3) of the squares of each photo's basis, slopes pulled to 0."""
        products = self._basis[:, :, None] * self._basis[:, None]
        squares = (self._sums @ products.reshape(-1, 9)).reshape(-1, 3, 3)
        return np.linalg.pinv(squares + POSE_PULL * np.diag([0.0, 1, 1]))

    def _own(self, values: Doubles) -> Doubles:
        """(p, 3, k) coefficients of each photo for (n, k) values."""
        products = self._basis[:, :, None] * values[:, None]
        return self._inverse @ (self._sums @ products.reshape(len(values), -1)).reshape(
            self.patches.photos, 3, -1
        )

    def _of_photos(self, own: Doubles) -> Doubles:
        """(n, k) what those make of each square."""
        return np.einsum("nj,njk->nk", self._basis, own[self.patches.photo])
