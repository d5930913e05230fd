"""The colors of all photos in the light that a color chart is known by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from texproj.arrays import Doubles, Floats
from texproj.color.balance.corrections import Correction
from texproj.color.balance.photometry import Photometry
from texproj.color.balance.shared_points import SharedPoints
from texproj.color.checker.fit import XYZ_OF_SRGB, Checker
from texproj.photo import PhotoInfo


def absolute_matrix(
    checker: Checker | None, names: Sequence[str], shared: SharedPoints, light: Photometry
) -> tuple[Floats | None, dict[str, Any]]:
    """(3, 3) blended linear light to absolute linear sRGB, None without a chart; and figures for
    the report. names: of the model's photos.

    The blend is in the unit of the photos times their corrections. The chart ties it to absolute
    light through its own photo's gain if that is one of the model's; else through photos of the
    same camera, by EXIF exposure; else it sets the hues alone and leaves the exposure.
    """
    if checker is None:
        return None, {}
    gain = np.log(light.gains.factor.astype(np.float64))
    if checker.photo in names:
        number = names.index(checker.photo)
        factor = light.gains.factor[number] * light_at(light.corrections[number], checker.place)
        matrix, tie = checker.matrix / factor, "the chart's photo is one of the model's"
    elif (stops := _stops(checker.info, shared)) is not None:
        log_factor = np.nanmean(stops[:, None] * np.log(2) - gain, axis=0)
        tie = f"EXIF exposure, {np.isfinite(stops).sum()} photos of the same camera"
        matrix = checker.matrix * np.exp(log_factor)
    else:
        tie = "none: hues alone, the exposure is that of the photos"
        matrix = checker.matrix / (XYZ_OF_SRGB[1] @ checker.matrix).sum()
    told = {"exposure": tie, "exposure_known": not tie.startswith("none")}
    return matrix.astype(np.float32), {"checker": checker.quality | told}


def light_at(correction: Correction, place: tuple[float, float]) -> float:
    """The factor against vignetting at a place of the photo, 0..1 from its top-left corner."""
    if correction.light is None:
        return 1.0
    height, width = correction.light.shape
    row, column = int(place[1] * height), int(place[0] * width)
    return float(correction.light[min(row, height - 1), min(column, width - 1)])


def _stops(chart: PhotoInfo, shared: SharedPoints) -> Doubles | None:
    """(p,) by how many stops the chart's photo gathered more light than each photo of the same
    camera, NaN for others; None where none can be compared.
    """
    infos = [shot.info if shot else None for shot in shared.shots]
    if chart.exposure_ev is None or not chart.camera_body:
        return None
    alike = [
        chart.exposure_ev - info.exposure_ev
        if info and info.exposure_ev is not None and info.camera_body == chart.camera_body
        else np.nan
        for info in infos
    ]
    stops = np.array(alike)
    return stops if np.isfinite(stops).any() else None


def in_absolute(rgb: Floats, matrix: Floats | None) -> Floats:
    """(n, 3) blended linear light made absolute; as it is without a matrix."""
    return rgb if matrix is None else cv2.transform(rgb[None], matrix)[0]
