"""What light does at mirrors, gloss and glass, by Mitsuba and by our own models or on paper."""

from dataclasses import replace

import numpy as np
import pytest
from test_relight import AHEAD, LENS, UP, from_above, grid, lit, surface

from texproj.appearance.brdf.fresnel import Dielectric
from texproj.appearance.brdf.refraction import left_of, pane, refracted
from texproj.appearance.relight import (
    Environment,
    Illumination,
    Lamp,
    Lens,
    LitSurface,
    Sun,
    pictures_through,
    relit_pictures,
    traced_pictures,
)
from texproj.camera import Camera, Pose
from texproj.mesh import Mesh, NormalMap, TexturedMesh
from texproj.render.rays import CPURenderer
from texproj.tangent_frames import tangent_frames

GLASS = 1.5
ANGLES = np.radians([0, 20, 41, 43, 60, 80])


def directions(angles):
    """(n, 3) that far from the normal."""
    return np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])


def test_light_bends_as_snell_says():
    """And goes the same way back; out of glass not beyond 41.8 degrees."""
    below, goes = refracted(directions(ANGLES), GLASS)
    assert goes.all()
    np.testing.assert_allclose(-below[:, 0] * GLASS, np.sin(ANGLES))
    back, _ = refracted(-below, 1 / GLASS)
    np.testing.assert_allclose(back, -directions(ANGLES), atol=1e-12)
    assert refracted(directions(ANGLES), 1 / GLASS)[1].tolist() == [True] * 3 + [False] * 3
    assert (Dielectric(1 / GLASS)(np.cos(ANGLES))[3:] == 1).all()


def test_a_pane_keeps_light():
    """Clear glass mirrors 7.7 % of it straight on and lets the rest through; tinted glass takes
    away what Beer says, twice as thick squared.
    """
    mirrored, through = pane(np.cos(ANGLES), GLASS, 0.0, 1.0)
    np.testing.assert_allclose(mirrored + through, 1)
    assert mirrored[0] == pytest.approx(2 * 0.04 / 1.04)
    thin, thick = (left_of(1.0, np.array([0.2, 1.0]), np.array([d])) for d in (1.0, 2.0))
    np.testing.assert_allclose(thick, thin**2)


@pytest.fixture(scope="module")
def mi():
    mitsuba = pytest.importorskip("mitsuba", reason="pip install mitsuba, for the reference")
    if mitsuba.variant() is None:
        mitsuba.set_variant("scalar_rgb")
    return mitsuba


def seen(mi, scene, origin, target, samples=256):
    """Mean radiance of a narrow view."""
    frame = mi.ScalarTransform4f().look_at(origin=origin, target=target, up=[0, 1, 0.01])
    sensor = mi.load_dict({
        "type": "perspective", "fov": 0.2, "to_world": frame, "sampler": {"type": "independent"},
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
    })  # fmt: skip
    made = mi.load_dict({"type": "scene", "integrator": {"type": "volpath"}, **scene})
    return float(np.array(mi.render(made, sensor=sensor, spp=samples, seed=1)).mean())


def behind(mi):
    """A sky of radiance 1 below the level ground, dark above."""
    picture = np.zeros((64, 128, 3), np.float32)
    picture[32:] = 1
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture), "to_world": turn}


@pytest.mark.parametrize("tilt", [0, 60])
def test_a_tinted_pane(mi, tilt):
    """Fresnel at both sides, Beer in between, all that goes to and fro inside."""
    glass = {
        "type": "cube", "to_world": mi.ScalarTransform4f().scale([50, 50, 0.5]),
        "bsdf": {"type": "dielectric", "int_ior": GLASS, "ext_ior": 1.0},
        "interior": {
            "type": "homogeneous", "sigma_t": 0.7, "albedo": 0.0,
        },
    }  # fmt: skip
    toward = directions(np.radians([tilt]))[0]
    light = seen(mi, {"glass": glass, "sky": behind(mi)}, (4 * toward).tolist(), [0, 0, 0], 1024)
    through = pane(np.cos(np.radians([tilt])), GLASS, 0.7, 1.0)[1][0]
    assert light == pytest.approx(through, rel=0.02)


@pytest.mark.parametrize("tilt", [30, 41, 43, 60])
def test_total_reflection(mi, tilt):
    """Out of glass nothing is seen beyond the critical angle, before it what Fresnel leaves, denser
    by the square of the index."""
    water = {
        "type": "rectangle", "to_world": mi.ScalarTransform4f().scale([50, 50, 1]),
        "bsdf": {"type": "dielectric", "int_ior": 1.0, "ext_ior": GLASS},
    }  # fmt: skip
    toward = directions(np.radians([tilt]))[0]
    light = seen(mi, {"water": water, "sky": behind(mi)}, (4 * toward).tolist(), [0, 0, 0])
    mirrored = Dielectric(1 / GLASS)(np.cos(np.radians([tilt])))[0]
    assert light == pytest.approx((1 - mirrored) * GLASS**2, rel=0.02, abs=1e-6)


def painted(bump):
    """A level square of three paints, and a normal map that is one color."""
    vertices, faces = grid(1.0, 0.0, 2)
    uv = (vertices[:, :2] + 1) / 2
    page = np.full((64, 64, 3), (60, 60, 200), np.uint8)
    page[:32] = (200, 60, 60)
    page[:, :16] = (60, 200, 60)
    frames = tangent_frames(Mesh(vertices, faces), uv * (1, -1), faces)
    model = TexturedMesh(
        vertices, faces, uv, faces, np.zeros(len(faces), np.int32), (page,), None, None,
        NormalMap((np.tile(np.uint8(bump), (64, 64, 1)),), frames),
    )  # fmt: skip
    count = len(vertices)
    return LitSurface(model, np.full(count, 0.9, np.float32), np.zeros(count, np.float32))


