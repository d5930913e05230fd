"""Fisheyes: projected as OpenCV and COLMAP have them, drawn, colored, registered, exchanged."""

from dataclasses import replace

import cv2
import numpy as np
import pycolmap
import pytest
from color_scenes import pattern, plane
from photo_sets import photo_set
from skimage.color import deltaE_ciede2000, rgb2lab

from texproj.camera import Camera, Intrinsics, Pose
from texproj.color.vertices import color_vertices
from texproj.errors import InputError
from texproj.formats.cameras import entry_of_record, record_of_entry
from texproj.formats.interchange import (
    FISHEYE_WRITERS,
    READERS,
    WRITERS,
    Shot,
    detect,
    upright,
)
from texproj.options import ColorOptions, PointsOptions, RenderOptions
from texproj.photo import Correspondences, Photo, PhotoInfo, srgb_from_linear
from texproj.records import CameraRecord
from texproj.register.picks.register import register_points
from texproj.register.structure.mirror import mirrored_intrinsics
from texproj.render import ideal_grid, open_renderer
from texproj.solve.reprojection import Reprojection, projection_jacobian

RADIAL = (0.03, -0.01, 0.002, -0.0003)
BENT = (*RADIAL, 0.001, -0.002, 0.003, -0.001)
SIZE = (640, 480)
LENSES = {"radial": RADIAL, "bent": BENT, "plain": (0.0,) * 4}
POSE = Pose.look_at((0.3, -0.5, 3.0), (0.1, 0, 0), (0.2, 1, 0))


def lens(dist=RADIAL, size=SIZE, f=200.0):
    w, h = size
    return Intrinsics(w, h, f, 1.01 * f, w / 2 + 3.5, h / 2 - 2.25, dist, "fisheye")


def by_opencv(xyz, k, pose):
    """Pixels by OpenCV's own fisheye, of coefficients without the last four."""
    turn, t = cv2.Rodrigues(pose.R)[0], pose.t.reshape(3, 1)
    found = cv2.fisheye.projectPoints(xyz[:, None], turn, t, k.K, np.array(k.dist[:4])[:, None])
    return found[0][:, 0]


def by_colmap(xyz, k, pose):
    k1, k2, k3, k4, p1, p2, s1, s2 = (*k.dist, *(0.0,) * 4)[:8]
    values = [k.fx, k.fy, k.cx, k.cy, k1, k2, p1, p2, k3, k4, s1, s2]
    camera = pycolmap.Camera(
        model="THIN_PRISM_FISHEYE", width=k.width, height=k.height, params=values
    )
    return camera.img_from_cam(pose.apply(xyz))


def seen_points(k, count=2000, widest=74.0):
    """World points at all angles up to `widest` degrees off the axis."""
    rng = np.random.default_rng(1)
    angle, turn = np.radians(widest) * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    ray = [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)]
    return POSE.inverse.apply(np.stack(ray, axis=1) * rng.uniform(1, 9, (count, 1)))


# --- the model


