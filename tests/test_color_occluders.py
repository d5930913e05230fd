"""What stands in front of the piece in one photo is found, cut out whole, and nothing else."""

import json

import cv2
import numpy as np
import pytest
from color_scenes import SIZE, camera, picture, plane
from photo_sets import photo_set

from texproj.color.occluders.in_front import find_occluders, shown, sparse
from texproj.color.sampling.prepare import depth_seen
from texproj.errors import InputError, OutputError
from texproj.files import write_atomically
from texproj.formats.cameras import cameras_json
from texproj.formats.models.ply import write_ply
from texproj.options import ColorOptions, RenderOptions
from texproj.photo import srgb_from_linear
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.render import open_renderer
from texproj.stages.bench import Workbench
from texproj.stages.coloring import color_freshness, color_project
from texproj.stages.inspecting import vertex_factors

VIEWS = ((0.3, 0.2, 2.6), (-0.6, 0.3, 2.8), (-0.5, -0.6, 2.6), (-0.7, -0.1, 3.0))
TARGETS = ((0.2, 0, 0), (-1.1, 0, 0), (-1.1, 0, 0), (-1.2, 0.1, 0))
"""The first photo sees the right of the square alone."""
GAINS = (1.0, 0.7, 1.2, 0.9)
COAT = np.array([0.35, 0.05, 0.08])


@pytest.fixture(scope="module")
def cpu():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def views():
    return [camera(*both) for both in zip(VIEWS, TARGETS, strict=True)]


def someone(x0=0.3, x1=0.75):
    """(h, w) bool: a body in the picture, from its lower edge upwards."""
    w, h = SIZE
    x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
    return ((x - x0) / (x1 - x0) - 0.5) ** 2 * 4 + ((y - 1.0) / 0.7) ** 2 < 1


def photos(body=None, change=None):
    """Photos with noise; in the first something is painted where `body` is."""
    rng, made = np.random.default_rng(3), []
    for number, (view, gain) in enumerate(zip(views(), GAINS, strict=True)):
        photo = picture(view, gain=gain)
        if number == 0 and body is not None:
            cloth = cv2.GaussianBlur(rng.standard_normal(body.shape), (0, 0), 3)
            folds = 1 + 0.1 * cloth[..., None]
            photo.pixels[body] = (COAT * folds)[body] if change is None else change(photo)[body]
        photo.pixels[:] = np.clip(photo.pixels + rng.normal(0, 0.01, photo.pixels.shape), 0, 1)
        made.append(photo)
    return made


def found(given, cpu):
    return find_occluders(plane(), photo_set(views()[: len(given)], given), cpu)


def test_one_depth_image_serves_all_sizes(cpu):
    """Of a large photo's depth every n-th pixel, which is where its sparse camera sees the plane;
    and, through the lens, where a smaller photo shows it.
    """
    view = camera(VIEWS[0], TARGETS[0], dist=(0.05, 0, 0, 0, 0)).scaled(6)
    with cpu.load(plane()) as scene:
        depth_camera, depth = depth_seen(view, scene)
        small = view.resized(160, 120)
        expected = np.isfinite(scene.gbuffer(small, ("depth",)).require("depth"))
    few_camera, few = sparse(depth_camera, depth)
    assert 320 <= max(few.shape) < 0.6 * max(depth.shape)
    row, column = np.argwhere(np.isfinite(few)).T
    xyz = few_camera.unproject(np.stack([column, row], axis=1) + 0.5, few[row, column])
    assert np.abs(xyz[:, 2]).max() < 1e-4

    on_mesh = shown(small, depth_camera, depth)
    assert 0.2 < expected.mean() < 0.9
    assert (on_mesh != expected).mean() < 0.005


def test_the_whole_of_it_is_cut_out(cpu):
    """Also where no other photo sees the surface, which is half of it; of what is not hidden less
    than 2 % goes.
    """
    body = someone()
    others = np.zeros(body.shape, bool)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    origin, ray = views()[0].rays(np.stack([x.ravel(), y.ravel()], axis=1))
    at = (origin - ray * (origin[:, 2:] / ray[:, 2:])).reshape(*body.shape, 3)
    for other in views()[1:]:
        others |= other.inside(other.project(at.reshape(-1, 3))[0]).reshape(body.shape)
    on_plane = (np.abs(at[..., :2]) < 1).all(axis=-1)
    assert 0.3 < (~others)[body & on_plane].mean() < 0.8

    occluders = found(photos(body), cpu)

    assert list(occluders) == ["0"]
    hidden = occluders["0"].free == 0
    assert hidden[body].all()
    assert hidden[~body].mean() < 0.02
    assert 0.2 < occluders["0"].share < 0.5


