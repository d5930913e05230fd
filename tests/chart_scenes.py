"""Photographs of a color chart made ray by ray: the chart is a plane, its colors come from tables,
light, camera, noise and encoding are written out here and share nothing with texproj.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from skimage.color import lab2xyz

from texproj.photo import Photo, PhotoInfo

LAB_D50 = """
37.54 14.37 14.92 64.66 19.27 17.50 49.32 -3.82 -22.54 43.46 -12.74 22.72 54.94 9.61 -24.79
70.48 -32.26 -0.37 62.73 35.83 56.50 39.43 10.75 -45.17 50.57 48.64 16.67 30.10 22.54 -20.87
71.77 -24.13 58.19 71.51 18.24 67.37 28.37 15.42 -49.80 54.38 -39.72 32.27 42.43 51.05 28.62
81.80 2.67 80.41 50.63 51.28 -14.12 49.57 -29.71 -28.32 95.19 -1.03 2.93 81.29 -0.57 0.44
66.89 -0.75 -0.06 50.76 -0.13 0.14 35.63 -0.46 -0.48 20.64 0.07 -0.46
"""
"""ColorChecker Classic since November 2014 (X-Rite), row by row."""

BRADFORD_TO_D65 = np.array([
    [0.9555766, -0.0230393, 0.0631636],
    [-0.0282895, 1.0099416, 0.0210077],
    [0.0122982, -0.0204830, 1.3299098],
])  # fmt: skip
SRGB_OF_XYZ = np.array([
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])  # fmt: skip
CROSSTALK = np.array([[0.72, 0.22, 0.06], [0.12, 0.78, 0.10], [0.03, 0.25, 0.72]])
"""A camera's channels, mixed from those of linear sRGB: less saturated, neutral stays neutral."""


def true_linear(lab):
    """Linear sRGB of CIELAB under D50."""
    xyz = lab2xyz(np.asarray(lab, float).reshape(1, -1, 3), illuminant="D50")[0]
    return xyz @ BRADFORD_TO_D65.T @ SRGB_OF_XYZ.T


CHART = true_linear(np.array(LAB_D50.split(), float).reshape(24, 3))


def chart_at(x, y):
    """Linear light of places on the plane: the chart is 3 wide and 2 high around the origin, black
    between the patches and at its edge; around it a table of wood."""
    grain = 0.14 + 0.02 * np.sin(40 * y + 3 * np.sin(2 * x))
    out = grain[..., None] * (1.3, 1.0, 0.7)
    column, row = (x + 1.5) * 2, (y + 1.0) * 2
    inside = (np.abs(x) < 1.6) & (np.abs(y) < 1.1)
    out[inside] = 0.025
    i, j = np.floor(column).astype(int), np.floor(row).astype(int)
    on_patch = (abs(column - i - 0.5) < 0.41) & (abs(row - j - 0.5) < 0.41)
    on_patch &= (i >= 0) & (i < 6) & (j >= 0) & (j < 4)
    out[on_patch] = CHART[(6 * j + i)[on_patch]]
    return out


@dataclass(frozen=True)
class Shot:
    """How the chart is photographed.

    width: part of the picture's width that the chart takes; turn_deg, tilt: how it lies before the
    camera; falloff: change of the log of light per unit of the plane; tone: the camera's own idea.
    """

    exposure: float = 0.8
    white_balance: tuple = (1.0, 1.0, 1.0)
    falloff: tuple = (0.0, 0.0)
    noise: float = 0.004
    size: tuple = (960, 720)
    width: float = 0.55
    turn_deg: float = 8.0
    tilt: tuple = (0.25, 0.15)
    offset: tuple = (0.03, -0.02)
    scene: Callable = chart_at
    seed: int = 0
    tone: Callable = lambda linear: linear

    def light(self, dx, dy):
        """What arrives at the camera through one point of every pixel."""
        w, h = self.size
        u = (np.arange(w)[None] + dx) / w - 0.5 - self.offset[0]
        v = (np.arange(h)[:, None] + dy - h / 2) / w - self.offset[1]
        depth = 3 / self.width / (1 - self.tilt[0] * u - self.tilt[1] * v)
        c, s = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        x, y = (c * u + s * v) * depth, (c * v - s * u) * depth
        strength = np.exp(self.falloff[0] * x + self.falloff[1] * y)
        return self.scene(x, y) * strength[..., None]


def chart_photo(**how):
    """An 8-bit sRGB photo of the plane, four rays a pixel, through JPEG."""
    shot = Shot(**how)
    total = sum(shot.light(dx, dy) for dx in (0.25, 0.75) for dy in (0.25, 0.75)) / 4
    seen = total @ CROSSTALK.T * shot.exposure * np.asarray(shot.white_balance)
    rng = np.random.default_rng(shot.seed)
    seen += rng.normal(size=seen.shape) * shot.noise * np.sqrt(np.maximum(seen, 0) + 0.01)
    seen = shot.tone(np.clip(seen, 0, 1))
    encoded = np.where(seen <= 0.0031308, 12.92 * seen, 1.055 * seen ** (1 / 2.4) - 0.055)
    pixels = np.round(encoded * 255).astype(np.uint8)
    done, jpeg = cv2.imencode(".jpg", pixels[..., ::-1], (cv2.IMWRITE_JPEG_QUALITY, 92))
    assert done
    pixels = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)[..., ::-1]
    return Photo(PhotoInfo("chart.jpg", *shot.size), np.ascontiguousarray(pixels))


def true_matrix(exposure=0.8, white_balance=(1.0, 1.0, 1.0)):
    """What turns such a photo's linear light back into that of the plane."""
    return np.linalg.inv(np.diag(white_balance) @ CROSSTALK * exposure)
