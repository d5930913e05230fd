"""The synthetic photographs are what they say they are: position, light, noise, truth."""

import io
from dataclasses import replace

import numpy as np
import pytest
import scenes
from PIL import Image, ImageOps
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from texproj.camera import Camera, Intrinsics, Pose
from texproj.creation import write_settings
from texproj.demo import lens, make_demo
from texproj.demo.jpeg import Exif, focal_px_of_exif, jpeg
from texproj.demo.lamps import DemoSize, light_settings
from texproj.demo.light import Lighting
from texproj.demo.make import true_colors
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import Pattern, painted, uniform
from texproj.demo.photographer import ShotOptions, photograph, set_up
from texproj.demo.picks import picked, visible
from texproj.demo.sensor import Sensor, developed
from texproj.demo.views import COMPACT, REFLEX, TOUR, View, camera_at, disturbed
from texproj.demo.write import write_demo, write_lit_demo
from texproj.formats.cameras import read_cameras
from texproj.formats.correspondences import read_correspondences
from texproj.formats.meshes import read_mesh
from texproj.formats.photos.header import read_photo_info
from texproj.formats.photos.read import read_photo
from texproj.mesh import Mesh, face_cross
from texproj.options import DemoOptions
from texproj.photo import linear_from_srgb
from texproj.project import Project

NO_NOISE = Sensor(full_well=0)
CLEAN = ShotOptions(background="wall", sensor=NO_NOISE, vignetting=0.0)
TINY = DemoOptions(photos=2, starts=True, paint=1, long_side=96, faces=3000, carved_faces=6000)


OVERCAST = Lighting(sun=(0.0, 0.0, 0.0), sky=(0.8, 0.82, 0.85), bounce=(0.3, 0.28, 0.25))
"""No sun, a bright sky: soft shadows only."""


def with_dots(base: Pattern, centers, radius: float) -> Pattern:
    """`base` with a soft white dot around each of the (k, 3) centers: a Gaussian of deviation
    `radius`, so that the dot's centroid in a picture is the center's image. Centers are farther
    apart than ten times that.
    """
    tree = cKDTree(centers)

    def dotted(xyz):
        color = base(xyz)
        distance = tree.query(xyz, distance_upper_bound=5 * radius)[0][:, None]
        share = np.exp(distance**2 / (-2 * radius**2)).astype(np.float32)
        return color + (1 - color) * share

    return dotted


@pytest.fixture(scope="module")
def table() -> Mesh:
    """A plate of 0.5 x 0.5 m at z = 1 over a floor of 6 x 6 m at z = 0."""
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    floor = np.c_[square * 3, np.zeros(4)]
    plate = np.c_[square / 4, np.ones(4)]
    quad = np.array([(0, 1, 2), (0, 2, 3)])
    return Mesh(np.r_[floor, plate], np.r_[quad, quad + 4].astype(np.int32))


@pytest.fixture(scope="module")
def from_above() -> Camera:
    """5 m above the floor, looking down; +x of the world is to the right in the picture."""
    pose = Pose.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0))
    return Camera(Intrinsics(200, 200, 200, 200, 100, 100), pose)


def color_at(shot, camera, xyz):
    (x, y), _ = camera.project([xyz])[0][0], None
    return shot.light[int(y), int(x)]


@pytest.mark.parametrize("body", [COMPACT, REFLEX])
def test_true_cameras_project_surface_points_on_their_pixels(table, body):
    """Small dots painted on the table's floor and plate have their centroids within 0.1 px of
    the projected points, all over the picture of a lens with distortion.
    """
    camera = Camera(body.intrinsics(480, 320), Pose.look_at((0.7, -3.4, 4.2), (0, -0.2, 0.2)))
    grid = np.mgrid[-1.6:1.7:0.4, -1.6:1.7:0.4].reshape(2, -1).T
    dots = np.r_[np.c_[grid, np.zeros(len(grid))], [(-0.1, 0.1, 1.0), (0.12, -0.13, 1.0)]]
    xy, _ = camera.project(dots)
    seen = camera.inside(xy - 12) & camera.inside(xy + 12) & visible_dots(dots, camera)
    scene = set_up(table, uniform(0.1), OVERCAST)
    painted_on = replace(scene, pattern=with_dots(uniform(0.1), dots[seen], 0.02))
    how = replace(CLEAN, samples=3)
    shine = photograph(painted_on, camera, how).light - photograph(scene, camera, how).light
    error = np.linalg.norm(centroids(shine.sum(2), xy[seen], 9), axis=1)
    assert len(error) > 40
    assert error.max() < 0.1
    assert np.median(error) < 0.03