@pytest.mark.parametrize("name", LENSES)
def test_points_fall_where_opencv_and_colmap_put_them(name):
    k = lens(LENSES[name])
    xyz = seen_points(k)
    ours = Camera(k, POSE).project(xyz)[0]
    np.testing.assert_allclose(ours, by_colmap(xyz, k, POSE), rtol=0, atol=1e-9)
    if name != "bent":
        np.testing.assert_allclose(ours, by_opencv(xyz, k, POSE), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", LENSES)
def test_pixels_come_back_within_a_billionth(name):
    """Inside the domain, 75 degrees around the axis; NaN outside of it, and never a wrong ray."""
    k = lens(LENSES[name])
    camera = Camera(k, POSE)
    xy = np.stack(np.meshgrid(np.linspace(0, 640, 161), np.linspace(0, 480, 121)), -1)
    xyz = camera.unproject(xy.reshape(-1, 2), 2.5)
    inside = np.isfinite(xyz).all(axis=1)
    back = camera.project(xyz[inside])[0]
    assert np.abs(back - xy.reshape(-1, 2)[inside]).max() < 1e-9
    rays = camera.rays(xy.reshape(-1, 2)[inside])[1] @ POSE.R[2]
    assert np.degrees(np.arccos(rays)).max() < 75
    assert np.degrees(np.arccos(rays)).max() > 74.5
    assert 0.5 < inside.mean() < 0.95
    far = camera.project(seen_points(k, widest=89.9))[0]
    assert np.isnan(far).any()


def test_the_grid_of_rays_is_the_lens():
    """The table of a radial lens against Newton's method, in pixels; the same outside."""
    for dist in LENSES.values():
        k = lens(dist).resized(320, 240)
        x, y = np.meshgrid(np.arange(320) + 0.5, np.arange(240) + 0.5)
        exact = k.undistort(np.stack([(x - k.cx) / k.fx, (y - k.cy) / k.fy], -1).reshape(-1, 2))
        grid = ideal_grid(k).reshape(-1, 2)
        both = np.isfinite(grid).all(axis=1) & np.isfinite(exact).all(axis=1)
        assert both.sum() > 0.999 * np.isfinite(exact).all(axis=1).sum()
        moved = k.distort(grid[both]) - k.distort(exact[both])
        assert np.abs(moved).max() * k.fx < 0.01


def test_derivatives_are_those_of_the_projection():
    """By differences over every parameter that can be solved."""
    free = ("focal", "aspect", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    camera, xyz = Camera(lens(BENT), POSE), seen_points(lens(BENT), 40, 60)
    problem = Reprojection(np.zeros((40, 2)), xyz, free=free)
    found = projection_jacobian(camera, xyz, free)
    for column in range(6 + len(free)):
        ends = []
        for sign in (1, -1):
            delta = np.zeros(6 + len(free))
            delta[column] = sign * 1e-6
            ends.append(problem.step(camera, delta).project(xyz)[0])
        wanted = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(found[:, :, column], wanted, rtol=1e-4, atol=1e-3)


def test_a_photo_on_its_side_and_a_mirrored_one_keep_their_lens():
    """A quarter turn moves each pixel (x, y) to (h - y, x); a mirror, to (w - x, y)."""
    k = lens(BENT)
    camera, xyz = Camera(k, POSE), seen_points(k, 200)
    x, y = camera.project(xyz)[0].T
    turned = upright(camera, 6).project(xyz)[0]
    np.testing.assert_allclose(turned, np.stack([k.height - y, x], axis=1), atol=1e-9)
    ideal = POSE.apply(xyz)[:, :2] / POSE.apply(xyz)[:, 2:]
    flipped = mirrored_intrinsics(k)
    found = flipped.distort(ideal * (-1, 1)) * (flipped.fx, flipped.fy) + (flipped.cx, flipped.cy)
    np.testing.assert_allclose(found, np.stack([k.width - x, y], axis=1), atol=1e-9)


# --- drawn and colored


@pytest.mark.parametrize("kind", ["gl", "cpu"])
def test_depth_of_a_plane_is_that_of_the_rays(kind):
    """At every pixel inside the domain, from 75 degrees off the axis on one side to the other."""
    camera = Camera(lens(BENT), Pose.look_at((0.1, 0.2, 1.0), (0.1, 0.2, 0), (0, 1, 0)))
    wall = plane(cells=6, half=4)
    with open_renderer(RenderOptions(renderer=kind)) as renderer, renderer.load(wall) as scene:
        seen = scene.gbuffer(camera, ("depth", "face"))
    depth, face = seen.require("depth"), seen.require("face")
    inside = np.isfinite(ideal_grid(camera.intrinsics)).all(axis=2)
    assert (face[~inside] == -1).all()
    assert (face[inside] >= 0).mean() > 0.999
    hit = inside & (face >= 0)
    assert np.abs(depth[hit] - 1.0).max() < 2e-3


def photographed(camera, z=0.0):
    """The endless pattern at height z by OpenCV's own rays, four to a pixel."""
    k, (w, h) = camera.intrinsics, (camera.width, camera.height)
    light = np.zeros((h, w, 3))
    for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
        x, y = np.meshgrid(np.arange(w) + dx, np.arange(h) + dy)
        xy = np.stack([x.ravel(), y.ravel()], axis=1)
        if k.is_fisheye:
            ideal = cv2.fisheye.undistortPoints(xy[:, None], k.K, np.array(k.dist)[:, None])[:, 0]
        else:
            ideal = (xy - (k.cx, k.cy)) / (k.fx, k.fy)
        ray = np.concatenate([ideal, np.ones((len(xy), 1))], axis=1) @ camera.pose.R
        away = (z - camera.center[2]) / np.where(ray[:, 2] < -1e-3, ray[:, 2], -1e-3)
        at = camera.center + ray * away[:, None]
        light += pattern(at[:, 0], at[:, 1]).reshape(h, w, 3) / 4
    return Photo(PhotoInfo("p.png", w, h), light.astype(np.float32), None)


def colors(mesh, cameras):
    photos = photo_set(cameras, [photographed(camera) for camera in cameras])
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        return color_vertices(mesh, photos, renderer, ColorOptions(to="vertices"))


def difference(rgb, other):
    lab = [rgb2lab(srgb_from_linear(values)[None]) for values in (rgb, other)]
    return deltaE_ciede2000(*lab)[0]


def test_colors_through_a_fisheye_are_those_through_a_pinhole():
    """Three of each, fisheyes near the plane, so that it spans 65 degrees to all sides: within 1
    CIEDE2000 of each other, at most places and at the worst hundredth, and both of the truth.
    """
    mesh = plane(cells=90, half=1.6)
    spots = ((0.1, 0.0), (-0.3, 0.2), (0.25, -0.3))
    near = [Pose.look_at((x, y, 0.9), (x + 0.1, y, 0), (0, 1, 0)) for x, y in spots]
    far = [Pose.look_at((x, y, 3.5), (x, y, 0), (0, 1, 0)) for x, y in spots]
    round_ = colors(mesh, [Camera(lens(RADIAL, (440, 440), 161.0), pose) for pose in near])
    flat = Intrinsics(380, 380, 337.0, 337.0, 190.0, 190.0)
    straight = colors(mesh, [Camera(flat, pose) for pose in far])
    assert (round_.weight > 0).mean() > 0.99
    both = (round_.weight > 0) & (straight.weight > 0)
    apart = difference(round_.rgb[both], straight.rgb[both])
    assert np.median(apart) < 0.3
    assert np.quantile(apart, 0.99) < 1
    x, y, _ = mesh.vertices.T
    truth = pattern(x, y).astype(np.float32)
    assert np.quantile(difference(round_.rgb[both], truth[both]), 0.99) < 1


# --- registered


def test_picks_register_a_fisheye_whose_lens_is_known():
    """Picks all over the picture, 1.5 px off: the pose within a few pixels; the lens as it was."""
    k, rng = lens(RADIAL, (3000, 2200), 1000.0), np.random.default_rng(3)
    xyz = seen_points(k, 4000, 70)
    xy = by_opencv(xyz, k, POSE)
    inside = ((xy > 0) & (xy < (3000, 2200))).all(axis=1)
    chosen = np.flatnonzero(inside)[:16]
    noisy = xy[chosen] + rng.normal(0, 1.5, (16, 2))
    picks = Correspondences(noisy, xyz[chosen], tuple(f"p{i:02d}" for i in range(16)))
    info = PhotoInfo("f.jpg", 3000, 2200)
    found = register_points(info, picks, k, PointsOptions(), surface=xyz[inside])
    off = np.linalg.norm(found.camera.project(xyz[inside])[0] - xy[inside], axis=1)
    assert np.sqrt(np.nanmean(off**2)) < 3
    assert found.camera.intrinsics.model == "fisheye"
    assert found.camera.intrinsics.dist == RADIAL


# --- files


def test_cameras_json_keeps_a_fisheye():
    record = CameraRecord("a.jpg", *SIZE, lens(BENT), POSE, "registered", "import")
    entry = entry_of_record(record)
    assert entry["model"] == "fisheye"
    assert record_of_entry(entry).intrinsics == lens(BENT)
    assert "model" not in entry_of_record(replace(record, intrinsics=lens(BENT).pinhole))
    with pytest.raises(InputError, match="dist has 5 coefficients; a fisheye lens has 4 or 8"):
        record_of_entry(entry | {"dist": [0.0] * 5})


FITTED = ("opf", "blocks-exchange")
"""Formats whose fisheyes are polynomials of another kind."""
SQUARE = ("micmac",)
"""Formats with one focal length."""


@pytest.mark.parametrize("kind", FISHEYE_WRITERS)
def test_formats_take_fisheyes_and_bring_them(kind, tmp_path):
    """The written file, read again, puts points where OpenCV's fisheye has them."""
    k = replace(lens(RADIAL), fy=200.0) if kind in SQUARE else lens(RADIAL)
    camera = Camera(k, POSE)
    for name, content in WRITERS[kind]([Shot("a.jpg", "../a.jpg", camera)], "m.ply").files.items():
        (tmp_path / name).write_bytes(content)
    kind, path = detect(tmp_path)
    (found,) = READERS[kind](path, lambda name: SIZE).cameras
    xyz = seen_points(lens(RADIAL))
    wanted = by_opencv(xyz, k, POSE)
    most_px = 0.05 if kind in FITTED else 1e-6
    np.testing.assert_allclose(found.camera.project(xyz)[0], wanted, rtol=0, atol=most_px)
    assert "75 degrees" in found.notes[0]


def test_tangential_terms_go_to_colmap_and_metashape(tmp_path):
    """Metashape's P1 and P2 are ours exchanged; it has no thin prism, and that is said."""
    for kind, dist in (("colmap", BENT), ("metashape", (*BENT[:6], 0.0, 0.0))):
        folder = tmp_path / kind
        folder.mkdir()
        written = WRITERS[kind]([Shot("a.jpg", "a.jpg", Camera(lens(BENT), POSE))], "m.ply")
        for name, content in written.files.items():
            (folder / name).write_bytes(content)
        path = folder if kind == "colmap" else next(folder.iterdir())
        (found,) = READERS[kind](path, lambda name: SIZE).cameras
        xyz = seen_points(lens(dist))
        wanted = by_colmap(xyz, lens(dist), POSE)
        np.testing.assert_allclose(found.camera.project(xyz)[0], wanted, rtol=0, atol=1e-6)
        assert ("s1" in written.notes.get("a.jpg", "")) == (kind == "metashape")
