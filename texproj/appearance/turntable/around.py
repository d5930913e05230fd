"""Light that comes to points of an object from its own surface, in each photo of it turned."""

from __future__ import annotations

import numpy as np

from texproj.appearance.flash.bounce import RAYS, Hits, surface_hits
from texproj.appearance.flash.observations import Surfel
from texproj.appearance.turntable.lamps import RoomLamp, RoomLight
from texproj.arrays import Doubles, Floats

BOUNCES = 2
NODE_RAYS = 4


class AroundNodes:
    """Points of the surface that light is sent between."""

    def __init__(self, light: RoomLight, surfels: Surfel, sky: Doubles) -> None:
        """surfels: n nodes; sky: (n, 9) their transfer."""
        self._light, self._surfels, self._sky = light, surfels, sky
        self._hits: Hits = surface_hits(light.shadows, surfels)

    def around(self, albedo: Doubles, found: Doubles, lamps: list[RoomLamp]) -> Floats:
        """(n, p, 3) irradiance at the nodes from the surface around.

        albedo: (n, 3) of the nodes; found: (9 + k, 3) the light; lamps: its k lamps.
        """
        photos = len(self._light.room.harmonics)
        count = len(albedo)
        out = np.zeros((count, photos, 3), np.float32)
        everyone = np.arange(count)
        for photo in range(photos):
            number = np.full(count, photo)
            columns = [self._sky @ self._light.room.harmonics[photo]]
            columns += [
                self._light.irradiance(lamp, self._surfels, everyone, number, NODE_RAYS)[:, None]
                for lamp in lamps
            ]
            direct = np.maximum(np.column_stack(columns) @ found, 0)
            total = direct
            for _ in range(BOUNCES):
                arriving = self._gathered(albedo * total)
                total = direct + arriving
            out[:, photo] = arriving
        return out

    def _gathered(self, sent: Doubles) -> Doubles:
        """(n, 3) irradiance by surfaces that send out (n, 3) over pi."""
        met = sent[self._hits.met]
        sums = [np.bincount(self._hits.node, met[:, k], len(sent)) for k in range(3)]
        return np.stack(sums, axis=1) / RAYS