def visible_dots(dots, camera):
    """Whether the plate (0.25 m to each side, at z = 1), with room for a dot, hides no dot."""
    t = (camera.center[2] - 1) / (camera.center[2] - dots[:, 2])
    crossing = camera.center + t[:, None] * (dots - camera.center)
    return (dots[:, 2] == 1) | (np.abs(crossing[:, :2]).max(1) > 0.33)


def centroids(image, xy, reach):
    """(n, 2) offset of the bright spot around each position from that position."""
    offsets = []
    for x, y in xy:
        rows = slice(int(y) - reach, int(y) + reach + 1)
        columns = slice(int(x) - reach, int(x) + reach + 1)
        spot = np.maximum(image[rows, columns], 0)
        v, u = np.mgrid[rows, columns] + 0.5
        offsets.append(((spot * u).sum() / spot.sum() - x, (spot * v).sum() / spot.sum() - y))
    return np.array(offsets)


def test_rays_agree_with_the_camera_noun():
    """The photographer's inversion of the lens model and texproj's own differ by < 1e-3 px."""
    for body in (COMPACT, REFLEX):
        k = body.intrinsics(960, 640)
        rays = lens.directions(k, 0.5, 0.5).astype(float)
        rows, columns = np.array([0, 17, 320, 639]), np.array([0, 901, 480, 959])
        ideal = rays[rows, columns, :2] / rays[rows, columns, 2:]
        pixels = k.distort(ideal) * (k.fx, k.fy) + (k.cx, k.cy)
        assert np.abs(pixels - np.c_[columns, rows] - 0.5).max() < 1e-3


def test_plate_hides_floor_where_geometry_says(table, from_above):
    """The plate's picture ends where its corners project; floor begins there."""
    scene = set_up(table, lambda p: np.where(p[:, 2:] > 0.5, 0.8, 0.2) + 0 * p, OVERCAST)
    light = photograph(scene, from_above, CLEAN).light[..., 1]
    # The plate's half width of 0.25 m at 4 m distance spans 12.5 px to each side of 100.
    row = light[100] > light.mean() * 2
    assert np.flatnonzero(row)[[0, -1]].tolist() == [87, 112]
    assert light[100, 87] == pytest.approx(light[100, [90, 80]].mean(), rel=0.1)


def test_cast_shadow_lies_where_geometry_says(table, from_above):
    """Sun from +x at 45 degrees: the plate's shadow is shifted by its height towards -x, and
    only sky light is left there; beside it sun and sky add up.
    """
    sun = Lighting(sun_azimuth_deg=0, sun_elevation_deg=45, sun_disk_deg=0)
    scene = set_up(table, uniform(0.5), sun)
    shot = photograph(scene, from_above, CLEAN)
    lit, dark = (color_at(shot, from_above, (x, 0.1, 0)) for x in (-1.5, -1.0))
    np.testing.assert_allclose(lit - dark, 0.5 * np.array(sun.sun) * np.sqrt(0.5), rtol=0.1)
    for x, inside in ((-1.22, True), (-0.78, True), (-1.28, False), (-0.72, False)):
        dim = color_at(shot, from_above, (x, 0.1, 0))[0] < (lit + dark)[0] / 2
        assert dim == inside


def test_noise_is_as_asked():
    """Shot and read noise have the asked deviation within 3 %, measured between two photos."""
    sensor = Sensor(full_well=4000, read_noise=0.004)
    for value in (0.05, 0.2, 0.6):
        light = np.full((300, 300, 3), value, np.float32)
        one, two = (
            linear_from_srgb(developed(light, sensor, np.random.default_rng(k)) / 255)
            for k in (1, 2)
        )
        asked = np.sqrt(value / 4000 + 0.004**2)
        assert (one - two).std() / np.sqrt(2) == pytest.approx(asked, rel=0.03)
        assert one.mean() == pytest.approx(value, rel=0.005)


