"""The recovered surface in other light: on paper where paper tells, and the command."""

import json

import cv2
import numpy as np
import OpenEXR
import pytest
from plyfile import PlyData, PlyElement

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.relight import (
    TONES,
    Development,
    Environment,
    Illumination,
    Lamp,
    Lens,
    LitSurface,
    Sun,
    exposure_of_ev,
    overcast,
    pictures_through,
    relit_pictures,
    traced,
)
from texproj.appearance.relight.environment import all_directions
from texproj.appearance.relight.split_sum import split_sum
from texproj.appearance.relight.thin_lens import falloff
from texproj.appearance.relight.tone import metered
from texproj.appearance.sun import spiral
from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli import main
from texproj.errors import InputError, UsageError
from texproj.formats.environments import read_environment
from texproj.formats.models import write_ply
from texproj.formats.models.read_values import read_values
from texproj.mesh import ColoredMesh
from texproj.photo import LUMINANCE, srgb_from_linear
from texproj.project import Project
from texproj.render.rays import CPURenderer
from texproj.report.pictures import Front
from texproj.stages import relighting
from texproj.stages.photographed_light import photographed
from texproj.stages.relighting import (
    RelightOptions,
    changed_since,
    illumination,
    recovered_surface,
)

UP, AHEAD = np.array([0.0, 0, 1]), np.array([0.0, 1, 0])
LENS = Intrinsics(48, 36, 60.0, 60.0, 24.0, 18.0)
BASE = 0.5
MIRRORED = 0.04
"""Of a dielectric, looked at and lit from straight ahead."""


def grid(size: float, z: float, cells: int = 8):
    """Vertices and faces of a level square, its outside up."""
    at = np.linspace(-size, size, cells + 1)
    x, y = np.meshgrid(at, at)
    n = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], 1), faces.astype(np.int32)


def surface(*squares, roughness=1.0, base=BASE):
    """Matte gray squares, (size, height) each."""
    vertices, faces = [], []
    for square in squares:
        v, f = grid(*square)
        faces.append(f + sum(map(len, vertices)))
        vertices.append(v)
    xyz = np.concatenate(vertices)
    gray = np.round(srgb_from_linear(np.full((len(xyz), 3), base)) * 65535).astype(np.uint16)
    model = ColoredMesh(xyz, np.concatenate(faces), gray)
    return LitSurface(model, np.full(len(xyz), roughness, np.float32), np.zeros(len(xyz), "f4"))


def from_above(height: float = 4.0) -> Camera:
    return Camera(LENS, Pose.look_at((0, 0, height), (0, 0, 0), (0, 1, 0)))


ABOVE = Front(np.array([0.0, 1, 0]), np.array([0.0, 0, 1]))


def lit(shape, *, camera=None, **lights):
    """(h, w, 3) luminance and (h, w) alpha."""
    found = relit_pictures(CPURenderer(), shape, Illumination(**lights), [camera or from_above()])
    picture = next(found)
    return picture[..., :3], picture[..., 3]


