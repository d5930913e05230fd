"""What a model says of what made it: in the glb, the ply, the obj and the report."""

import json
import struct

import numpy as np
import pytest
import trimesh
from PIL import Image

from texproj.camera import Intrinsics, Pose
from texproj.formats.models import write_obj, write_ply
from texproj.formats.photos import read_photo_info
from texproj.mesh import TexturedMesh
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.bench import Workbench
from texproj.stages.coloring import color_project
from texproj.stages.reporting import report_project
from texproj.version import __version__

WIDTH, HEIGHT = 160, 120


def photo(path, rights="", artist="", taken=""):
    exif = Image.Exif()
    if rights:
        exif[33432] = rights
    if artist:
        exif[315] = artist
    if taken:
        exif.get_ifd(0x8769)[0x9003] = taken
    rng = np.random.default_rng(3)
    Image.fromarray(rng.integers(40, 200, (HEIGHT, WIDTH, 3), np.uint8)).save(path, exif=exif)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A box with three photos of two owners, colored and reported."""
    root = tmp_path_factory.mktemp("box")
    (root / "mesh").mkdir()
    (root / "photos").mkdir()
    trimesh.creation.icosphere(2).export(root / "mesh" / "scan.ply")
    photo(root / "photos" / "a.jpg", "(c) Museum of Words", "Ann", "2026:11:29 08:15:00")
    photo(root / "photos" / "b.jpg", "", "Bob")
    photo(root / "photos" / "c.jpg", "(c) Museum of Words")
    settings = '[color]\nto = "vertices"\n[output]\nmodels = ["glb", "ply"]\n'
    (root / "project.toml").write_text(settings)
    project = Project.open(root)
    lens = Intrinsics(WIDTH, HEIGHT, 200, 200, 80, 60)
    poses = [Pose.look_at((5 * np.cos(k), 5 * np.sin(k), 1), (0, 0, 0)) for k in range(3)]
    project.save_cameras(
        CameraRecord(f"{name}.jpg", WIDTH, HEIGHT, lens, pose, "registered", "points")
        for name, pose in zip("abc", poses, strict=True)
    )
    with Workbench(project) as bench:
        color_project(bench)
        report_project(bench)
    return project


def asset_of(path):
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length])["asset"]


def test_the_glb_says_what_made_it(made):
    """Program and version, photos with hashes, cameras and owners, settings; copyright is glTF's
    own field, each owner once.
    """
    asset = asset_of(made.out / "model.glb")
    facts = asset["extras"]["texproj"]
    first = facts["photos"][0]

    assert asset["generator"] == f"texproj {__version__}"
    assert asset["copyright"] == "(c) Museum of Words; Bob"
    assert (first["file"], first["artist"], first["taken"]) == (
        "a.jpg", "Ann", "2026-11-29T08:15:00"
    )  # fmt: skip
    assert first["blake2b"] == made.hash_of(made.photo_path("a.jpg"))
    camera = made.load_cameras()["a.jpg"]
    assert first["K"] == camera.intrinsics.K.tolist() and first["t"] == camera.pose.t.tolist()
    assert facts["settings"]["color"]["to"] == "vertices" and facts["mesh"]["file"] == "scan.ply"


def test_ply_and_report_say_it_too(made):
    """The ply in comments that strict readers take; the report has all facts."""
    head = (made.out / "model.ply").read_bytes().split(b"end_header")[0].decode("ascii")
    report = json.loads((made.out / "report.json").read_text())

    assert f"comment texproj {__version__}" in head
    assert "comment copyright: (c) Museum of Words; Bob" in head
    assert report["provenance"] == asset_of(made.out / "model.glb")["extras"]["texproj"]
    assert "Museum of Words; Bob" in (made.out / "report.html").read_text()


def test_the_same_inputs_make_the_same_file(made):
    """No time of day is in it: an archive can compare."""
    before = (made.out / "model.glb").read_bytes()
    (made.out / "model.glb").unlink()
    with Workbench(Project.open(made.root)) as bench:
        color_project(bench)

    assert (made.out / "model.glb").read_bytes() == before


def test_copyright_of_exif_is_one_line(tmp_path):
    """The zero byte between photographer and editor, and line ends, are spaces."""
    photo(tmp_path / "a.jpg", "Eve\0Adam\n1999", "", "2026:13")
    info = read_photo_info(tmp_path / "a.jpg")

    assert (info.copyright, info.artist, info.taken) == ("Eve Adam 1999", "", "")


def test_comments_of_any_letters_break_no_file(tmp_path):
    """PLY knows ASCII alone; a line end inside would be a line of its own."""
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2]], np.int32)
    said = ("copyright: \u00a9 M\u00fcller\nend_header",)
    write_ply(tmp_path / "a.ply", square, faces, None, None, said)
    uv = np.array([[0, 0], [1, 0], [0, 1]], float)
    page = np.zeros((4, 4, 3), np.uint8)
    model = TexturedMesh(square, faces, uv, faces, np.zeros(1, np.int32), (page,), None)
    write_obj(tmp_path / "a.obj", model, [tmp_path / "a.png"], said)
    head = (tmp_path / "a.ply").read_bytes().split(b"\n")[:3]

    assert head[2] == b"comment copyright: (c) M?ller end header"
    assert len(trimesh.load(tmp_path / "a.ply").faces) == 1
    assert (tmp_path / "a.obj").read_text("utf-8").startswith("# copyright: \u00a9 M\u00fcller end")