def test_exposure_and_balance_scale_linear_light():
    """One step of exposure doubles the linear values, balance scales a channel."""
    light = np.full((8, 8, 3), 0.2, np.float32)
    rng = np.random.default_rng(0)
    sensor = Sensor(ev=1, balance=(1, 1, 0.5), full_well=0)
    out = linear_from_srgb(developed(light, sensor, rng) / 255)[0, 0]
    np.testing.assert_allclose(out, (0.4, 0.4, 0.2), rtol=0.01)


def test_vignetting_is_as_asked(table):
    """1 at the principal point, 1 - loss at half a diagonal, seen in the photo itself."""
    k = Intrinsics(301, 201, 300, 300, 150.5, 100.5)
    away = Camera(k, Pose.look_at((0, 0, 50), (0, 0, 100), up=(0, 1, 0)))
    scene = set_up(table, uniform(), OVERCAST)
    flat, fading = (
        linear_from_srgb(photograph(scene, away, replace(CLEAN, vignetting=v)).pixels / 255)
        for v in (0.0, 0.4)
    )
    ratio = (fading / flat).mean(2)
    assert ratio[100, 150] == pytest.approx(1, abs=0.01)
    assert ratio[0, 0] == pytest.approx(0.6, abs=0.015)
    assert ratio[:, 0] == pytest.approx(ratio[:, -1])


def test_defocus_keeps_light_and_removes_detail():
    """The blurred photo has the same mean and much less local contrast."""
    sharp, soft = (
        photograph(scenes.scene_of(), scenes.synthetic_pair().cameras[0],
                   replace(CLEAN, defocus_px=r)).light
        for r in (0.0, 4.0)
    )  # fmt: skip
    assert soft.mean() == pytest.approx(sharp.mean(), rel=0.01)
    assert np.abs(np.diff(soft, axis=1)).mean() < 0.6 * np.abs(np.diff(sharp, axis=1)).mean()


@pytest.mark.parametrize("kind", ["shrine", "stele", "capital"])
def test_pieces_are_closed_and_as_fine_as_asked(kind):
    """Every edge has two faces that run it in opposite directions, outside is outside, and no
    part hangs in the air.
    """
    mesh = carved(piece(kind, 2), 20_000)
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    forward = np.sort(edges[:, 0] * 2**32 + edges[:, 1])
    backward = np.sort(edges[:, 1] * 2**32 + edges[:, 0])
    np.testing.assert_array_equal(forward, backward)
    a = mesh.vertices[mesh.faces[:, 0]]
    assert np.einsum("ij,ij", a, face_cross(mesh.vertices, mesh.faces)) > 0
    assert 16_000 < len(mesh.faces) < 24_000
    joined = csr_matrix((np.ones(len(edges)), edges.T), (len(mesh.vertices),) * 2)
    assert connected_components(joined)[0] == 1


def test_seeds_make_other_objects():
    """Another seed moves the surface by centimetres."""
    one, two = piece("stele", 1), piece("stele", 2)
    points = carved(one, 5000).vertices.astype(np.float32)
    assert np.quantile(np.abs(two.field(points)), 0.9) > 0.01


def test_scan_noise_is_as_asked():
    """The scan is off the true surface by the asked deviation, within 20 %."""
    made = piece("stele", 0)
    scan = scanned(made, 40_000, 0.002, 1)
    exact = scanned(made, 40_000, 0.0, 1)
    off = np.linalg.norm(scan.vertices - exact.vertices, axis=1)
    assert np.sqrt((off**2).mean()) == pytest.approx(0.002, rel=0.2)


