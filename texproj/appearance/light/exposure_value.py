"""Exposure values, and the light that they stand for.

EV is that of ISO 100 throughout. A meter calibrated with K = 12.5 cd s / m^2 ISO for reflected and
C = 250 lx s ISO for incident light (ISO 2720:1974) takes L = 2^(EV - 3) and E = 2.5 x 2^EV for
mid-gray exposure.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from texproj.arrays import Doubles

REFERENCE_ISO = 100.0


def ev_of_settings(f_number: ArrayLike, seconds: ArrayLike, iso: ArrayLike = 100.0) -> Doubles:
    """EV at ISO 100 from EXIF's FNumber, ExposureTime and PhotographicSensitivity: the scene's
    brightness for which the settings are right, minus the `exposure_ev` of a photo's header. Raises
    ValueError where one is not positive.
    """
    n, t, s = (np.asarray(value, np.float64) for value in (f_number, seconds, iso))
    if not all((value > 0).all() and np.isfinite(value).all() for value in (n, t, s)):
        raise ValueError("aperture, time and ISO are positive numbers")
    return np.asarray(np.log2(n**2 / t) - np.log2(s / REFERENCE_ISO))


def luminance_of_ev(ev: ArrayLike) -> Doubles:
    """cd / m^2 that a reflected-light meter reads as this EV: 2^(EV - 3)."""
    return np.asarray(np.exp2(np.asarray(ev, np.float64) - 3))


def ev_of_luminance(luminance: ArrayLike) -> Doubles:
    """The inverse of `luminance_of_ev`."""
    return np.asarray(np.log2(np.asarray(luminance, np.float64)) + 3)


def illuminance_of_ev(ev: ArrayLike) -> Doubles:
    """lux that an incident-light meter reads as this EV: 2.5 x 2^EV."""
    return np.asarray(2.5 * np.exp2(np.asarray(ev, np.float64)))


def ev_of_illuminance(illuminance: ArrayLike) -> Doubles:
    """The inverse of `illuminance_of_ev`."""
    return np.asarray(np.log2(np.asarray(illuminance, np.float64) / 2.5))


def brightest_luminance(ev: ArrayLike, headroom: float = 1.2) -> Doubles:
    """cd / m^2 that saturates a sensor exposed for this EV: `headroom` x 2^EV.

    Saturation-based speed (ISO 12232:2006), 78 / (0.65 x 100) = 1.2 for a usual lens; Lagarde and
    de Rousiers, "Moving Frostbite to PBR", SIGGRAPH 2014 course, sec. 5.1.1.
    """
    return np.asarray(headroom * np.exp2(np.asarray(ev, np.float64)))
