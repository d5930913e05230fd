"""What we write means, by each format's own definition, the camera that we have."""

import foreign
import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.formats.interchange import READERS, WRITERS, Shot

WIDTH, HEIGHT = 800, 600
CENTERED, OFF = (400.0, 300.0), (391.25, 317.5)
FIVE = (0.08, -0.03, 0.002, -0.004, 0.01)
EIGHT = (0.08, -0.03, 0.002, -0.004, 0.01, 0.02, -0.01, 0.003)

EXPRESSIBLE = {
    "colmap": [((900, 870), OFF, EIGHT), ((900, 870), OFF, FIVE[:4]), ((900, 870), OFF, ())],
    "bundler": [((900, 900), CENTERED, (0.08, -0.03, 0, 0, 0))],
    "meshlab": [((900, 870), OFF, ())],
    "metashape": [((900, 870), OFF, FIVE)],
    "realityscan": [((900, 900), OFF, FIVE)],
    "nerfstudio": [((900, 870), OFF, FIVE)],
}
CASES = [(kind, case) for kind, cases in EXPRESSIBLE.items() for case in cases]


def camera_of(case, distance=5.0) -> Camera:
    """A camera to the left of, above and away from the origin that looks there, tilted."""
    (fx, fy), (cx, cy), dist = case
    center = distance * np.array([-0.4, -0.8, 0.4])
    pose = Pose.look_at(center, (0.1, 0, 0.2), (0.2, 0, 1))
    return Camera(Intrinsics(WIDTH, HEIGHT, fx, fy, cx, cy, dist), pose)


def written(kind: str, camera: Camera, tmp_path):
    """The files of one camera in a folder, their texts, and what was not expressed."""
    result = WRITERS[kind]([Shot("a.jpg", "../photos/a.jpg", camera)], "../mesh/scan.ply")
    for name, content in result.files.items():
        (tmp_path / name).write_bytes(content)
    texts = {n: c.decode() for n, c in result.files.items() if not n.endswith(".bin")}
    return texts, result.notes


def read_back(kind: str, folder, size=(WIDTH, HEIGHT)):
    names = {"bundler": "bundle.out", "meshlab": "cameras.mlp", "metashape": "cameras.xml",
             "realityscan": "cameras.csv", "nerfstudio": "transforms.json"}  # fmt: skip
    return READERS[kind](folder / names.get(kind, ""), lambda name: size)


def parameters(camera: Camera) -> np.ndarray:
    k = camera.intrinsics
    dist = (*k.dist, *(0.0,) * 8)[:8]
    return np.array([k.fx, k.fy, k.cx, k.cy, *dist, *camera.pose.R.ravel(), *camera.pose.t])


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_a_point_falls_where_the_definition_says(kind, case, tmp_path):
    """The file, read by the definition in plain arithmetic, puts points on our pixels."""
    camera = camera_of(case)
    files, _ = written(kind, camera, tmp_path)
    points = np.random.default_rng(4).uniform(-1.2, 1.2, (20, 3))
    sized = (files, (WIDTH, HEIGHT)) if kind in ("bundler", "realityscan") else (files,)

    told = [getattr(foreign, kind)(sized[0], p.tolist(), *sized[1:]) for p in points]

    np.testing.assert_allclose(told, camera.project(points)[0], rtol=0, atol=1e-8)