def test_picks_are_visible_and_as_noisy_as_asked():
    """Picks lie in the picture, on unhidden vertices, off by the asked deviation per axis."""
    pair = scenes.synthetic_pair()
    camera, rng = pair.cameras[0], np.random.default_rng(3)
    errors = []
    for _ in range(12):
        picks = picked(pair.mesh, camera, 14, 2.0, rng)
        assert len(picks) == 14
        errors.append(picks.xy_px - camera.project(picks.xyz_in_world)[0])
    assert np.std(errors) == pytest.approx(2.0, rel=0.15)
    assert pair.masks[0][tuple(picks.xy_px.astype(int).T[::-1])].mean() > 0.85 * 255


def test_starts_are_off_by_what_is_asked():
    """The mean displacement of the piece in a rough camera is the asked one within 3 %."""
    pair = scenes.synthetic_pair()
    points = pair.mesh.vertices[::50]
    before = pair.cameras[0].project(points)[0]
    for seed in range(4):
        rough = disturbed(pair.cameras[0], points, 40.0, np.random.default_rng(seed))
        moved = np.linalg.norm(rough.project(points)[0] - before, axis=1)
        assert moved.mean() == pytest.approx(40, rel=0.03)


def test_true_colors_are_what_the_photo_shows():
    """Light sent out by visible vertices is that of the clean photo's pixels: no bias beyond 2 %,
    single ones within the grain of the paint that a vertex meets and a pixel averages.
    """
    scene, scan = scenes.scene_of(), scenes.scan_of()
    albedo, sent = true_colors(scene, scan)
    camera = scenes.synthetic_pair().cameras[0]
    light = photograph(scene, camera, replace(CLEAN, samples=1)).light
    seen = np.flatnonzero(visible(scan, camera, least_cosine=0.5))
    x, y = camera.project(scan.vertices[seen])[0].T.astype(int)
    ratio = light[y, x] / sent[seen]
    assert np.median(ratio) == pytest.approx(1, abs=0.02)
    assert np.median(np.abs(ratio - 1)) < 0.08
    assert (albedo > 0).all()
    assert (albedo < 1).all()


def test_highlight_is_in_the_photos_and_not_in_the_truth():
    """Gloss brightens some pixels by much, and the true colors not at all."""
    camera = scenes.synthetic_pair().cameras[0]
    matte, glossy = scenes.scene_of(), replace(scenes.scene_of(), gloss=0.8)
    gain = photograph(glossy, camera, CLEAN).light - photograph(matte, camera, CLEAN).light
    assert gain.min() > -1e-6
    assert gain.max() > 0.2
    assert np.median(gain) < 0.02


def test_somebody_stands_in_front():
    """The visitor changes a part of the picture, and the mask leaves that part out."""
    scene, camera = scenes.scene_of(), scenes.synthetic_pair().cameras[0]
    empty, blocked = (photograph(scene, camera, replace(CLEAN, visitor=v)) for v in (False, True))
    changed = np.abs(empty.light - blocked.light).max(2) > 0.02
    assert 0.05 < changed.mean() < 0.4
    lost = (empty.object_mask > 0) & (blocked.object_mask == 0)
    assert lost.sum() > 500
    assert changed[lost].mean() > 0.9


def test_survey_coordinates_change_nothing():
    """The same photo, to a thousandth, with everything shifted by millions of metres."""
    place = np.array([4.5e6, 5.2e6, 300.0])
    mesh = scenes.scan_of()
    near = camera_at(View(20, 20), mesh.bounds, 160, np.random.default_rng(0))
    far = replace(near, pose=Pose(near.pose.R, near.pose.t - near.pose.R @ place))
    light = [
        photograph(set_up(Mesh(mesh.vertices + o, mesh.faces), painted(), Lighting(), origin=o),
                   camera, CLEAN).light
        for o, camera in ((np.zeros(3), near), (place, far))
    ]  # fmt: skip
    assert np.quantile(np.abs(light[0] - light[1]), 0.98) < 1e-3


