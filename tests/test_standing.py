"""Which way a scan stands, and a glb that stands upright while its coordinates stay the scan's."""

import json
import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from texproj.camera import Camera, Intrinsics, Pose
from texproj.formats.models import read_model, write_colored_glb
from texproj.mesh import ColoredMesh
from texproj.options import ColorOptions, OutputOptions
from texproj.stages.writing import output_plan
from texproj.standing import AXES, Standing, standing

LENS = Intrinsics(640, 480, 500, 500, 320, 240)
TOWER = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0.2, 0.3, 9]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)


def around(up, pitch: float, count: int = 8, turn: float = 360.0) -> list[Camera]:
    """Photos from all sides, held level, that look down by so many degrees."""
    up = np.asarray(up, float) / np.linalg.norm(up)
    side = np.cross(up, [0.3, 0.5, 0.7])
    side /= np.linalg.norm(side)
    cameras = []
    for angle in np.radians(np.arange(count) * turn / count):
        out = np.cos(angle) * side + np.sin(angle) * np.cross(up, side)
        eye = 5 * (out * np.cos(np.radians(pitch)) + up * np.sin(np.radians(pitch)))
        cameras.append(Camera(LENS, Pose.look_at(eye, np.zeros(3), up)))
    return cameras


def written(path, stand: Standing | None, offset=0.0):
    """A tower along z, as trimesh (which applies nodes) and as this package reads it."""
    model = ColoredMesh(TOWER + offset, FACES, np.full((4, 3), 0.5, np.float32))
    write_colored_glb(path, model, standing=stand)
    return trimesh.load_scene(path, process=False).to_geometry().vertices, read_model(path).vertices


@pytest.mark.parametrize("up", [*AXES.values(), (0.36, 0.48, -0.8), (0.6, -0.8, 0.0)])
def test_up_becomes_y_by_a_rotation(up):
    """Whatever is up comes to y, and lengths and handedness stay."""
    rotation = Rotation.from_quat(Standing(up, 1.0, "").rotation)

    np.testing.assert_allclose(rotation.apply(up), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation.as_matrix()), 1, atol=1e-12)


def test_z_up_keeps_the_front_in_front():
    """A scan with z up and its front towards -y, as modelers have it, faces the viewer (+z)."""
    rotation = Rotation.from_quat(Standing(AXES["z"], 1.0, "").rotation)

    np.testing.assert_allclose(rotation.apply((0, -1, 0)), (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, (3_000_000.0, 500_000.0, 100.0)])
def test_a_turned_glb_stands_upright_and_is_read_in_the_frame_of_the_scan(tmp_path, offset):
    """Viewers, which apply nodes, see the tower along y and in metres; coordinates stay."""
    seen, kept = written(tmp_path / "m.glb", standing("z", "mm", ()), offset)

    low, high = seen.min(0), seen.max(0)
    np.testing.assert_allclose(high - low, (0.001, 0.009, 0.002), rtol=1e-6)
    assert seen[3, 1] == high[1]
    np.testing.assert_allclose(kept, TOWER + offset, atol=1e-6)


def test_positions_in_the_file_are_those_of_the_scan(tmp_path):
    """Only the node turns: the same bytes of geometry, whatever is up."""
    chunks = []
    for up in ("y", "-x"):
        written(tmp_path / "m.glb", standing(up, "auto", ()))
        data = (tmp_path / "m.glb").read_bytes()
        (length,) = struct.unpack("<I", data[12:16])
        chunks.append(data[20 + length :])
        nodes = json.loads(data[20 : 20 + length])["nodes"]

        assert [sorted(node) for node in nodes] == (
            [["mesh", "name"]] if up == "y" else
            [["mesh", "name"], ["children", "name", "rotation", "scale"]]
        )  # fmt: skip

    assert chunks[0] == chunks[1]


@pytest.mark.parametrize(("name", "up"), AXES.items())
@pytest.mark.parametrize("turn", [360.0, 60.0])
def test_auto_takes_the_axis_that_is_upward_in_the_photos(name, up, turn):
    """Also for photos that look down by 15 degrees, from all sides or from one."""
    found = standing("auto", "auto", around(up, 15, turn=turn))

    assert found.up == up
    assert f"up is {name}," in found.reason and "8 photos" in found.reason


def test_auto_takes_a_direction_that_is_no_axis():
    """A frame of structure from motion: upward is what the photos say, to a degree."""
    up = np.array([0.5, -0.6, 0.4]) / np.linalg.norm([0.5, -0.6, 0.4])
    found = standing("auto", "auto", around(up, 30))

    assert np.degrees(np.arccos(np.array(found.up) @ up)) < 1
    assert "no axis of the scan" in found.reason


def test_a_drone_that_looks_straight_down_tells_upward():
    """Its pictures' own up is north or south: only what it has measured tells the sky from the
    ground.
    """
    at = [Pose.look_at((x, y, 9.0), (x, y, 0.0), (0, 1, 0)) for x in (0, 1) for y in (0, 1)]
    cameras = [Camera(Intrinsics(60, 40, 50, 50, 30, 20), pose) for pose in at]

    assert (
        standing("auto", "auto", cameras, [(0.0, 0.02, -1.0), (), (0.01, 0, -1.0), ()]).up
        == (AXES["z"])
    )


def test_what_is_asked_for_is_what_is_written():
    """Unless asked, a glb is as the scan is; auto asks the cameras."""
    cameras = around((0, 0, 1), 10)

    assert output_plan(ColorOptions(), OutputOptions(), cameras).standing.as_is
    assert output_plan(ColorOptions(), OutputOptions(up="auto"), cameras).standing.up == AXES["z"]
    assert not output_plan(ColorOptions(), OutputOptions(unit="mm"), cameras).standing.as_is
