"""projects/stele, the sample: from loose photos to the model, in a copy of the folder."""

import json

import numpy as np
import pytest

from texproj.cli import main
from texproj.formats.cameras import read_cameras
from texproj.project import Project

PHOTOS = [f"IMG_{n:04d}.jpg" for n in range(1, 7)]


def off_px(found, true, points):
    """Mean distance of the surface's points between two cameras, pixels."""
    moved = found.project(points)[0] - true.project(points)[0]
    return float(np.linalg.norm(moved, axis=1).mean())


def test_picks_for_one_photo_register_all(stele):
    """Six of six, each within a pixel of the true camera and by the means that it has."""
    records = Project.open(stele).load_cameras()
    truth = {r.file: r.camera for r in read_cameras(stele / "truth/cameras.json").records}
    points = Project.open(stele).load_mesh().mesh.vertices[::53]

    assert {name: r.status for name, r in records.items()} == dict.fromkeys(PHOTOS, "registered")
    assert records["IMG_0003.jpg"].method == "points"
    assert records["IMG_0001.jpg"].method == "structure"
    assert max(off_px(records[n].camera, truth[n], points) for n in PHOTOS) < 1.0


def test_the_model_is_written_from_all_photos(stele):
    """Every kind of file that a run writes is there, and the report says from what."""
    color = json.loads((stele / "out/report.json").read_text())["color"]

    assert color["used"] == PHOTOS
    assert color["files"] == ["model.glb", "model.obj", "model.mtl", "model_0.png"]
    assert all((stele / "out" / name).is_file() for name in [*color["files"], "report.html"])


def test_a_second_run_does_nothing(stele, capsys):
    """All is fresh."""
    before = {path: path.stat().st_mtime_ns for path in (stele / "out").iterdir()}

    assert main(["run", str(stele)]) == 0
    assert "fresh" in capsys.readouterr().out
    model = stele / "out/model.glb"
    assert model.stat().st_mtime_ns == before[model]


def test_status_tells_what_became_of_the_photos(stele, capsys):
    """The sentence of the run, from what is kept."""
    assert main(["status", str(stele), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["story"]

    assert "4 photos overlap; placed as one block on the scan (held by IMG_000" in told
    assert "refined to" in told and "left out" not in told


def test_it_is_small(sample):
    """Everybody who clones gets it: less than 3 MB."""
    files = [path for path in sample.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 3_000_000


@pytest.mark.parametrize("name", ["work", "out"])
def test_nothing_that_is_made_stands_in_it(sample, name):
    """It is tried in a copy."""
    assert not (sample / name).exists()