def test_exif_tells_focal_length_exposure_and_orientation():
    """A turned camera stores the picture lying down; shown by its tag it stands again."""
    pixels = np.zeros((90, 60, 3), np.uint8)
    pixels[:10] = 200
    stored = Image.open(io.BytesIO(jpeg(pixels, Exif(REFLEX, 1.0, 3, turned=True))))
    assert stored.size == (90, 60)
    upright = np.asarray(ImageOps.exif_transpose(stored))
    assert upright.shape == pixels.shape
    assert upright[:8].mean() > 190
    assert upright[20:].mean() < 10
    inner = stored.getexif().get_ifd(0x8769)
    assert float(inner[0x829A]) == pytest.approx(2 / 250)
    truth = REFLEX.intrinsics(60, 90).fx
    assert focal_px_of_exif(REFLEX, 60, 90) == pytest.approx(truth, rel=0.02)


def test_demo_is_deterministic():
    """Equal options give equal bytes, another seed other ones."""
    one, two = make_demo(TINY), make_demo(TINY)
    assert [p.encoded for p in one.photos] == [p.encoded for p in two.photos]
    np.testing.assert_array_equal(one.mesh.vertices, two.mesh.vertices)
    np.testing.assert_array_equal(one.shaded, two.shaded)
    assert one.photos[0].encoded != make_demo(replace(TINY, seed=1)).photos[0].encoded


def test_demo_folder_reads_back(tmp_path):
    """The files hold the mesh, what is known in advance, and the truth beside it."""
    demo = write_demo(tmp_path, TINY)
    vertices, faces = read_mesh(tmp_path / "mesh/scan.ply")
    assert len(faces) == len(demo.mesh.faces)
    np.testing.assert_allclose(vertices, demo.mesh.vertices, atol=1e-6)
    assert [r.status for r in read_cameras(tmp_path / "cameras.json").records] == ["prior"]
    truth = read_cameras(tmp_path / "truth/cameras.json").records
    assert [r.file for r in truth] == ["IMG_0001.jpg", "IMG_0002.jpg"]
    picks = read_correspondences(tmp_path / "correspondences/IMG_0002.csv")
    error = picks.xy_px - truth[1].camera.project(picks.xyz_in_world)[0]
    assert 0.3 < np.sqrt((error**2).mean()) < 2
    assert (tmp_path / "truth/shaded.ply").is_file()


def test_photos_read_back_upright_with_what_exif_tells(tmp_path):
    """texproj's own reader finds the upright picture, the focal length within the rounding of
    EXIF's whole millimetres, and exposures that differ by the steps of the views.
    """
    demo = write_demo(tmp_path, TINY)
    infos = [read_photo_info(tmp_path / "photos" / p.file) for p in demo.photos]
    for info, photo in zip(infos, demo.photos, strict=True):
        shape = (photo.truth.height, photo.truth.width, 3)
        assert (info.height, info.width, 3) == shape
        assert read_photo(tmp_path / "photos" / info.name, info).pixels.shape == shape
        assert info.focal_px == pytest.approx(photo.truth.intrinsics.fx, rel=0.02)
    first, second = TOUR[:2]
    assert infos[0].camera_body != infos[1].camera_body
    steps = infos[0].exposure_ev - infos[1].exposure_ev
    assert steps == pytest.approx(first.ev - second.ev, abs=0.01)


@pytest.mark.parametrize("light", ["flash", "natural", "turntable"])
def test_pieces_in_a_light_that_is_to_be_found(light, tmp_path):
    """A project that `appearance` can start on: cameras that are true, the kind of light, and, of a
    flash, its place; photos of a piece, and its paint without light in truth/.
    """
    demo = write_lit_demo(tmp_path, light, DemoSize(2, 120, 3000, 12_000))
    write_settings(tmp_path, "scan.ply", light_settings(light))

    project = Project.open(tmp_path)
    assert project.settings.light.kind == light
    assert (project.settings.light.position is not None) == (light == "flash")
    records = project.load_cameras()
    assert [r.status for r in records.values()] == ["registered"] * 2
    for photo in demo.photos:
        pixels = project.load_photo(photo.file).linear()
        shown = pixels[photo.object_mask > 0]
        assert len(shown) > 500
        assert 0.03 < np.median(shown) < 0.6
        if light != "natural":
            assert np.median(pixels[photo.object_mask == 0]) < 0.01
    assert (tmp_path / "truth/albedo.ply").is_file()
