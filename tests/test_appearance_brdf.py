"""Models of reflectance, against laws and limits that hold on paper and against quadrature."""

import numpy as np
import pytest

from texproj.appearance.brdf import (
    GGX,
    AnisotropicGGX,
    Beckmann,
    Blinn,
    BlinnPhong,
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
from texproj.appearance.brdf import fresnel as fresnels
from texproj.appearance.brdf import shadowing as shadows
from texproj.appearance.brdf.model import from_angles, half, unit

WHITE = fresnels.Schlick(1.0)
MODELS = {
    "lambert": Lambert(),
    "oren-nayar": OrenNayar(0.8, 0.5),
    "oren-nayar, albedo term": OrenNayar(0.8, 0.5, interreflection=True),
    "eon": EnergyPreservingOrenNayar(1.0, 0.8),
    "modified phong": ModifiedPhong(1.0, 30.0),
    "blinn-phong": BlinnPhong(1.0, 30.0),
    "ward as printed": Ward(1.0, 0.3, 0.15, bounded=False),
    "ward bounded": Ward(1.0, 0.3, 0.15),
    "lafortune": Lafortune((Lobe(-0.9, -0.9, 0.9, 12.0, 1.5), Lobe(0.8, 0.8, 0.9, 6.0, 0.3))),
    "beckmann": Microfacet(Beckmann(0.4), shadows.smith_beckmann(0.4), WHITE),
    "ggx": Microfacet(GGX(0.4), shadows.smith_ggx(0.4), WHITE),
    "ggx, separable": Microfacet(GGX(0.4), shadows.smith_ggx(0.4, correlated=False), WHITE),
    "anisotropic ggx": Microfacet(
        AnisotropicGGX(0.5, 0.2), shadows.smith_ggx(0.5, 0.2), fresnels.Dielectric(1.5)
    ),
    "cook-torrance": Microfacet(Beckmann(0.3), shadows.cook_torrance, fresnels.CookTorrance(0.7)),
    "blinn": Microfacet(Blinn(0.4), shadows.schlick_beckmann(0.4), WHITE),
    "gold": Microfacet(GGX(0.3), shadows.schlick_ggx(0.3), fresnels.Conductor(0.4, 2.4)),
    "neumann": Microfacet(GGX(0.4), shadows.neumann, WHITE),
    "implicit": Microfacet(GGX(0.4), shadows.implicit, WHITE),
    "kelemen": Microfacet(GGX(0.4), shadows.kelemen, WHITE),
}
MORE_THAN_ALL = {"ward as printed", "blinn-phong", "neumann", "kelemen"}
"""They reflect more than they get at grazing angles, as their docstrings or papers say."""

DISTRIBUTIONS = (
    Beckmann(0.2),
    Beckmann(0.8),
    GGX(0.2),
    GGX(0.8),
    AnisotropicGGX(0.5, 0.2),
    Blinn(0.3),
)
ANGLES_DEG = (0.0, 30.0, 60.0, 75.0)


def pairs(count=300):
    """Directions of light and of the eye, above the surface."""
    rng = np.random.default_rng(2)
    both = unit(rng.normal(size=(2 * count, 3)))
    both[:, 2] = np.abs(both[:, 2])
    return both[:count], both[count:]


def sphere(steps=240, upper=True):
    """(n, 3) directions and the solid angle of each: midpoints in cosine and azimuth."""
    low = 0.0 if upper else -1.0
    cosine = low + (1 - low) * (np.arange(steps) + 0.5) / steps
    phi = 2 * np.pi * (np.arange(2 * steps) + 0.5) / (2 * steps)
    c, p = (x.ravel() for x in np.meshgrid(cosine, phi, indexing="ij"))
    return from_angles(c, p), (1 - low) * 2 * np.pi / len(c)


def eye(angle_deg, count):
    """(count, 3) one direction, turned a little off the tangents."""
    wo = from_angles(np.cos(np.radians([angle_deg])), np.array([0.7]))
    return np.repeat(wo, count, axis=0)


def reflected(model, angle_deg):
    """The part of light from everywhere, or of light from one side, that is reflected."""
    wi, solid = sphere()
    values = model.evaluate(wi, eye(angle_deg, len(wi)))
    return float((values * wi[:, 2]).sum() * solid)


@pytest.mark.parametrize("name", MODELS)
def test_light_may_go_both_ways(name):
    """Helmholtz: the value does not change when light and eye change places."""
    wi, wo = pairs()
    values = MODELS[name].evaluate(wi, wo)

    assert values.shape == (len(wi),)
    assert (values >= 0).all()
    assert values == pytest.approx(MODELS[name].evaluate(wo, wi), rel=1e-9, abs=1e-12)


def test_phong_as_printed_is_not_reciprocal():
    """Which its docstring says."""
    wi, wo = pairs()
    values, turned = Phong(1.0, 5.0).evaluate(wi, wo), Phong(1.0, 5.0).evaluate(wo, wi)
    assert not np.allclose(values, turned)


@pytest.mark.parametrize("name", MODELS)
def test_nothing_comes_from_below(name):
    """Light or eye under the surface: 0."""
    wi, wo = pairs(50)
    down = np.array([1, 1, -1.0])

    assert not MODELS[name].evaluate(wi * down, wo).any()
    assert not MODELS[name].evaluate(wi, wo * down).any()


@pytest.mark.parametrize("name", sorted(MODELS.keys() - MORE_THAN_ALL))
@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_no_more_is_reflected_than_comes(name, angle_deg):
    """White furnace: at most all of it."""
    assert reflected(MODELS[name], angle_deg) <= 1.003


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_what_claims_to_keep_all_light_does(angle_deg):
    """Lambert's and the energy-preserving Oren and Nayar's, of any roughness."""
    assert reflected(Lambert(), angle_deg) == pytest.approx(1, abs=1e-3)
    for roughness in (0.2, 1.0):
        model = EnergyPreservingOrenNayar(1.0, roughness)
        assert reflected(model, angle_deg) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("model", [ModifiedPhong(0.7, 30.0), BlinnPhong(0.7, 30.0)])
def test_highlights_by_powers_reflect_what_they_say(model):
    """At normal incidence, where nothing is cut off by the horizon."""
    assert reflected(model, 0) == pytest.approx(0.7, rel=0.01)


@pytest.mark.parametrize("alpha", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_facets_that_the_eye_sees_are_all_of_the_surface(alpha, angle_deg):
    """Weak white furnace (Heitz 2014, eq. 85): with the shadowing of the eye alone, and the
    directions below the horizon, all light is reflected by facets that mirror all.
    """
    wi, solid = sphere(400, upper=False)
    wo = eye(angle_deg, len(wi))
    h = half(wi, wo)
    for spread, g in (
        (GGX(alpha), shadows.smith_ggx(alpha)),
        (Beckmann(alpha), shadows.smith_beckmann(alpha)),
    ):
        total = (spread.density(h) * g.one(wo) / (4 * wo[:, 2])).sum() * solid
        assert total == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("spread", DISTRIBUTIONS, ids=str)
def test_facets_cover_the_surface(spread):
    """Each distribution, times the cosine, integrates to 1; samples have that density."""
    h, solid = sphere(500)
    assert (spread.density(h) * h[:, 2]).sum() * solid == pytest.approx(1, abs=0.01)

    found = spread.sample(np.random.default_rng(0).random((50_000, 2)))
    expected = (spread.density(h) * h[:, 2] ** 2).sum() * solid
    assert found[:, 2].mean() == pytest.approx(expected, abs=0.006)
    squares = [(spread.density(h) * h[:, 2] * h[:, k] ** 2).sum() * solid for k in range(2)]
    assert (found[:, :2] ** 2).mean(axis=0) == pytest.approx(squares, rel=0.06, abs=2e-3)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("angle_deg", [20.0, 65.0])
def test_samples_have_the_density_that_is_told(name, angle_deg):
    """The density integrates to 1, and samples fall into parts of the sphere as it says."""
    model = MODELS[name]
    wi, solid = sphere(240, upper=False)
    density = model.pdf(wi, eye(angle_deg, len(wi)))
    assert density.sum() * solid == pytest.approx(1, abs=0.02)

    count = 30_000
    found = model.sample(eye(angle_deg, count), np.random.default_rng(1).random((count, 3)))
    assert np.linalg.norm(found, axis=1) == pytest.approx(1)
    expected = np.bincount(part_of(wi), density * solid, 32)
    seen = np.bincount(part_of(found), minlength=32) / count
    assert seen[16:] == pytest.approx(expected[16:], abs=0.012)  # those above the surface


def part_of(w):
    """(n,) which of 4 belts times 8 sectors."""
    belt = np.clip(((w[:, 2] + 1) * 2).astype(int), 0, 3)
    sector = ((np.arctan2(w[:, 1], w[:, 0]) + np.pi) / (2 * np.pi) * 8).astype(int).clip(0, 7)
    return belt * 8 + sector


@pytest.mark.parametrize("name", ["eon", "blinn-phong", "lafortune", "ggx", "ward bounded"])
def test_sampling_by_importance_tells_the_same_integral(name):
    """The mean of value times cosine over density is what quadrature says."""
    model, wo = MODELS[name], eye(40.0, 60_000)
    wi = model.sample(wo, np.random.default_rng(3).random((len(wo), 3)))
    part = model.evaluate(wi, wo) * np.maximum(wi[:, 2], 0) / np.maximum(model.pdf(wi, wo), 1e-9)
    assert part.mean() == pytest.approx(reflected(model, 40.0), rel=0.02)


def test_rough_models_become_smooth_ones():
    """Limits: no roughness is Lambert's law; one slope in both directions is the isotropic form."""
    wi, wo = pairs()
    lambert = Lambert(0.6).evaluate(wi, wo)
    assert OrenNayar(0.6, 0.0).evaluate(wi, wo) == pytest.approx(lambert)
    assert EnergyPreservingOrenNayar(0.6, 0.0).evaluate(wi, wo) == pytest.approx(lambert)
    assert Phong(0.5, 0.0).evaluate(wi, wo) * wi[:, 2] == pytest.approx(0.5)
    h = half(wi, wo)
    assert AnisotropicGGX(0.3, 0.3).density(h) == pytest.approx(GGX(0.3).density(h))
    assert Blinn(0.1).density(h[h[:, 2] > 0.99]) == pytest.approx(
        Beckmann(0.1).density(h[h[:, 2] > 0.99]), rel=0.2, abs=0.05
    )
    lobes = Lafortune((Lobe(-1, -1, 1, 30.0, 32 / (2 * np.pi)),))
    phong = ModifiedPhong(1.0, 30.0).evaluate(wi, wo)
    assert lobes.evaluate(wi, wo) == pytest.approx(phong)


def test_values_of_oren_and_nayar_on_paper():
    """Light and eye along the normal: A over pi; opposite at 60 degrees: the same; one behind the
    other: A + B sin tan.
    """
    s2 = 0.25
    a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
    up = np.array([[0, 0, 1.0]])
    side = from_angles(np.array([0.5]), np.array([0.3]))
    model = OrenNayar(1.0, 0.5)
    assert model.evaluate(up, up) == pytest.approx(a / np.pi)
    assert model.evaluate(side, side * [-1, -1, 1]) == pytest.approx(a / np.pi)
    assert model.evaluate(side, side) == pytest.approx((a + b * 0.75 / 0.5) / np.pi)


def test_fresnel_on_paper():
    """Glass mirrors 4 % straight on and all at grazing; Brewster's angle; total reflection."""
    straight, grazing = np.array([1.0]), np.array([1e-6])
    glass = fresnels.Dielectric(1.5)
    assert fresnels.f0_of_ior(1.5) == pytest.approx(0.04)
    assert fresnels.ior_of_f0(0.04) == pytest.approx(1.5)
    for f in (glass, fresnels.Schlick(0.04), fresnels.CookTorrance(0.04)):
        assert f(straight) == pytest.approx(0.04)
        assert f(grazing) == pytest.approx(1, abs=1e-4)
    cosine = np.linspace(0.01, 1, 50)
    assert fresnels.CookTorrance(0.04)(cosine) == pytest.approx(glass(cosine))
    assert fresnels.Schlick(0.04)(cosine) == pytest.approx(glass(cosine), abs=0.04)
    brewster = np.cos(np.arctan([1.5]))
    across = ((brewster - 1.5 * np.sqrt(1 - (1 - brewster**2) / 2.25))
              / (brewster + 1.5 * np.sqrt(1 - (1 - brewster**2) / 2.25))) ** 2  # fmt: skip
    assert glass(brewster) == pytest.approx(across / 2)
    out = fresnels.Dielectric(1 / 1.5)
    assert out(np.cos(np.radians([41.0, 42.5]))) == pytest.approx(
        [out(np.cos(np.radians([41.0])))[0], 1]
    )
    assert fresnels.Conductor(1.5, 0.0)(cosine) == pytest.approx(glass(cosine))
    eta, k = np.array([0.143, 0.375, 1.442]), np.array([3.983, 2.386, 1.603])
    f0 = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    assert fresnels.Conductor(eta, k)(straight)[0] == pytest.approx(f0)


def test_shadowing_is_a_factor():
    """In 0..1 wherever the directions lie, and 1 straight on, but for the implicit forms."""
    wi, wo = pairs()
    h = half(wi, wo)
    up = np.array([[0, 0, 1.0]])
    for g in (
        shadows.implicit, shadows.neumann, shadows.cook_torrance, shadows.kelemen,
        shadows.smith_beckmann(0.5), shadows.smith_ggx(0.5), shadows.smith_ggx(0.5, 0.1, False),
        shadows.schlick_beckmann(0.5), shadows.schlick_ggx(0.5),
    ):  # fmt: skip
        values = g(wi, wo, h)
        assert (values >= 0).all()
        assert (values <= 1 + 1e-12).all()
        assert g(up, up, up) == pytest.approx(1)


def test_colors_go_through():
    """A color of three channels gives three values for each direction."""
    wi, wo = pairs(10)
    color, ggx = np.array([0.2, 0.5, 0.8]), (GGX(0.4), shadows.smith_ggx(0.4))
    for model in (
        Lambert(color),
        OrenNayar(color, 0.4, True),
        EnergyPreservingOrenNayar(color),
        ModifiedPhong(color),
        Ward(color),
        Microfacet(*ggx, fresnels.Schlick(color)),
    ):
        assert model.evaluate(wi, wo).shape == (10, 3)
    single = Lambert(0.5).evaluate(wi, wo)
    assert Lambert(color).evaluate(wi, wo)[:, 1] == pytest.approx(single)
