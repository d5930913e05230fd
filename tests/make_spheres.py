"""Draw each model of reflectance as a sphere in the sun: docs/reflectance.jpg.

python tests/make_spheres.py
"""

from pathlib import Path

import cv2
import numpy as np

from texproj.appearance.brdf import (
    GGX,
    AnisotropicGGX,
    Beckmann,
    Blinn,
    BlinnPhong,
    Brdf,
    EnergyPreservingOrenNayar,
    Lafortune,
    Lambert,
    Lobe,
    Microfacet,
    ModifiedPhong,
    OrenNayar,
    Phong,
    Ward,
)
from texproj.appearance.brdf.fresnel import Conductor, Dielectric, Schlick
from texproj.appearance.brdf.shadowing import (
    cook_torrance,
    schlick_beckmann,
    smith_beckmann,
    smith_ggx,
)
from texproj.arrays import Bytes, Doubles
from texproj.formats.jpeg import jpeg_bytes
from texproj.photo import srgb_from_linear

SIZE = 150
LABEL = 26
COLUMNS = 5
TO_SUN = np.array([-0.45, 0.5, 0.74]) / np.linalg.norm([-0.45, 0.5, 0.74])
CLAY = np.array([0.55, 0.3, 0.2])
GOLD = Conductor(np.array([0.143, 0.375, 1.442]), np.array([3.983, 2.386, 1.603]))

MODELS: dict[str, tuple[Brdf, bool]] = {
    "Lambert": (Lambert(CLAY), False),
    "Oren-Nayar": (OrenNayar(CLAY, 0.6), False),
    "energy-preserving": (EnergyPreservingOrenNayar(CLAY, 1.0), False),
    "Phong": (Phong(0.4, 40.0), True),
    "modified Phong": (ModifiedPhong(0.1, 40.0), True),
    "Blinn-Phong": (BlinnPhong(0.1, 120.0), True),
    "Ward": (Ward(0.1, 0.3, 0.08), True),
    "Lafortune": (Lafortune((Lobe(-1.0, -1.0, 0.9, 25.0, 1.0),)), True),
    "Cook-Torrance": (Microfacet(Beckmann(0.25), cook_torrance, Dielectric(1.5)), True),
    "Beckmann": (Microfacet(Beckmann(0.2), smith_beckmann(0.2), Schlick(0.04)), True),
    "Blinn": (Microfacet(Blinn(0.2), schlick_beckmann(0.2), Schlick(0.04)), True),
    "GGX": (Microfacet(GGX(0.2), smith_ggx(0.2), Schlick(0.04)), True),
    "GGX, rough gold": (Microfacet(GGX(0.4), smith_ggx(0.4), GOLD), False),
    "GGX, gold": (Microfacet(GGX(0.15), smith_ggx(0.15), GOLD), False),
    "brushed gold": (Microfacet(AnisotropicGGX(0.5, 0.12), smith_ggx(0.5, 0.12), GOLD), False),
}
"""Each model, and whether it is a highlight that lies over a matte surface here."""


def sphere(model: Brdf, coated: bool) -> Bytes:
    """(SIZE, SIZE, 3) sRGB: the model on a sphere in the sun and a weak sky, from far away."""
    y, x = 1.15 * (1 - 2 * (np.mgrid[:SIZE, :SIZE] + 0.5) / SIZE)
    x, inside = -x, x**2 + y**2 < 1
    normal = np.stack([x[inside], y[inside]], axis=1)
    normal = np.column_stack([normal, np.sqrt(1 - (normal**2).sum(axis=1))])
    first = np.cross([0.0, 1.0, 0.0], normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(normal, first), normal], axis=1)
    wi, wo = frame @ TO_SUN, frame @ np.array([0.0, 0.0, 1.0])
    value = _three(model.evaluate(wi, wo))
    if coated:
        value = value + Lambert(CLAY).evaluate(wi, wo)
    light = np.pi * value * np.maximum(wi[:, 2:], 0) + 0.03 * (normal[:, 1:2] + 1.2)
    image = np.full((SIZE, SIZE, 3), 0.9)
    image[inside] = light
    return np.round(255 * srgb_from_linear(np.clip(image, 0, 1))).astype(np.uint8)


def _three(value: Doubles) -> Doubles:
    return np.repeat(value[:, None], 3, axis=1) if value.ndim == 1 else value


def main() -> None:
    """All models, with their names below."""
    cards = []
    for name, (model, coated) in MODELS.items():
        label = np.full((LABEL, SIZE, 3), 243, np.uint8)
        cv2.putText(
            label, name, (8, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA
        )
        cards.append(np.concatenate([sphere(model, coated), label]))
    rows = [np.concatenate(cards[k : k + COLUMNS], 1) for k in range(0, len(cards), COLUMNS)]
    target = Path(__file__).resolve().parent.parent / "docs/reflectance.jpg"
    target.write_bytes(jpeg_bytes(np.concatenate(rows), 88))


if __name__ == "__main__":
    main()
