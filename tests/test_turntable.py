"""The film of a model on a turntable."""

import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image
from test_color_occluders import colored, photos, project_of

from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli.program import run
from texproj.errors import InputError, UsageError
from texproj.mesh import ColoredMesh, Mesh
from texproj.options import RenderOptions
from texproj.project import Project
from texproj.render import ModelLook, model_pictures, open_renderer
from texproj.report.pictures import Front
from texproj.stages.bench import Workbench
from texproj.stages.film_path import film_path
from texproj.stages.fronts import front
from texproj.stages.turning import TurntableOptions, turn_project


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    root = tmp_path_factory.mktemp("wall")
    project_of(root, photos())
    colored(root)
    return root


def frames_of(path):
    """(n, h, w, 3) and the milliseconds of each."""
    out, times = [], []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            out.append(np.asarray(film.convert("RGB"), int))
            times.append(film.info["duration"])
    return np.array(out), times


@pytest.mark.parametrize("film", ["webp", "gif"])
def test_a_film_of_a_wall_swings(wall, capsys, film):
    """So many frames in so many seconds. A wall has no back to show: it is filmed to and fro, wide
    from the front and narrower from its sides, and the film says so.
    """
    asked = ["--frames", "8", "--seconds", "2", "--size", "64", "--film", film]
    assert run(["turntable", str(wall), *asked]) == 0
    frames, times = frames_of(wall / f"out/turntable.{film}")

    assert frames.shape == (8, 64, 64, 3)
    assert times == [250] * 8
    shown = (np.abs(frames - 43).max(axis=-1) > 25).mean(axis=(1, 2))
    assert (shown > 0.1).all()
    assert shown[2] < 0.8 * shown[0] > shown[6]
    assert np.abs(frames[1] - frames[3]).mean() < 2 < np.abs(frames[1] - frames[5]).mean()
    assert "swings" in capsys.readouterr().out


def path_around(mesh, frames=8):
    """The way of a film around a mesh that was photographed from -z."""
    front = Front(np.array([0.0, -1, 0]), np.array([0.0, 0, -1]))
    with open_renderer(RenderOptions()) as renderer, renderer.load(mesh) as scene:
        return film_path(SimpleNamespace(mesh=mesh, plain_scene=scene), front, frames)


def test_what_is_closed_is_turned_about():
    """A sphere, and a sphere with a small hole at its back; half a sphere is not, nor are backs
    known of a mesh whose faces are the wrong way round.
    """
    ball = trimesh.creation.icosphere(3)
    behind = ball.triangles_center[:, 2]
    for keep, turns in ((2, True), (0.9, True), (0.0, False)):
        mesh = Mesh(ball.vertices, ball.faces[behind < keep])
        found = path_around(mesh)
        assert found.sided
        assert bool(np.allclose(found.angles_deg, np.arange(8) * 45)) == turns
        assert bool(found.note) != turns
    assert 30 <= found.angles_deg.max() <= 60
    assert -60 <= found.angles_deg.min() <= -30
    inside_out = path_around(Mesh(ball.vertices, ball.faces[:, ::-1]))
    assert not inside_out.sided and np.allclose(inside_out.angles_deg, np.arange(8) * 45)


def test_backs_are_dark():
    """Seen from behind, a quad has the gray that was asked for, from the front its own color."""
    quad = np.array([(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)], float)
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    camera = Camera(Intrinsics(8, 8, 8, 8, 4, 4), Pose.identity())
    red = np.full((4, 3), (200, 0, 0), np.uint8)
    with open_renderer(RenderOptions()) as renderer:
        for order, color in ((faces, (200, 0, 0)), (faces[:, ::-1], (124, 124, 124))):
            (picture,) = model_pictures(
                renderer, ColoredMesh(quad, order, red), [camera], ModelLook(backs=0.2)
            )
            assert tuple(picture[4, 4, :3]) == color


def test_a_shorter_film_leaves_none_of_the_longer(wall):
    """Pictures of an earlier film do not stay beside those of a new one, other films do."""
    for frames, film in ((5, "png"), (3, "gif"), (3, "png")):
        asked = ["--frames", str(frames), "--size", "16", "--film", film]
        assert run(["turntable", str(wall), *asked]) == 0
    mine = wall / "out/turntable_004.png"
    assert not mine.exists() and (wall / "out/turntable_002.png").exists()
    assert (wall / "out/turntable.gif").exists()


def test_pictures_of_each_frame(wall):
    """Numbered so that other programs can make a film of them."""
    with Workbench(Project.open(wall)) as bench:
        outcome = turn_project(bench, TurntableOptions("png", 3, size=48))

    assert [path.name for path in outcome.files] == [f"turntable_00{k}.png" for k in range(3)]
    with Image.open(outcome.files[1]) as picture:
        assert picture.size == (48, 48)


def test_what_cannot_be_filmed_is_refused(tmp_path, wall):
    """No model, no turn, no memory: a sentence each, and nothing is written."""
    project_of(tmp_path, photos())
    with Workbench(Project.open(tmp_path)) as bench, pytest.raises(InputError, match="color"):
        turn_project(bench, TurntableOptions())
    for frames, size in ((1, 64), (72, 8), (720, 2160)):
        with pytest.raises(UsageError):
            TurntableOptions("gif", frames, size=size)
    assert run(["turntable", str(wall), "--seconds", "0"]) == 2


def test_a_damaged_glb_is_told(wall, capsys):
    """The film is of the obj then, and says so."""
    assert run(["color", str(wall), "--to", "texture"]) == 0
    glb = wall / "out/model.glb"
    glb.write_bytes(glb.read_bytes()[:1000])
    assert run(["turntable", str(wall), "--frames", "2", "--size", "16"]) == 0
    assert "model.obj is shown, since" in capsys.readouterr().out


def test_a_model_of_another_mesh_is_not_filmed(wall, tmp_path, capsys):
    """It is not where the views look; frames without anything would look as if it had worked."""
    moved = shutil.copytree(wall, tmp_path / "moved")
    mesh = Project.open(moved).mesh_path
    trimesh.load(mesh, process=False).apply_translation((9, 0, 0)).export(mesh)

    assert run(["turntable", str(moved), "--size", "32", "--frames", "2"]) == 2
    assert f"{mesh} has changed since it was colored; run `texproj color" in capsys.readouterr().err


def test_the_film_stands_as_the_settings_say(wall):
    """Photos from -z, upward -y; with x named as up the front is turned by a quarter."""
    plain = front(Project.open(wall), mesh := Project.open(wall).load_mesh().mesh)
    (wall / "project.toml").write_text('[output]\nup = "x"\n')
    named = front(Project.open(wall), mesh)
    (wall / "project.toml").unlink()

    assert abs(plain.up[0]) < 0.1
    assert named.up.tolist() == [1, 0, 0] and abs(named.level @ named.up) < 1e-9
