"""Absolute color: what turns a photo's colors into those that its color chart is known to have.

A matrix on linear light, fitted to the patches by robust least squares in CIELAB; ours, after the
usual practice (e.g. Finlayson, Mackiewicz, Hurlbert, "Color correction using root-polynomial
regression", 2015, whose linear case it is). Light that falls off over the chart is fitted too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Doubles
from texproj.color.checker.find import Patches, find_charts, measure_chart
from texproj.errors import InputError
from texproj.photo import Photo, PhotoInfo

REFERENCE_LAB = np.array([
    (37.54, 14.37, 14.92), (64.66, 19.27, 17.50), (49.32, -3.82, -22.54), (43.46, -12.74, 22.72),
    (54.94, 9.61, -24.79), (70.48, -32.26, -0.37), (62.73, 35.83, 56.50), (39.43, 10.75, -45.17),
    (50.57, 48.64, 16.67), (30.10, 22.54, -20.87), (71.77, -24.13, 58.19), (71.51, 18.24, 67.37),
    (28.37, 15.42, -49.80), (54.38, -39.72, 32.27), (42.43, 51.05, 28.62), (81.80, 2.67, 80.41),
    (50.63, 51.28, -14.12), (49.57, -29.71, -28.32), (95.19, -1.03, 2.93), (81.29, -0.57, 0.44),
    (66.89, -0.75, -0.06), (50.76, -0.13, 0.14), (35.63, -0.46, -0.48), (20.64, 0.07, -0.46),
])  # fmt: skip
"""(24, 3) CIELAB (D50, 2 degrees) of the ColorChecker Classic, as X-Rite publishes them for charts
made since November 2014; older ones differ by about 1."""

XYZ_OF_SRGB = np.array([
    (0.4360747, 0.3850649, 0.1430804),
    (0.2225045, 0.7168786, 0.0606169),
    (0.0139322, 0.0971045, 0.7141733),
])  # fmt: skip
"""Linear sRGB to XYZ, adapted to D50 by Bradford's transform (ICC; B. Lindbloom)."""

CHROMA_WEIGHT = 0.045
"""Differences of hue and chroma count less in strong colors (CIE 1994)."""

OUTLIER = 3.0
"""Color difference from which on a patch (glare, dirt) counts less."""

FALLOFF_SIGMA = 0.2
"""Prior of the fall-off: standard deviation of the log of light from the middle to an edge."""

WORST_MEDIAN, WORST_P95 = 5.0, 15.0
"""CIEDE2000 after correction beyond which the chart is not believed: cameras stay below 4 with a
matrix (median), other charts and strong tone curves do not."""


@dataclass(frozen=True, eq=False)
class Checker:
    """What a chart's photo says about color.

    matrix: (3, 3) linear light of that photo to absolute linear sRGB, 1 = perfect white; info: the
    photo's header; before, after: (24,) CIEDE2000 of the patches; left_out: (24,) of each patch
    when the others alone are fitted; falloff: brightest over darkest light on the chart;
    photo: name of the model's photo that it is, None if it is none of them; place: of the chart in
    that photo, 0..1 from its top-left corner.
    """

    matrix: Doubles
    info: PhotoInfo
    before: Doubles
    after: Doubles
    left_out: Doubles
    falloff: float
    photo: str | None = None
    place: tuple[float, float] = (0.5, 0.5)

    @property
    def quality(self) -> dict[str, Any]:
        """Numbers for the report."""
        figures = {"before": self.before, "after": self.after, "left_out": self.left_out}
        ciede = {k: {"median": float(np.median(v)), "p95": p95(v)} for k, v in figures.items()}
        matrix = self.matrix.round(5).tolist()
        return {
            "file": self.info.name, "matrix": matrix, "ciede2000": ciede, "falloff": self.falloff,
        }  # fmt: skip


def read_checker(photo: Photo, name: str | None = None) -> Checker:
    """The correction that the color chart in a photo calls for.

    name: of the model's photo that it is, if any. Raises InputError, one sentence with the remedy,
    where there is no chart, where it is cut or wrongly exposed, and where no correction fits.
    """
    problem = InputError(
        f"{photo.info.name}: no 24-patch color chart found; photograph it whole, from the front and"
        " larger, or correct `checker` in [color], `gray` in [light]"
    )
    for number, corners in enumerate(find_charts(photo)):
        try:
            return _checker(measure_chart(photo, corners), photo.info, name)
        except InputError as error:
            problem = problem if number else error
    raise problem


