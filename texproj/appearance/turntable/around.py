"""Light that comes to points of an object from its own surface, in each photo of it turned."""

from __future__ import annotations

import numpy as np

from texproj.appearance.flash.bounce import RAYS, Hits, surface_hits
from texproj.appearance.flash.observations import Surfel
from texproj.appearance.turntable.lamps import RoomLamp, RoomLight
from texproj.arrays import Doubles, Floats, Index

BOUNCES = 2
NODE_RAYS = 4


class AroundNodes:
    """Points of the surface that send light to others."""

    def __init__(self, light: RoomLight, surfels: Surfel, sky: Doubles) -> None:
        """surfels: n nodes; sky: (n, 9) their transfer."""
        self._light, self._surfels, self._sky = light, surfels, sky
        self._hits: Hits = surface_hits(light.shadows, surfels)

    def sent(self, albedo: Doubles, found: Doubles, lamps: list[RoomLamp]) -> Floats:
        """(n, p, 3) pi times what the nodes send out in each photo.

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
            sent = albedo * direct
            for _ in range(BOUNCES - 1):
                sent = albedo * (direct + _gathered(self._hits, sent, count))
            out[:, photo] = sent
        return out

    def arriving(self, sent: Floats, point: Index, photo: Index) -> Doubles:
        """(m, 3) irradiance by what nodes send, at nodes in photos."""
        return _arriving(self._hits, sent, point, photo)

    def arriving_at(self, surfels: Surfel, sent: Floats, point: Index, photo: Index) -> Doubles:
        """The same at other points, by rays of their own: light in hollows differs from point to
        point, so that what arrives at nodes nearby does not tell it.
        """
        hits = surface_hits(self._light.shadows, surfels, self._surfels)
        return _arriving(hits, sent, point, photo)


def _arriving(hits: Hits, sent: Floats, point: Index, photo: Index) -> Doubles:
    out = np.zeros((len(point), 3))
    count = int(point.max(initial=-1)) + 1
    for number in range(sent.shape[1]):
        rows = np.flatnonzero(photo == number)
        if len(rows):
            out[rows] = _gathered(hits, sent[:, number], count)[point[rows]]
    return out


def _gathered(hits: Hits, sent: Doubles | Floats, count: int) -> Doubles:
    """(count, 3) irradiance by surfaces that send out (n, 3) over pi."""
    met = sent[hits.met]
    sums = [np.bincount(hits.node, met[:, k], count)[:count] for k in range(3)]
    return np.stack(sums, axis=1) / RAYS