@pytest.mark.parametrize("tilt", [0, 60])
def test_a_sun_on_a_matte_plane(tilt):
    """Lambert's cosine; what is mirrored adds less than 2 % of the light where it is rough."""
    toward = np.array([np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
    light, alpha = lit(surface((5.0, 0.0)), suns=(Sun(toward, np.full(3, 1000.0)),))
    matte = BASE / np.pi * 1000 * np.cos(np.radians(tilt))
    assert alpha.min() == 1
    assert (light > matte).all()
    assert (light < matte * 1.04).all()


def test_a_lamp_twice_as_far_gives_a_quarter():
    at = {h: Lamp(np.array([0.0, 0, h]), np.full(3, 100.0)) for h in (2.0, 4.0)}
    near, far = (lit(surface((0.3, 0.0)), lamps=(at[h],))[0][18, 24, 0] for h in (2.0, 4.0))
    assert near / far == pytest.approx(4, rel=0.02)
    assert near == pytest.approx(BASE / np.pi * 25, rel=0.04)


def test_what_stands_between_casts_a_shadow_and_sends_light_on():
    """Below a small square it is dark but for what the ground and the square give each other."""
    sun = Sun(np.array([0.6, 0, 0.8]), np.full(3, 1000.0))
    camera = Camera(LENS, Pose.look_at((-3, 0, 1.5), (-0.75, 0, 0), (0, 0, 1)))
    shape = surface((5.0, 0.0), (0.5, 1.0))
    light, _ = lit(shape, camera=camera, suns=(sun,))
    shade, _ = camera.project(np.array([[-0.75, 0, 0]]))
    open_, _ = camera.project(np.array([[-0.75, 1.2, 0]]))
    at = [light[int(y), int(x), 0] for x, y in (*shade, *open_)]
    assert 0 < at[0] < 0.1 * at[1]


@pytest.mark.parametrize("roughness", [0.2, 0.6, 1.0])
def test_a_white_furnace_gives_back_no_more_than_it_sends(roughness):
    """Uniform light of 1 on a white plane: its matte part 1, and 2 to 5 % mirrored beside."""
    everywhere = Environment(np.ones((32, 64, 3), np.float32), UP, AHEAD)
    light, _ = lit(surface((5.0, 0.0), roughness=roughness, base=1.0), environment=everywhere)
    assert light.min() > 1.0
    assert light.max() < 1.06


def test_the_mirror_of_a_uniform_light_is_that_on_paper():
    """Of the roughest mirror, looked at from straight ahead, 1 - log 2: with alpha 1 the integral
    of D G F / (4 cos) over the hemisphere is closed.
    """
    scale, bias = split_sum(np.ones(1, np.float32), np.ones(1, np.float32))
    assert scale[0] + bias[0] == pytest.approx(1 - np.log(2), abs=0.005)
    smooth, _ = split_sum(np.ones(1, np.float32), np.zeros(1, np.float32))
    assert smooth[0] == pytest.approx(1, abs=0.01)
    _, grazing = split_sum(np.zeros(1, np.float32), np.zeros(1, np.float32))
    assert grazing[0] > 0.85


def test_an_overcast_sky_lights_level_ground_by_its_illuminance():
    """And upright walls by less than half, as photographers know."""
    sky = overcast(UP, AHEAD, 10_000.0)
    light, _ = lit(surface((5.0, 0.0)), environment=sky)
    assert np.median(light) == pytest.approx(BASE / np.pi * 10_000, rel=0.06)


def test_a_polished_plane_mirrors_its_surroundings():
    """The sky is red on the right and blue on the left: so is the mirror, seen from the middle."""
    local, _ = all_directions(64, 32)
    red = (local[..., :1] > 0) * np.array([1.0, 0, 0], np.float32)
    blue = (local[..., :1] <= 0) * np.array([0, 0, 1.0], np.float32)
    sky = Environment((red + blue).astype(np.float32), UP, AHEAD)
    light, _ = lit(surface((5.0, 0.0), roughness=0.1, base=0.0), environment=sky)
    right, left = light[18, 40], light[18, 8]
    assert right[0] == pytest.approx(MIRRORED, rel=0.3)
    assert left[2] == pytest.approx(MIRRORED, rel=0.3)
    assert max(right[2], left[0]) < 0.01


def test_the_sun_of_a_picture_is_a_sun():
    """Its direction to half a degree, its light to a percent; the rest is left as it was."""
    local, solid = all_directions(512, 256)
    toward = np.array([0.4, 0.6, np.sqrt(1 - 0.52)])
    disk = local @ toward > np.cos(np.radians(1.0))
    picture = np.full((256, 512, 3), 0.3, np.float32)
    picture[disk] += 50_000
    power = float((solid * disk).sum() * 50_000)
    rest, direction, light = Environment(picture, UP, AHEAD).parted()
    right = np.cross(AHEAD, UP)
    assert direction @ (toward[0] * right + toward[1] * UP + toward[2] * AHEAD) > 0.99996
    assert light[1] == pytest.approx(power, rel=0.01)
    assert np.allclose(rest.radiance, 0.3)
    assert Environment(np.full((32, 64, 3), 0.3, np.float32), UP, AHEAD).parted()[1] is None


@pytest.mark.parametrize("tone", TONES)
def test_curves_keep_the_order_of_light(tone):
    ramp = np.linspace(0, 12, 400)
    shown = TONES[tone](ramp)
    assert abs(shown[0]) < 1e-6
    assert (np.diff(shown) > 0).all()


def test_exposure():
    """EV 15 shows 36 000 cd/m2, a sunlit white, just below white; a meter finds the mean."""
    assert 36_000 * exposure_of_ev(15) == pytest.approx(0.92, abs=0.01)
    gray = np.dstack([np.full((4, 4, 3), 200.0), np.ones((4, 4))]).astype(np.float32)
    assert 200 * metered(gray) == pytest.approx(0.18)
    assert metered(np.zeros((4, 4, 4), np.float32)) == 1
    shown = Development(metered(gray), "none").developed(gray)
    assert shown[0, 0].tolist() == [118, 118, 118, 255]


def test_environments_are_read_or_refused(tmp_path):
    picture = np.random.default_rng(0).uniform(0.1, 90, (16, 32, 3)).astype(np.float32)
    assert cv2.imwrite(str(tmp_path / "sky.hdr"), picture[..., ::-1])
    assert np.allclose(read_environment(tmp_path / "sky.hdr"), picture, rtol=0, atol=0.5)
    cv2.imwrite(str(tmp_path / "square.hdr"), picture[:, :16])
    cv2.imwrite(str(tmp_path / "point.hdr"), picture[:1, :1])
    cv2.imwrite(str(tmp_path / "long.hdr"), np.ones((2, 4100, 3), np.float32))
    half = {"compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(half, {"RGB": picture.astype(np.float16)}).write(str(tmp_path / "sky.exr"))
    assert np.allclose(read_environment(tmp_path / "sky.exr"), picture, rtol=1e-3, atol=0)
    for kind in ("hdr", "exr"):
        (tmp_path / f"broken.{kind}").write_bytes((tmp_path / f"sky.{kind}").read_bytes()[:60])
    for name in (
        "square.hdr",
        "point.hdr",
        "long.hdr",
        "broken.hdr",
        "none.hdr",
        "broken.exr",
        "none.exr",
    ):
        with pytest.raises(InputError, match=name):
            read_environment(tmp_path / name)


def test_without_a_recovered_surface_it_says_what_to_do(project_folder, capsys):
    assert main(["relight", str(project_folder)]) == 2
    assert "run `texproj appearance" in capsys.readouterr().err
    for wrong in ("--sun 85", "--sun x,1", "--lamp 1,2", "--lamp 1,2,0", "--ev 99", "--kelvin 90",
                  "--photo a --film gif", "--lens 0.1", "--kelvin 2700"):  # fmt: skip
        assert main(["relight", str(project_folder), *wrong.split()]) == 2


@pytest.mark.parametrize(
    ("sky", "said"), [("Overcast", "did you mean 'overcast'"), ("", "known: none, overcast")]
)
def test_a_sky_that_nobody_knows_is_named(sky, said):
    with pytest.raises(UsageError, match=said):
        illumination(None, RelightOptions(sky=sky), None, Front(UP, AHEAD))


def appeared(project_folder, light):
    """A project that seems to have been through `appearance`, with another light.json."""
    project = Project.open(project_folder)
    project.out.mkdir(exist_ok=True)
    (project.out / "light.json").write_text(light)
    return project


SKY = [[1.0, 1, 1]] + [[0.0, 0, 0]] * 8


@pytest.mark.parametrize(
    "light",
    [
        {"sky": SKY, "sun": [1, 0], "sun_irradiance": [1, 1, 1]},
        {"sky": SKY, "sun": [float("nan"), 0, 0], "sun_irradiance": [1, 1, 1]},
        {"sky": SKY, "sun": [0, 0, 0], "sun_irradiance": [1, 1, 1]},
        {"sky": SKY, "sun": [0, 0, 1], "sun_irradiance": None},
        {"sky": [[float("inf")] * 3] * 9, "sun": None},
        [],
    ],
)
def test_a_light_that_cannot_be_is_none(project_folder, light):
    with pytest.raises(InputError, match=r"light\.json tells of no sky"):
        photographed(appeared(project_folder, json.dumps(light)))


def test_a_sky_without_a_sun(project_folder):
    light = {"sky": SKY, "sun": None}
    found = photographed(appeared(project_folder, json.dumps(light)))
    assert found.sky.tolist() == SKY
    assert found.sun is None


def test_the_photographed_light_lights_as_it_was_found(project_folder):
    """A sky that is bright and blue above, of red light low on one side: its harmonics ring below 0
    elsewhere, and yet surfaces of all directions get the light and the tint that was found, within
    4 % of the brightest; and a white one shows it as the photos did.
    """
    above, side = spiral(4000)[:, 2:] > 0.7, spiral(4000)[:, :1] > 0.8
    radiance = above * np.array([0.5, 0.7, 1.0]) + side * np.array([1.5, 0.8, 0.4]) + 0.02
    sky = basis(spiral(4000)).T @ radiance * (4 * np.pi / 4000)
    told = appeared(project_folder, json.dumps({"sky": sky.tolist(), "sun": None}))
    found = photographed(told)
    wanted = basis(spiral(60)) * OPEN_GAINS @ sky
    assert (basis(spiral(60)) @ sky).min() < -0.1 * wanted.max() / np.pi

    picture = found.shown(UP, AHEAD)[0]
    local, solid = all_directions(64, 32)
    world = local.reshape(-1, 3) @ np.stack([np.cross(AHEAD, UP), UP, AHEAD])
    arriving = np.maximum(spiral(60) @ world.T, 0) * solid.ravel()
    light = arriving @ picture.radiance.reshape(-1, 3) / found.lux

    assert picture.radiance.min() >= 0
    assert np.abs(light - wanted).max() < 0.04 * wanted.max()
    assert found.lux * (light @ LUMINANCE).max() == pytest.approx(12_000, rel=0.05)


@pytest.mark.parametrize("sky", ["none", "dark.hdr"])
def test_no_light_shows_nothing(project_folder, sky):
    """A black picture would look as if it had worked."""
    dark = str(project_folder / sky) if sky != "none" else sky
    cv2.imwrite(str(project_folder / "dark.hdr"), np.zeros((16, 32, 3), np.float32))
    options = RelightOptions(sky=dark)
    with pytest.raises(UsageError, match="there is no light: the sky is"):
        illumination(Project.open(project_folder), options, surface((1.0, 0.0)), ABOVE)


def test_another_mesh_than_the_recovered_one_is_refused(project_folder):
    """The picture would be empty, or show one thing from where another was photographed."""
    project = Project.open(project_folder)
    rest = {"outputs": {}, "used": [], "failed": {}, "light": {}}
    project.save_record("appearance", None, {"inputs": {"mesh": "another"}, **rest})
    with pytest.raises(InputError, match="has changed since its surface was recovered"):
        changed_since(project)
    now = {"mesh": project.hash_of(project.mesh_path)}
    project.save_record("appearance", None, {"inputs": now, **rest})
    assert changed_since(project)[0].startswith("the surface was recovered before: ")


def test_values_that_cannot_be_are_refused(tmp_path):
    values = np.array([(0.5,), (np.nan,)], [("roughness", "f4")])
    PlyData([PlyElement.describe(values, "vertex")]).write(tmp_path / "a.ply")
    with pytest.raises(InputError, match=r"a\.ply: roughness is not between 0 and 1"):
        read_values(tmp_path / "a.ply", ["roughness"])


def test_a_lens_blurs_what_is_not_in_focus():
    """The edge of a plate as far behind the focus as this before the eye: as wide as the pupil is
    large there; none at the focus. Corners are as dark as the cosine to the fourth says.
    """
    camera, sun = from_above(4.0), Illumination(suns=(Sun(UP, np.full(3, 1000.0)),))
    lens = Lens.of(camera, 2.8, 0.01, 4.0)
    assert lens.radius == pytest.approx(36 * 60 / 48 / 2.8 / 2 / 10)
    wide = {}
    for height in (0.0, -4.0):
        plate = surface((0.6, height))
        layers = next(pictures_through(Lens(0.2, 4.0), CPURenderer(), plate, sun, [camera]))
        wide[height] = np.count_nonzero((layers[18, :, 3] > 0.02) & (layers[18, :, 3] < 0.98)) / 2
    assert wide[0.0] <= 2
    # the pupil, .4 wide, seen from the focus as an angle of .1: half of it at the plate's distance
    assert wide[-4.0] == pytest.approx(60 * 0.4 * (1 / 4 - 1 / 8), abs=2)
    corner = np.hypot(24 - 0.5, 18 - 0.5) / 60
    assert falloff(camera)[0, 0] == pytest.approx(np.cos(np.arctan(corner)) ** 4, rel=1e-6)
    assert falloff(camera)[18, 24] == pytest.approx(1, abs=1e-3)


def test_without_a_path_tracer_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(traced, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match="pip install mitsuba"):
        traced.check_tracer()


@pytest.fixture
def recovered(project_folder):
    """A project that seems to have been through `appearance --to texture`."""
    project = appeared(project_folder, "{}")
    mesh = project.load_mesh().mesh
    count = len(mesh.vertices)
    values = {name: np.full(count, 0.5, np.float32) for name in ("roughness", "metallic")}
    gray = np.full((count, 3), 128, np.uint8)
    write_ply(project.out / "appearance.ply", mesh.vertices, mesh.faces, gray, None, (), values)
    (project.out / "model.glb").write_bytes(b"glTF damaged")
    record = {"inputs": {}, "used": [], "failed": {}, "light": {}}
    outputs = {"appearance.ply": "", "model.glb": "of another file"}
    project.save_record("appearance", None, {**record, "outputs": outputs})
    return project


def test_a_mesh_with_a_vertex_nowhere_is_shown(recovered):
    """A scan may have one; the picture was empty by it."""
    path = recovered.out / "appearance.ply"
    told = PlyData.read(path)
    spare = told["vertex"].data[:1].copy()
    spare["x"] = np.nan
    rows = np.concatenate([told["vertex"].data, spare])
    PlyData([PlyElement.describe(rows, "vertex"), told["face"]], byte_order="<").write(path)
    (recovered.out / "model.glb").unlink()
    recovered.save_record("appearance", None, {**recovered.load_record("appearance"),
                                               "outputs": {"appearance.ply": "a"}})  # fmt: skip
    assert np.isfinite(recovered_surface(recovered).mesh.vertices).all()


def test_a_picture_that_no_light_reaches_is_refused(recovered, monkeypatch, capsys):
    """Of a lamp inside the piece, say: black would look as if it had worked."""
    black = np.broadcast_to(np.float32((0, 0, 0, 1)), (32, 32, 4))
    monkeypatch.setattr(relighting, "_pictures", lambda *_: [black])
    (recovered.out / "model.glb").unlink()
    told = recovered.load_record("appearance")
    now = {"inputs": {"mesh": recovered.hash_of(recovered.mesh_path)}}
    recovered.save_record("appearance", None, {**told, **now, "outputs": {"appearance.ply": ""}})
    assert main(["relight", str(recovered.root)]) == 2
    assert "no light reaches what is seen of the piece" in capsys.readouterr().err
    assert not (recovered.out / "relit.png").exists()


def test_a_damaged_texture_is_refused(recovered):
    """It is what was asked for; vertices in its place would look like it."""
    with pytest.raises(InputError, match=r"model\.glb is not what `texproj appearance` wrote"):
        recovered_surface(recovered)


def test_the_vertices_are_shown_where_color_wrote_its_own_texture(recovered):
    """Which is meant to lie there."""
    made = {"model.glb": recovered.hash_of(recovered.out / "model.glb")}
    rest = {"inputs": {}, "used": [], "failed": {}, "quality": {}, "occluders": {}}
    recovered.save_record("color", None, {**rest, "outputs": made})
    assert isinstance(recovered_surface(recovered).model, ColoredMesh)
