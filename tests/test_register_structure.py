"""Structure matching on small carved pieces whose photos come from an independent ray caster."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from texproj.camera import Camera, Pose
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import StructureOptions
from texproj.photo import Photo, PhotoInfo
from texproj.register.structure.crop import Window
from texproj.register.structure.mirror import mirrored_camera
from texproj.register.structure.register import register_structure
from texproj.register.structure.solve import CHECK, NEAR
from texproj.register.structure.starts import placed_pose
from texproj.register.structure.verdict import verify
from texproj.register.structure.view import StructureView
from texproj.render import ambient_occlusion
from texproj.render.rays import CPURenderer
from texproj.solve.placement import Placement

SIZE = (384, 256)


def relief(seed: int) -> Mesh:
    """A wall 12 x 8, its front at z = 0, with boxes standing out toward -z, finely meshed."""
    import trimesh

    rng = np.random.default_rng(seed)
    boxes = [trimesh.creation.box(bounds=[(-6, -4, 0), (6, 4, 1)])]
    for _ in range(45):
        x, y = rng.uniform(-6, 5), rng.uniform(-4, 3.2)
        w, h, out = rng.uniform(0.3, 2.0), rng.uniform(0.3, 2.0), rng.uniform(0.2, 1.2)
        boxes.append(trimesh.creation.box(bounds=[(x, y, -out), (x + w, y + h, 0.1)]))
    solid = trimesh.util.concatenate(boxes)
    v, f = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, 0.5)
    return Mesh(v, f)


class Wall:
    """A relief, its renderer, a camera, and a photo of it: sunlit with cast shadows, painted,
    gamma-encoded and noisy, from face normals, none of which the registration sees."""

    def __init__(self, seed: int) -> None:
        import trimesh

        self.mesh = relief(seed)
        self.scene = CPURenderer().load(self.mesh, ambient_occlusion(self.mesh, 32))
        self.camera = camera()
        self.solid = trimesh.Trimesh(self.mesh.vertices, self.mesh.faces, process=False)

    def render(self, camera: Camera):
        return self.scene.gbuffer(camera, ("depth", "normal", "ao", "front"))

    def photo(self, camera: Camera, seed: int = 0) -> Photo:
        y, x = np.mgrid[: camera.height, : camera.width] + 0.5
        origins, rays = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1))
        hit, ray, face = self.solid.ray.intersects_location(origins, rays, multiple_hits=False)
        normal, sun = self.solid.face_normals[face], np.array([0.4, -0.5, -0.77])
        shadow = self.solid.ray.intersects_any(hit + 1e-3 * normal, np.tile(sun, (len(hit), 1)))
        light = 0.25 + np.clip(normal @ sun, 0, 1) * ~shadow
        paint = 0.4 + 0.1 * np.sin(7 * hit[:, 0] + 3 * hit[:, 1]) * np.sin(5 * hit[:, 1])
        image = np.full(camera.height * camera.width, 0.7)
        image[ray] = paint * light
        rng = np.random.default_rng(seed)
        encoded = 255 * image ** (1 / 2.2) + rng.normal(0, 3, image.shape)
        gray = np.clip(encoded, 0, 255).astype(np.uint8).reshape(camera.height, camera.width)
        return Photo(PhotoInfo("wall.jpg", 4 * SIZE[0], 4 * SIZE[1]), np.dstack([gray] * 3))


def camera(dist=(0.0,) * 5) -> Camera:
    """Full size four times the photo's; the wall fills most of the picture."""
    from texproj.camera import Intrinsics

    k = Intrinsics(4 * SIZE[0], 4 * SIZE[1], 1600, 1600, 790, 500, dist)
    return Camera(k, Pose.look_at((1.5, -2, -11), (0, 0, 0), up=(0, -1, 0)))


@pytest.fixture(scope="module")
def wall() -> Wall:
    return Wall(1)


@pytest.fixture(scope="module")
def photo(wall) -> Photo:
    return wall.photo(wall.camera.resized(*SIZE))


def moved(camera: Camera, turn_deg=(0.0, 0.0, 0.0), step=(0.0, 0.0, 0.0)) -> Camera:
    return replace(camera, pose=camera.pose.step([*np.radians(turn_deg), *step]))


def error_percent(wall: Wall, found: Camera, true: Camera) -> float:
    """Mean image distance of the wall's vertices in the picture, percent of the width."""
    points = wall.mesh.vertices
    inside = true.inside(true.project(points)[0])
    gap = found.project(points[inside])[0] - true.project(points[inside])[0]
    return float(100 * np.linalg.norm(gap, axis=1).mean() / true.width)


START = {"turn_deg": (3.0, -6.0, 8.0), "step": (0.3, -0.2, 1.5)}


