"""Points that were named on the mesh in MeshLab complete the picks of the photos."""

import json

import pytest
import trimesh
from PIL import Image

from texproj.cli import main
from texproj.project import Project

PP = """<!DOCTYPE PickedPoints>
<PickedPoints>
 <DocumentData>
  <DateTime date="2026-05-04" time="12:00:00"/>
  <User name="a"/>
  <DataFileName name="scan.ply"/>
 </DocumentData>
 <point x="1.5" y="-2.25" z="0.125" name="nose" active="1"/>
 <point y="3" x="4" z="5" active="1" name="left ear"/>
 <point x="9" y="9" z="9" name="off" active="0"/>
</PickedPoints>
"""


@pytest.fixture
def project(tmp_path):
    root = tmp_path / "box"
    for folder in ("mesh", "photos", "correspondences"):
        (root / folder).mkdir(parents=True)
    trimesh.creation.box().export(root / "mesh/box.ply")
    for name in ("a", "b", "c"):
        Image.new("RGB", (80, 60)).save(root / f"photos/{name}.jpg")
    (tmp_path / "scan_picked_points.pp").write_text(PP)
    return Project.open(root)


def test_pixels_get_the_points_of_their_names(project, capsys):
    """Rows whose names the list does not have are left out and named, those that have a point
    already keep it; a photo without picks is none of the list's business.
    """
    folder = project.root / "correspondences"
    (folder / "a.csv").write_text("u,v,name\n10.5,20,nose\n3,4,left ear\n5,6,off\n")
    (folder / "b.csv").write_text("u;v;x;y;z;name\n1;2;7;7;7;own\n3;4;0;0;0;nose\n")
    assert (
        main(["import", str(project.root), str(project.root.parent / "scan_picked_points.pp")]) == 0
    )
    said = capsys.readouterr().out
    assert "a.jpg: 2 picks of 2 points; not in the list, left out: off" in said
    a, b = (project.load_correspondences(f"{name}.jpg") for name in "ab")
    assert a.names == ("nose", "left ear")
    assert a.xyz_in_world.tolist() == [[1.5, -2.25, 0.125], [4, 3, 5]]
    assert a.xy_px.tolist() == [[10.5, 20], [3, 4]]
    assert b.names == ("own", "nose")
    assert b.xyz_in_world.tolist() == [[7, 7, 7], [1.5, -2.25, 0.125]]
    assert project.load_correspondences("c.jpg") is None


def test_picks_without_points_say_what_is_missing(project, capsys):
    """Until the list is imported the file is no whole one; json tells the same as the words."""
    path = project.root.parent / "scan_picked_points.pp"
    assert main(["import", str(project.root), str(path)]) == 2
    assert "u,v,name" in capsys.readouterr().err
    (project.root / "correspondences/a.csv").write_text("u,v,name\n1,2,mouth\n")
    assert main(["import", str(project.root), str(path)]) == 2
    (project.root / "correspondences/b.csv").write_text("u,v,name\n1,2,nose\n")
    assert main(["import", str(project.root), str(path), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["photos"] == {"a.jpg": 0, "b.jpg": 1}
    assert told["unknown"] == {"a.jpg": ["mouth"]}


def test_unusable_picks_stop_no_others(project, capsys):
    """A broken file, and two files of one photo: told by photo, and both stay as they are."""
    path, folder = project.root.parent / "scan_picked_points.pp", project.picks
    (folder / "a.csv").write_text("u,v,name\nhigh,2,nose\n")
    (folder / "c.csv").write_text("u,v,name\n1,2,nose\n")
    (folder / "c.CSV").write_text("u,v,name\n1,2,nose\n")
    assert main(["import", str(project.root), str(path)]) == 2
    (folder / "b.csv").write_text("u,v,name\n1,2,nose\n")

    assert main(["import", str(project.root), str(path)]) == 1
    said = capsys.readouterr()
    assert "b.jpg: 1 picks of 2 points" in said.out
    assert "a.jpg: FAILED" in said.out + said.err and "c.jpg: FAILED" in said.out + said.err
    assert (folder / "a.csv").read_text() == "u,v,name\nhigh,2,nose\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<a/>", "not a file of MeshLab's picked points"), ("", "not XML"),
        ("<PickedPoints/>", "holds no point"),
        ('<PickedPoints><point x="1" y="nan" z="2"/></PickedPoints>', "must be numbers"),
        (PP.replace("left ear", "nose"), "two points have this name"),
    ],
)  # fmt: skip
def test_broken_lists_are_one_sentence(project, text, words, capsys):
    path = project.root.parent / "b.pp"
    path.write_text(text)
    assert main(["import", str(project.root), str(path)]) == 2
    assert words in capsys.readouterr().err
