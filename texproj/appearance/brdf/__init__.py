"""Models of reflectance: evaluate, sample, pdf. `model` tells the conventions."""

from texproj.appearance.brdf.diffuse import EnergyPreservingOrenNayar, Lambert, OrenNayar
from texproj.appearance.brdf.distributions import GGX, AnisotropicGGX, Beckmann, Blinn
from texproj.appearance.brdf.lobes import BlinnPhong, Lafortune, Lobe, ModifiedPhong, Phong
from texproj.appearance.brdf.microfacet import Microfacet
from texproj.appearance.brdf.model import Brdf
from texproj.appearance.brdf.ward import Ward

__all__ = [
    "GGX",
    "AnisotropicGGX",
    "Beckmann",
    "Blinn",
    "BlinnPhong",
    "Brdf",
    "EnergyPreservingOrenNayar",
    "Lafortune",
    "Lambert",
    "Lobe",
    "Microfacet",
    "ModifiedPhong",
    "OrenNayar",
    "Phong",
    "Ward",
]