def test_rough_start_is_made_exact(wall, photo):
    """A start off by more than 10 % of the width in turn, roll and depth becomes exact to 0.3 %,
    which full-size noise of 3 gray levels does not make zero."""
    start = moved(wall.camera, **START)
    assert error_percent(wall, start, wall.camera) > 10

    fit = register_structure(photo, start, wall.render)

    error = error_percent(wall, fit.camera, wall.camera)
    assert fit.accepted, fit.reason
    assert fit.solved == ("rotation", "translation", "focal")
    assert 0.001 < error < 0.3
    assert error < 3 * 100 * fit.expected_error_px / wall.camera.width < 3 * 0.5
    assert (fit.camera.width, fit.camera.height) == (wall.camera.width, wall.camera.height)


def test_same_input_same_camera(wall, photo):
    """Nothing is left to chance: two runs give the same bits."""
    start = moved(wall.camera, (1, 1, 0))

    a, b = (register_structure(photo, start, wall.render).camera for _ in range(2))

    assert (a.pose.t == b.pose.t).all()


def test_wrong_focal_length_is_solved(wall, photo):
    """A focal length 6 % too long is brought near, and the picture fits to 0.3 %."""
    k = wall.camera.intrinsics
    start = replace(
        moved(wall.camera, (1, -1, 2)), intrinsics=replace(k, fx=1.06 * k.fx, fy=1.06 * k.fy)
    )

    fit = register_structure(photo, start, wall.render)

    assert fit.accepted, fit.reason
    assert abs(fit.camera.intrinsics.fx / k.fx - 1) < 0.04
    assert error_percent(wall, fit.camera, wall.camera) < 0.3


def test_lens_of_the_start_is_honored(wall):
    """With barrel distortion known, the camera is as exact as without any."""
    bent = camera(dist=(-0.15, 0.03, 0.0, 0.0, 0.0))

    fit = register_structure(wall.photo(bent.resized(*SIZE)), moved(bent, **START), wall.render)

    assert fit.accepted, fit.reason
    assert error_percent(wall, fit.camera, bent) < 0.3


def test_unknown_distortion_is_solved(wall):
    """A barrel distortion that the start does not know is found, and found to be there."""
    bent, known = camera(dist=(-0.25, 0, 0, 0, 0)), StructureOptions(k1_sigma=0)
    photo = wall.photo(bent.resized(*SIZE))
    start = moved(wall.camera, (1, -1, 2))

    fit = register_structure(photo, start, wall.render)
    plain = register_structure(photo, start, wall.render, known)

    assert fit.solved == ("rotation", "translation", "focal", "k1")
    assert -0.35 < fit.camera.intrinsics.dist[0] < -0.15
    assert error_percent(wall, fit.camera, bent) < 0.4 < error_percent(wall, plain.camera, bent)


def test_photo_of_something_else_is_refused(wall):
    """A photo of another wall is refused with a way out, whatever camera comes out."""
    other = Wall(2)
    strange = other.photo(other.camera.resized(*SIZE))

    with pytest.raises(RegistrationError, match="pick 8 points") as refused:
        fit = register_structure(strange, moved(wall.camera, (1, 1, 0)), wall.render)
        assert not fit.accepted
        raise RegistrationError(fit.reason)

    assert refused.value


def test_mirrored_photo_of_a_symmetric_wall_is_refused():
    """A wall that is nearly its own mirror image, its photo printed the wrong way round."""
    wall = Wall(3)
    v, f = wall.mesh.vertices, wall.mesh.faces
    keep = (v[f].mean(axis=1)[:, 0] < 0) | (v[f].mean(axis=1)[:, 0] > 4.2)
    left = f[v[f].mean(axis=1)[:, 0] < 0]
    both = Mesh(
        np.concatenate([v, v * (-1, 1, 1)]),
        np.concatenate([f[keep], left[:, ::-1] + len(v)]),
    )
    import trimesh

    wall.mesh, wall.scene = both, CPURenderer().load(both, ambient_occlusion(both, 32))
    wall.solid = trimesh.Trimesh(both.vertices, both.faces, process=False)
    front = replace(wall.camera, pose=Pose.look_at((0.5, -1, -11), (0.3, 0, 0), up=(0, -1, 0)))
    right = wall.photo(front.resized(*SIZE))
    wrong = replace(right, pixels=np.ascontiguousarray(right.pixels[:, ::-1]))

    assert register_structure(right, moved(front, (1, 0, 0)), wall.render).accepted
    fit = register_structure(wrong, moved(front, (1, 0, 0)), wall.render, wider=False)

    assert not fit.accepted
    assert "left and right exchanged" in fit.reason


def test_masked_pixels_are_not_used(wall, photo):
    """What a stencil hides has no influence at all: any content there gives the same camera."""
    mask = np.full(SIZE[::-1], 255, np.uint8)
    mask[:, 250:] = 0
    start = moved(wall.camera, (1, -1, 2))
    spoiled = photo.pixels.copy()
    spoiled[:, 250:] = np.random.default_rng(0).integers(0, 255, spoiled[:, 250:].shape)

    cameras = [
        register_structure(replace(photo, pixels=p, mask=mask), start, wall.render).camera
        for p in (photo.pixels, spoiled)
    ]

    assert (cameras[0].pose.t == cameras[1].pose.t).all()
    assert error_percent(wall, cameras[0], wall.camera) < 0.4