def test_nothing_in_front_is_found_where_nothing_is(cpu):
    """Neither by noise and exposures, nor where a shade takes half the light."""
    assert found(photos(), cpu) == {}
    assert found(photos(someone(), lambda photo: photo.pixels * (0.45, 0.5, 0.55)), cpu) == {}


def test_two_photos_that_differ_accuse_nobody(cpu):
    """Two do not tell which of them is wrong."""
    assert found(photos(someone(0.1, 0.6))[:2], cpu) == {}


def project_of(root, given):
    """A project of sRGB pngs at the true cameras."""
    for number, photo in enumerate(given):
        rgb = np.round(srgb_from_linear(photo.pixels) * 255).astype(np.uint8)
        encoded = cv2.imencode(".png", rgb[..., ::-1])[1].tobytes()
        write_atomically(root / "photos" / f"{number}.png", encoded)
    (root / "mesh").mkdir()
    write_ply(root / "mesh/wall.ply", plane().vertices, plane().faces, None)
    records = [
        CameraRecord(f"{k}.png", *SIZE, view.intrinsics, view.pose, "registered", "import")
        for k, view in enumerate(views())
    ]
    write_atomically(root / "cameras.json", cameras_json(records))
    write_atomically(root / "project.toml", '[color]\nto = "vertices"\n[render]\nrenderer = "cpu"')
    return Project.open(root)


def colored(root):
    with Workbench(Project.open(root)) as bench:
        return color_project(bench)


def coat_left(root):
    """Vertices of the coat's color."""
    from texproj.formats.models import read_model

    rgb = read_model(root / "out/model.ply").colors[:, :3].astype(int)
    near = np.abs(rgb - np.round(srgb_from_linear(COAT) * 255)).max(axis=1) < 25
    return int(near.sum())


def test_a_project_tells_keeps_and_takes_corrections(tmp_path):
    """The mask is told, shown as a factor, used; an edited one is used and never written over; off
    is off.
    """
    project_of(tmp_path, photos(someone()))
    outcome = colored(tmp_path)
    mask = tmp_path / "work/occluders/0.png"

    assert any("0.png" in note and "stands in front" in note for note in outcome.notes)
    assert coat_left(tmp_path) == 0
    assert color_freshness(Project.open(tmp_path)).fresh
    assert colored(tmp_path).kept
    with Workbench(Project.open(tmp_path)) as bench:
        assert (vertex_factors(bench, "0.png")["mask"] == 0).any()

    everything = np.full(SIZE[::-1], 255, np.uint8)
    cv2.imwrite(str(mask), everything)
    assert "0.png" in color_freshness(Project.open(tmp_path)).reason
    outcome = colored(tmp_path)
    assert any("edited" in note for note in outcome.notes)
    assert coat_left(tmp_path) > 10
    (tmp_path / "work/occluders.json").unlink()
    colored(tmp_path)
    assert cv2.imread(str(mask), 0).min() == 255

    mask.unlink()
    write_atomically(tmp_path / "project.toml", '[color]\nto = "vertices"\noccluders = false')
    assert colored(tmp_path).notes == ()
    assert not mask.exists()
    assert json.loads((tmp_path / "work/color.json").read_text())["occluders"] == {}
    assert ColorOptions().occluders


@pytest.mark.parametrize("place", ["work/occluders/0.png", "work/occluders"])
def test_what_is_in_the_way_of_a_mask_is_named(tmp_path, place):
    """A folder in its place, a file in that of all: one sentence, and no model."""
    project_of(tmp_path, photos())
    target = tmp_path / place
    if target.suffix:
        target.mkdir(parents=True)
    else:
        write_atomically(target, "x")
    with pytest.raises(OutputError, match="move it away"):
        colored(tmp_path)

    assert not (tmp_path / "out").exists()


def test_nothing_but_masks_is_told(tmp_path):
    """Where masks leave out all of the piece there is no model, and a sentence says why."""
    project_of(tmp_path, photos())
    for number in range(len(views())):
        nothing = cv2.imencode(".png", np.zeros(SIZE[::-1], np.uint8))[1].tobytes()
        write_atomically(tmp_path / f"masks/{number}.png", nothing)
    with pytest.raises(InputError, match=r"no photo shows any of the mesh; masks"):
        colored(tmp_path)
    assert not (tmp_path / "out").exists()
