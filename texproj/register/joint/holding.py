"""Picks that hold the frame: all cameras moved together to where the picks put them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.camera import Camera
from texproj.register.joint.frame import Similarity, by_similarity
from texproj.solve.lm import Loss, minimize

PICK_LOSS = Loss("cauchy", 1.5)
FREEDOM = 10.0
"""How much looser than the photos say the frame is when picks hold it: enough to follow them
wherever they tell, and to stay where they do not, as with picks in one photo alone."""


@dataclass(frozen=True, eq=False)
class Picks:
    """Picks of one photo. xy_px: (n, 2) full-size pixels; xyz_in_world: (n, 3); sigma_px: noise."""

    xy_px: Doubles
    xyz_in_world: Doubles
    sigma_px: float


@dataclass(frozen=True, eq=False)
class _PickedFrame:
    """The seven numbers of a similarity, about `center`, at which picks are met."""

    cameras: Mapping[int, Camera]
    picks: Mapping[int, Picks]
    center: Doubles
    whitened: Doubles

    def residual(self, seven: Doubles) -> Doubles:
        return np.concatenate([
            (self._moved(seven, k).project(one.xyz_in_world)[0] - one.xy_px) / one.sigma_px
            for k, one in self.picks.items()
        ])  # fmt: skip

    def jacobian(self, seven: Doubles) -> Doubles:
        return np.concatenate([
            by_similarity(self._moved(seven, k), one.xyz_in_world, self.center).reshape(-1, 2, 7)
            / one.sigma_px
            for k, one in self.picks.items()
        ])  # fmt: skip

    def step(self, seven: Doubles, delta: Doubles) -> Doubles:
        return seven + delta

    def prior(self, seven: Doubles) -> tuple[Doubles, Doubles]:
        return self.whitened @ seven, self.whitened

    def _moved(self, seven: Doubles, k: int) -> Camera:
        camera = self.cameras[k]
        return Camera(camera.intrinsics, Similarity.of(seven, self.center).moved(camera.pose))


def held_by_picks(
    cameras: Mapping[int, Camera], picks: Mapping[int, Picks], center: Doubles, frame: Doubles
) -> tuple[Similarity, Doubles]:
    """The common motion to where the picks are met, and its (7, 7) covariance. cameras: by number,
    at least those of `picks`; frame: (7, 7) covariance before.
    """
    values, vectors = np.linalg.eigh(frame)
    loose = np.sqrt(np.maximum(values, values.max() * 1e-12)) * FREEDOM
    problem = _PickedFrame(cameras, picks, center, (vectors / loose).T)
    fit = minimize(problem, np.zeros(7), PICK_LOSS)
    return Similarity.of(fit.x, center), fit.covariance(max(fit.scatter2, 1.0))