def test_start_that_sees_nothing_is_an_error(wall, photo):
    """A start that looks the other way gives an error that says what to do."""
    away = moved(wall.camera, (0, 180, 0))

    with pytest.raises(RegistrationError, match=r"wall\.jpg: .*pick 8 points"):
        register_structure(photo, away, wall.render)


def test_verify_knows_right_from_wrong(wall, photo):
    """The true camera is believed; one whose picture is off by 4 % of the width is not."""
    wrong = moved(wall.camera, (0, 2.2, 0))
    assert 3 < error_percent(wall, wrong, wall.camera) < 5

    right, bad = (verify(photo, c, wall.render) for c in (wall.camera, wrong))

    assert right.registered
    assert not bad.registered
    assert "pick 8 points" in bad.reason
    assert bad.support < 0.2 < right.support


def test_large_claimed_error_is_refused(wall, photo):
    """A camera is refused if its expected error exceeds what the options allow."""
    strict = StructureOptions(max_error_percent=0.001)

    fit = register_structure(photo, moved(wall.camera, (1, 0, 0)), wall.render, strict, wider=False)

    assert not fit.accepted
    assert "expected error" in fit.reason


def test_placement_becomes_a_camera():
    """Roll, enlargement and shift of a far, small surface are what the placed camera shows."""
    here = camera()
    pivot = np.array([700.0, 600.0])
    corners = np.array([(0, 0), (8, 0), (0, 8)])
    points = here.unproject(pivot + corners, [100.0] * 3)
    placement = Placement(1.0, np.radians(20), 1.25, (60.0, -30.0))

    there = replace(here, pose=placed_pose(here, placement, pivot, 100.0))

    seen = there.project(points)[0] - pivot - (60, -30)
    c, s = 10 * np.cos(np.radians(20)), 10 * np.sin(np.radians(20))
    # turning toward the shifted pivot foreshortens by the square of the off-axis angle: ~1 %
    assert np.allclose(seen, [(0, 0), (c, s), (-s, c)], atol=0.3)
    assert np.linalg.norm(seen[0]) < 1e-6


def test_mirrored_camera_sees_the_mirror_image():
    """Points symmetric about the upright plane through the middle swap sides in the picture."""
    here = camera()
    middle = np.array([0.3, 0.2, 12.0])
    facing = np.array([0.2, 0.0, -1.0])
    across = np.cross(facing, (0, 1, 0))
    across /= np.linalg.norm(across)
    offset = np.array([[1.0, 0.5, 0.2], [-0.7, 0.1, 0.4]])
    twin = offset - 2 * np.outer(offset @ across, across)
    world = here.pose.inverse

    there = mirrored_camera(here, middle, facing)

    seen = here.project(world.apply(middle + offset))[0]
    swapped = there.project(world.apply(middle + twin))[0]
    assert np.allclose(swapped, [here.width, 0] + seen * (-1, 1), atol=1e-6)
    assert np.linalg.det(there.pose.R) == pytest.approx(1)


def test_window_camera_sees_the_same_points():
    """A camera cut to a window and enlarged sees each point where the window shows it; back again
    it is the camera it was."""
    whole = camera(dist=(-0.1, 0.0, 0.0, 0.0, 0.0))
    window = Window(100, 60, 800, 400, whole.width, whole.height)
    point = whole.unproject([[500, 300]], 9.0)

    part = window.camera_of(whole, 400, 200)

    assert part.project(point)[0] == pytest.approx(np.array([[200, 120]]))
    assert window.full_camera(part).project(point)[0] == pytest.approx(np.array([[500, 300]]))
    assert window.mirrored.x == whole.width - 900


def test_window_is_cut_at_whole_pixels():
    """The window of a reduced photo is that of the pixels it really holds."""
    pixels = np.zeros((50, 100, 3), np.uint8)
    pixels[20:30, 40:60] = 255
    photo = Photo(PhotoInfo("a.png", 400, 200), pixels)
    seen = cv2.resize(pixels[..., 0], (25, 13), interpolation=cv2.INTER_AREA) > 128

    window, part = Window.around(seen, 0.0, 400, 200).cut(photo)

    assert part.pixels.shape[1] * 4 == window.width
    assert window.x % 4 == 0
    assert (part.pixels == 255).all(axis=2).sum() >= 0.8 * 200


def test_one_camera_is_drawn_once_for_all_that_is_asked_of_it(wall, photo):
    """With the mesh's outline and without it, for patches of two sizes; another camera anew."""
    drawn = []

    def render(seen):
        drawn.append(seen)
        return wall.render(seen)

    view = StructureView.of(photo, render, 400, camera())
    drawn.clear()
    first, _, outlined = (
        view.observe(camera(), CHECK),
        view.observe(camera(), NEAR),
        replace(view, outline=True).observe(camera(), CHECK),
    )
    assert len(drawn) == 1
    assert outlined.patches >= first.patches > 0

    view.observe(moved(camera(), turn_deg=(0, 1, 0)), CHECK)
    view.observe(camera(), CHECK)
    assert len(drawn) == 3