@pytest.mark.parametrize(("kind", "case"), [*CASES, ("colmap-binary", EXPRESSIBLE["colmap"][0])])
def test_what_is_written_is_read_back(kind, case, tmp_path):
    """Export then import gives the same camera to 1e-9; no term is said to be lost."""
    camera = camera_of(case)
    _, notes = written(kind, camera, tmp_path)
    model = read_back(kind, tmp_path)

    assert [c.name.rpartition("/")[2] for c in model.cameras] == ["a.jpg"]
    assert (model.cameras[0].camera.width, model.cameras[0].camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(
        parameters(model.cameras[0].camera), parameters(camera), rtol=1e-12, atol=1e-9
    )
    if kind not in ("realityscan", "meshlab"):  # these say how others misunderstand them
        assert notes == {} and model.cameras[0].notes == ()


@pytest.mark.parametrize("kind", [*EXPRESSIBLE, "colmap-binary"])
def test_large_coordinates_keep_their_bits(kind, tmp_path):
    """A camera at geocentric coordinates (millions of metres) moves by less than a micrometre."""
    case = EXPRESSIBLE[kind.removesuffix("-binary")][0]
    near = camera_of(case)
    far = (-5_041_986.508798251, 2_573_482.020935406, -2_929_105.142556032)
    camera = Camera(near.intrinsics, Pose(near.pose.R, near.pose.t - near.pose.R @ far))
    written(kind, camera, tmp_path)

    got = read_back(kind, tmp_path).cameras[0].camera

    np.testing.assert_allclose(got.center, camera.center, rtol=0, atol=1e-6)


@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 90.0, 89.9999999, 150.0])
def test_level_cameras_survive_heading_pitch_roll(tilt_deg, tmp_path):
    """At pitch 90 degrees heading and roll cannot be told apart; the rotation still comes back."""
    a = np.deg2rad(tilt_deg)
    looking = (0.0, np.sin(a), -np.cos(a))
    up = (0.0, np.cos(a), np.sin(a))
    pose = Pose.look_at((0, 0, 0), looking, up)
    camera = Camera(Intrinsics(WIDTH, HEIGHT, 900, 900, *CENTERED), pose)
    written("realityscan", camera, tmp_path)

    got = read_back("realityscan", tmp_path).cameras[0].camera

    np.testing.assert_allclose(got.pose.R, pose.R, rtol=0, atol=1e-12)


LOSSES = [
    ("bundler", ((900, 870), OFF, FIVE), ("fx - fy = 30", "cx - width/2 = -8.75", "p1", "k3")),
    ("meshlab", ((900, 900), OFF, FIVE), ("k1 = 0.08", "up to 17.5 px")),
    ("metashape", ((900, 870), OFF, EIGHT), ("dist[5] = 0.02", "dist[7]")),
    ("nerfstudio", ((900, 870), OFF, EIGHT), ("dist[5] = 0.02",)),
    ("realityscan", ((900, 870), OFF, FIVE), ("fx - fy = 30", "t1 and t2")),
    ("colmap", ((900, 870), OFF, (*EIGHT, 0.001, 0, 0, 0)), ("s1 = 0.001",)),
]


@pytest.mark.parametrize(("kind", "case", "words"), LOSSES)
def test_what_a_format_cannot_hold_is_said(kind, case, words, tmp_path):
    """A note names each term that is not in the file; terms that are in it are not named."""
    _, notes = written(kind, camera_of(case), tmp_path)

    assert all(word in notes["a.jpg"] for word in words), notes
    assert "k2 = -0.03" not in notes["a.jpg"] or kind == "meshlab"


def test_meshlab_opens_the_project_and_keeps_the_cameras(tmp_path):
    """PyMeshLab loads mesh and rasters of our file; what it saves is the same camera within what
    its six printed digits allow (0.05 px).
    """
    pymeshlab = pytest.importorskip("pymeshlab")
    import cv2
    import trimesh

    (tmp_path / "mesh").mkdir()
    (tmp_path / "photos").mkdir()
    (tmp_path / "out").mkdir()
    trimesh.creation.box().export(tmp_path / "mesh" / "scan.ply")
    cv2.imwrite(str(tmp_path / "photos" / "a.jpg"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    camera = camera_of(EXPRESSIBLE["meshlab"][0])
    written("meshlab", camera, tmp_path / "out")
    meshes = pymeshlab.MeshSet()
    meshes.load_project(str(tmp_path / "out" / "cameras.mlp"))
    assert (meshes.mesh_number(), meshes.raster_number()) == (1, 1)
    meshes.save_project(str(tmp_path / "out" / "again.mlp"))

    model = READERS["meshlab"](tmp_path / "out" / "again.mlp", lambda name: None)

    points = np.random.default_rng(4).uniform(-1, 1, (20, 3))
    told = model.cameras[0].camera.project(points)[0]
    np.testing.assert_allclose(told, camera.project(points)[0], rtol=0, atol=0.05)
