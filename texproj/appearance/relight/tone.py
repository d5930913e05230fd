"""From luminance to a picture: exposure, and the curve that fits it into what a screen shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Bytes, Floats
from texproj.photo import LUMINANCE, srgb_from_linear

Values = NDArray[Any]
ToneName = Literal["none", "reinhard", "filmic", "aces"]

SATURATION = 1.2
"""Luminance in cd/m2 that a camera set for EV 0 at ISO 100 just holds: ISO 12232, 78 / 100 over a
transmission of .65."""
KEY = 0.18
"""What the mean luminance is exposed to where no EV is given: a gray card's."""
WHITE = 4.0
"""Exposed luminance that Reinhard's curve shows as white (ibid., eq. 4)."""
LINEAR_WHITE = 11.2
"""The same for Hable's."""


def reinhard(x: Values) -> Values:
    """x (1 + x / white^2) / (1 + x) (Reinhard et al., "Photographic tone reproduction", SIGGRAPH
    2002, eq. 4), by channel.
    """
    return x * (1 + x / WHITE**2) / (1 + x)


def filmic(x: Values) -> Values:
    """J. Hable's curve of "Uncharted 2", GDC 2010, with the exposure of 2 that belongs to it."""
    return _hable(2 * x) / _hable(np.array(LINEAR_WHITE))


def _hable(x: Values) -> Values:
    a, b, c, d, e, f = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30
    return (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f


def aces(x: Values) -> Values:
    """K. Narkowicz's fit to the reference transform of ACES, 2015."""
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)


def none(x: Values) -> Values:
    """What is brighter than white is cut."""
    return x


TONES: dict[ToneName, Callable[[Values], Values]] = {
    "none": none,
    "reinhard": reinhard,
    "filmic": filmic,
    "aces": aces,
}


def exposure_of_ev(ev: float) -> float:
    """What luminance in cd/m2 is multiplied by, ISO 100: white is `SATURATION` times 2^EV."""
    return 1 / (SATURATION * 2.0**ev)


def ev_of_exposure(exposure: float) -> float:
    """The inverse."""
    return float(np.log2(1 / (SATURATION * exposure)))


def metered(layers: Floats) -> float:
    """The exposure that puts the mean luminance of a picture at `KEY`, as a camera meters.

    layers: (h, w, 4) linear colors times alpha, and alpha. 1 where nothing is lit.
    """
    mean = float((layers[..., :3] @ LUMINANCE).sum() / max(float(layers[..., 3].sum()), 1e-12))
    return KEY / mean if mean > 0 else 1.0


@dataclass(frozen=True)
class Development:
    """exposure: what luminance is multiplied by; tone: the curve."""

    exposure: float
    tone: ToneName = "filmic"

    def developed(self, layers: Floats) -> Bytes:
        """(h, w, 4) uint8 sRGB and alpha of linear colors times alpha, and alpha."""
        alpha = layers[..., 3:]
        color = np.divide(
            layers[..., :3], alpha, out=np.zeros_like(layers[..., :3]), where=alpha > 0
        )
        shown = TONES[self.tone](np.maximum(color, 0) * np.float32(self.exposure)).clip(0, 1)
        image = np.concatenate([srgb_from_linear(shown.astype(np.float32)), alpha], axis=-1)
        return np.round(255 * image).astype(np.uint8)