def _checker(seen: Patches, info: PhotoInfo, name: str | None) -> Checker:
    """The correction that patches call for. Raises InputError where none fits."""
    fits = [(patches, *_fit(patches, np.ones(24, bool))) for patches in (seen, seen.turned())]
    patches, matrix, slope = min(fits, key=lambda fit: float(np.median(_differences(*fit))))
    after = _differences(patches, matrix, slope)
    if np.median(after) > WORST_MEDIAN or p95(after) > WORST_P95:
        raise InputError(
            f"{info.name}: the color chart's patches cannot be corrected (CIEDE2000 median"
            f" {np.median(after):.1f}, 95 % {p95(after):.1f}); use a 24-patch ColorChecker in even"
            " light, and a photo developed without effects"
        )
    before = _differences(patches, np.eye(3), np.zeros(2))
    light = np.exp(patches.xy @ slope)
    left_out = _left_out(patches)
    falloff = float(light.max() / light.min())
    return Checker(
        matrix, info, before, after, left_out, falloff, name, patches.middle
    )  # fmt: skip


def p95(values: Doubles) -> float:
    """The 95th percentile."""
    return float(np.percentile(values, 95))


def lab_of_srgb(linear: NDArray[Any]) -> Doubles:
    """(n, 3) linear sRGB to CIELAB under D50 (CIE 15)."""
    xyz = linear @ XYZ_OF_SRGB.T / XYZ_OF_SRGB.sum(axis=1)
    dark = xyz < (6 / 29) ** 3
    f = np.where(dark, xyz * (29 / 6) ** 2 / 3 + 4 / 29, np.cbrt(xyz))
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def _differences(patches: Patches, matrix: Doubles, slope: Doubles) -> Doubles:
    """(24,) CIEDE2000 between corrected and known colors."""
    from skimage.color import deltaE_ciede2000  # noqa: PLC0415 - slow to load

    return deltaE_ciede2000(lab_of_srgb(_corrected(patches, matrix, slope)), REFERENCE_LAB)


def _corrected(patches: Patches, matrix: Doubles, slope: Doubles) -> Doubles:
    return patches.rgb * np.exp(-patches.xy @ slope)[:, None] @ matrix.T


def _fit(patches: Patches, used: NDArray[np.bool_]) -> tuple[Doubles, Doubles]:
    """Matrix and fall-off (2,) that bring the used patches to their known colors."""
    from scipy.optimize import least_squares  # noqa: PLC0415 - slow to load

    chroma = np.hypot(REFERENCE_LAB[:, 1], REFERENCE_LAB[:, 2])
    scale = np.ones((24, 3))
    scale[:, 1:] += CHROMA_WEIGHT * chroma[:, None]

    def residuals(x: Doubles) -> Doubles:
        lab = lab_of_srgb(_corrected(patches, x[:9].reshape(3, 3), x[9:]))
        off = ((lab - REFERENCE_LAB) / scale)[used]
        return np.append(off.ravel(), OUTLIER * x[9:] / FALLOFF_SIGMA)

    start = np.linalg.lstsq(patches.rgb[used], srgb_of_lab(REFERENCE_LAB)[used], rcond=None)[0].T
    found = least_squares(
        residuals, np.append(start.ravel(), [0, 0]), loss="soft_l1", f_scale=OUTLIER, x_scale="jac"
    ).x
    return found[:9].reshape(3, 3), found[9:]


def _left_out(patches: Patches) -> Doubles:
    """(24,) CIEDE2000 of each patch by the correction that the other 23 call for."""
    out = np.empty(24)
    for patch in range(24):
        used = np.arange(24) != patch
        out[patch] = _differences(patches, *_fit(patches, used))[patch]
    return out


def srgb_of_lab(lab: Doubles) -> Doubles:
    """(n, 3) CIELAB under D50 to linear sRGB, which may lie outside of 0..1 (CIE 15)."""
    y = (lab[:, 0] + 16) / 116
    f = np.stack([y + lab[:, 1] / 500, y, y - lab[:, 2] / 200], axis=1)
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    return np.linalg.solve(XYZ_OF_SRGB, (xyz * XYZ_OF_SRGB.sum(axis=1)).T).T
