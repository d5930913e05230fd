"""RAW files with known linear values, written as cameras write DNG (Adobe DNG 1.4, chapter 4)."""

import numpy as np
import tifffile

BLACK, WHITE = 512, 16383
CAMERA_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560],
     [0.0556434, -0.2040259, 1.0572252]]
)  # fmt: skip
"""A sensor whose colors are the sRGB primaries (http://www.brucelindbloom.com, XYZ to sRGB)."""


def mosaicked(rgb):
    """What each pixel of an RGGB sensor sees of an (h, w, 3) picture."""
    cfa = rgb[..., 1].copy()
    cfa[0::2, 0::2], cfa[1::2, 1::2] = rgb[0::2, 0::2, 0], rgb[1::2, 1::2, 2]
    return cfa


def write_dng(  # noqa: PLR0913 - a file of a camera tells this much
    path, rgb, neutral=(1, 1, 1), *, orientation=1,
    margin=0, noise=0.0, preview=b"", sensor=CAMERA_FROM_XYZ,
):  # fmt: skip
    """A DNG whose sensor saw `rgb` (h, w, 3), linear, 1 = full, under a light that `neutral` tells.

    margin: pixels around the picture that the camera does not show; noise: standard
    deviation; preview: a JPEG of the same size; sensor: its colors, from XYZ.
    """
    scene = np.pad(rgb, ((margin, margin), (margin, margin), (0, 0)), mode="edge")
    seen = mosaicked(scene * neutral)
    seen = seen + np.random.default_rng(1).normal(0, noise, seen.shape) if noise else seen
    data = np.round(BLACK + seen * (WHITE - BLACK)).clip(0, WHITE).astype(np.uint16)
    height, width = rgb.shape[:2]
    tags = [
        (50706, "B", 4, bytes([1, 4, 0, 0]), True), (50708, "s", 0, "Maker Model X", True),
        (33421, "H", 2, (2, 2), True), (33422, "B", 4, bytes([0, 1, 1, 2]), True),
        (50714, "H", 1, BLACK, True), (50717, "H", 1, WHITE, True),
        (50719, "H", 2, (margin, margin), True), (50720, "H", 2, (width, height), True),
        (50721, "2i", 9, _fractions(sensor), True),
        (50728, "2I", 3, _fractions(neutral), True), (50778, "H", 1, 21, True),
        (271, "s", 0, "Maker", True), (272, "s", 0, "Model X", True),
        (274, "H", 1, orientation, True),
    ]  # fmt: skip
    tags += [(33434, "2I", 1, (1, 125), True), (33437, "2I", 1, (8, 1), True),
             (34855, "H", 1, 200, True), (37386, "2I", 1, (50, 1), True),
             (41989, "H", 1, 50, True)]  # fmt: skip
    options = {"photometric": 32803, "extratags": tags, "metadata": None, "software": False}
    with tifffile.TiffWriter(path) as writer:
        writer.write(data, subifds=1 if preview else 0, **options)
        if preview:
            writer.write(
                iter([preview]), shape=(height, width, 3), dtype=np.uint8, photometric="ycbcr",
                compression="jpeg", subfiletype=1, metadata=None, rowsperstrip=height,
            )  # fmt: skip
    return path


def _fractions(values):
    return [part for value in np.ravel(values) for part in (round(value * 100000), 100000)]