def metal(roughness):
    made = surface((5.0, 0.0), roughness=roughness, base=0.8)
    return LitSurface(made.model, made.roughness, np.ones_like(made.roughness))


def traced(mi, shape, camera, samples=64, **lights):
    assert mi is not None
    return next(traced_pictures(shape, Illumination(**lights), [camera], samples=samples))


ASIDE = Camera(LENS, Pose.look_at((0.3, 0.4, 4.0), (0.1, 0.2, 0), (0, 1, 0)))


@pytest.mark.parametrize("bump", [(128, 128, 255), (180, 128, 240), (128, 180, 240)])
def test_our_pictures_are_those_of_the_path_tracer(mi, bump):
    """Textures and their normal maps the same way round, to 1 % in the mean, for suns and lamps."""
    for light in (
        {"suns": (Sun(np.array([0.6, 0, 0.8]), np.full(3, 1000.0)),)},
        {"lamps": (Lamp(np.array([0.5, 0.2, 1.0]), np.full(3, 500.0)),)},
    ):
        own, alpha = lit(painted(bump), camera=ASIDE, **light)
        other = traced(mi, painted(bump), ASIDE, **light)
        inside = (alpha > 0.99) & (other[..., 3] > 0.99)
        assert inside.sum() > 300
        np.testing.assert_allclose(
            own[inside].mean(axis=0), other[inside, :3].mean(axis=0), rtol=0.01
        )
        off = np.sqrt(np.square(own - other[..., :3])[inside].mean())
        assert off < 0.05 * own[inside].mean()


def test_a_mirror_and_a_glossy_plate(mi):
    """A smooth metal shows the sky, a rough one the lamp's highlight, as the path tracer has it."""
    sky = Environment(stripes(), UP, AHEAD)
    low = Camera(LENS, Pose.look_at((0.3, -3, 1.5), (0.1, 0.2, 0), (0, 0, 1)))
    own, _ = lit(metal(0.05), camera=low, environment=sky)
    other = traced(mi, metal(0.05), low, environment=sky)[..., :3]
    inner = np.abs(own - other)[8:]
    assert np.median(inner) < 0.03
    assert inner.mean() < 0.06
    lamp = {"lamps": (Lamp(np.array([0.3, 0.2, 2.0]), np.full(3, 500.0)),)}
    own, _ = lit(metal(0.4), camera=ASIDE, **lamp)
    other = traced(mi, metal(0.4), ASIDE, **lamp)[..., :3]
    bright = other > 0.1 * other.max()
    assert own.max() / other.max() == pytest.approx(1, rel=0.03)
    assert np.median(np.abs(own[bright] / other[bright] - 1)) < 0.03


def stripes():
    """(h, w, 3) a sky of soft colors."""
    around = np.linspace(0, 2 * np.pi, 128, endpoint=False)
    turn = 0.5 + 0.5 * np.cos(around[:, None] * (1, 2, 3) + (0, 1, 2))
    return np.broadcast_to(turn, (64, 128, 3)).astype(np.float32)


def test_the_blur_of_a_lens_is_that_of_the_path_tracer(mi):
    """A thin lens: an edge far behind its focus is as wide, one at the focus is sharp."""
    near = Lens(0.08, 4.0)
    spread = []
    for height in (0.0, -4.0):
        plate = surface((0.8, height))
        camera = from_above(4.0)
        light = {"suns": (Sun(UP, np.full(3, 1000.0)),)}
        own = next(pictures_through(near, CPURenderer(), plate, Illumination(**light), [camera]))
        other = next(traced_pictures(plate, Illumination(**light), [camera], near, 256))
        np.testing.assert_allclose(own[..., 3], other[..., 3], atol=0.15)
        spread.append(
            [float(((p > 0.05) & (p < 0.95)).sum()) for p in (own[..., 3], other[..., 3])]
        )
    (sharp, _), (blurred, theirs) = spread
    assert blurred > 1.5 * sharp
    assert blurred == pytest.approx(theirs, rel=0.25)


@pytest.mark.parametrize("pupil", [None, Lens(1e-3, 4.0)])
def test_a_bent_lens_bends_the_path_tracer(mi, pupil):
    """Distortion, and a middle off that of the picture: the outline of a plate lies where our own
    rays have it, and elsewhere without the distortion.
    """
    assert mi is not None
    bent = replace(LENS, fy=55.0, cx=21.0, dist=(0.8, 0.0, 0.02, 0.0, 0.0))
    light = Illumination(suns=(Sun(UP, np.full(3, 1000.0)),))
    plate = surface((1.15, 0.0))
    camera, straight = (replace(from_above(), intrinsics=k) for k in (bent, bent.pinhole))
    own = next(relit_pictures(CPURenderer(), plate, light, [camera]))[..., 3]
    other = next(traced_pictures(plate, light, [camera], pupil, 16))[..., 3]
    unbent = next(relit_pictures(CPURenderer(), plate, light, [straight]))[..., 3]
    off = np.abs(own - other).mean()
    assert off < 0.02
    assert off < np.abs(own - unbent).mean() / 4
