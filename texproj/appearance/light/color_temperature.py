"""Colors of light by temperature: linear sRGB of luminance 1.

Own code: the library colour-science has both and brings a hundred modules for these two formulas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Doubles

XYZ_TO_RGB = np.array([
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])  # fmt: skip
"""Linear sRGB of CIE XYZ (IEC 61966-2-1)."""

PLANCK_KELVIN = 1000.0, 15000.0
DAYLIGHT_KELVIN = 4000.0, 25000.0


def planck_xy(kelvin: ArrayLike) -> Doubles:
    """(..., 2) CIE 1931 chromaticity of a black body, 1000 to 15,000 K.

    Krystek, "An algorithm to calculate correlated colour temperature", Color Research and
    Application 10(1), 1985: within 8e-5 of the locus in u and v. Raises ValueError outside.
    """
    t = _checked(kelvin, PLANCK_KELVIN, "a black body")
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (
        1 + 8.42420235e-4 * t + 7.08145163e-7 * t**2
    )
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (
        1 - 2.89741816e-5 * t + 1.61456053e-7 * t**2
    )
    below = 2 * u - 8 * v + 4
    return np.stack([3 * u / below, 2 * v / below], axis=-1)


def daylight_xy(kelvin: ArrayLike) -> Doubles:
    """(..., 2) CIE 1931 chromaticity of daylight, 4000 to 25,000 K (CIE 15:2004, eqs. 3.3, 3.4).

    D65 is at 6504 K, on the scale of today. Raises ValueError outside.
    """
    t = _checked(kelvin, DAYLIGHT_KELVIN, "daylight")
    low = -4.6070e9 / t**3 + 2.9678e6 / t**2 + 0.09911e3 / t + 0.244063
    high = -2.0064e9 / t**3 + 1.9018e6 / t**2 + 0.24748e3 / t + 0.237040
    x = np.where(t <= 7000, low, high)
    return np.stack([x, -3.000 * x**2 + 2.870 * x - 0.275], axis=-1)


def rgb_of_xy(xy: ArrayLike) -> Doubles:
    """(..., 3) linear sRGB of luminance 1; what lies outside of sRGB has its negative channels cut
    at 0 and the luminance kept.
    """
    x, y = np.moveaxis(np.asarray(xy, np.float64), -1, 0)
    rgb = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1) @ XYZ_TO_RGB.T
    rgb = np.maximum(rgb, 0)
    return rgb / (rgb @ np.array([0.2126, 0.7152, 0.0722]))[..., None]


def rgb_of_kelvin(kelvin: ArrayLike) -> Doubles:
    """(..., 3) linear sRGB of luminance 1: a black body below 5000 K, daylight from there on, as
    lamps and skies are spoken of. Raises ValueError outside of 1000 to 25,000 K.
    """
    t = _checked(kelvin, (PLANCK_KELVIN[0], DAYLIGHT_KELVIN[1]), "light")
    warm = planck_xy(np.minimum(t, 5000.0))
    cold = daylight_xy(np.maximum(t, 5000.0))
    return rgb_of_xy(np.where((t < 5000)[..., None], warm, cold))


def _checked(kelvin: ArrayLike, limits: tuple[float, float], what: str) -> Doubles:
    t = np.asarray(kelvin, np.float64)
    if not ((t >= limits[0]) & (t <= limits[1])).all():
        raise ValueError(f"{what} is given from {limits[0]:.0f} to {limits[1]:.0f} K")
    return t
