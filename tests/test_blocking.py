"""Nothing but photos and a mesh: the photos are placed all together, or refused together."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import synthetic_pair

from texproj.demo.views import disturbed
from texproj.errors import RegistrationError
from texproj.formats.cameras import read_cameras
from texproj.project import Project
from texproj.records import THROUGH
from texproj.stages import block_holding
from texproj.stages.bench import Workbench
from texproj.stages.block_fits import fit_of
from texproj.stages.blocking import place_together
from texproj.stages.partners import partners
from texproj.stages.progress import silent
from texproj.stages.registering import register_photos

STRANGER = "stranger.jpg"

pytest.importorskip("pycolmap", reason="COLMAP has no package for this machine")


def without_starts(sample, folder):
    """The sample with nothing but its photos and its mesh."""
    for name in ("mesh", "photos", "truth"):
        shutil.copytree(sample / name, folder / name)
    return Project.open(folder)


def truth_of(project):
    return {r.file: r for r in read_cameras(project.root / "truth/cameras.json").records}


def off_percent(project, cameras):
    """Mean distance of the surface from its true place, percent of the photo's width, by photo."""
    points, truth = project.load_mesh().mesh.vertices[::53], truth_of(project)
    found = {}
    for name, camera in cameras.items():
        moved = camera.project(points)[0] - truth[name].camera.project(points)[0]
        found[name] = 100 * float(np.linalg.norm(moved, axis=1).mean()) / camera.width
    return found


@pytest.fixture(scope="module")
def placed(sample, tmp_path_factory):
    """The sample registered without any start, with a photo of another stone among its own."""
    project = without_starts(sample, tmp_path_factory.mktemp("block") / "stele")
    other = synthetic_pair(1, "capital", seed=3, long_side=560).photos[0].pixels
    cv2.imwrite(str(project.root / "photos" / STRANGER), other[..., ::-1])
    project = Project.open(project.root)
    with Workbench(project) as bench:
        outcomes = register_photos(bench)
    return project, outcomes


def test_loose_photos_are_registered_without_a_click(placed):
    """All six, each within .8 % of the width, and that is how sure the block says it is."""
    project, outcomes = placed
    records = project.load_cameras()
    del records[STRANGER]
    off = off_percent(project, {name: r.registered_camera for name, r in records.items()})

    assert [outcome.name for outcome in outcomes if outcome.failed] == [STRANGER]
    assert len(records) == 6
    assert {record.method for record in records.values()} == {"block"}
    assert max(off.values()) < 0.8
    told = np.median([r.quality["expected_error_px"] / r.width * 100 for r in records.values()])
    assert 0.2 < told / np.median(list(off.values())) < 5


def test_a_second_run_compares_nothing_again(placed):
    """What was registered together is fresh together."""
    project, _ = placed
    with Workbench(Project.open(project.root)) as bench:
        assert all(outcome.kept for outcome in register_photos(bench))


def test_a_photo_of_another_place_is_left_out_and_says_so(placed):
    """It is in no block, is called failed, and tells why in one sentence; what the others share is
    known from now on.
    """
    project, outcomes = placed
    stranger = next(outcome for outcome in outcomes if outcome.name == STRANGER)

    assert stranger.reason.startswith("shows nothing that the registered photos show; leave it out")
    assert partners(project, STRANGER) == ()
    near = {partner.name: partner.matches for partner in partners(project, "IMG_0003.jpg")}
    assert min(near["IMG_0002.jpg"], near["IMG_0004.jpg"]) > 30


def test_one_registered_photo_holds_all_others(placed, sample, tmp_path):
    """The block goes where that photo puts it, and says through which photo it was found."""
    project = without_starts(sample, tmp_path / "stele")
    shutil.copytree(placed[0].work / "block", project.work / "block")  # features are known
    anchors = {"IMG_0003.jpg": truth_of(project)["IMG_0003.jpg"]}
    names = [name for name in project.photo_names if name not in anchors]
    with Workbench(project) as bench:
        found = place_together(bench, names, anchors, silent)
    off = off_percent(project, {name: fit.camera for name, fit in found.items()})

    assert list(found) == names
    assert all(fit.accepted for fit in found.values())
    assert {fit.quality[THROUGH][0] for fit in found.values()} == set(anchors)
    assert max(off.values()) < 1.0


def test_a_wrong_registration_pulls_no_other_along(placed, sample, tmp_path, monkeypatch):
    """One photo claims 3 px and is off by 25: the others are not put where it says but sought all
    over the mesh, and it is put there with them, and says why.
    """
    project = without_starts(sample, tmp_path / "stele")
    shutil.copytree(placed[0].work / "block", project.work / "block")
    true = truth_of(project)["IMG_0003.jpg"]
    points = project.load_mesh().mesh.vertices[::53]
    wrong = disturbed(true.camera, points, 25.0, np.random.default_rng(2))
    record = replace(true, pose=wrong.pose, quality={"expected_error_px": 3.0})
    names = [name for name in project.photo_names if name != "IMG_0003.jpg"]
    sought = []

    def searched(_bench, part, _calibrated, _progress):
        sought.append(part.names)
        fits = [fit_of(camera, part, k, 1.0, {}) for k, camera in enumerate(part.cameras)]
        return dict(zip(part.names, fits, strict=True))

    monkeypatch.setattr(block_holding, "searched", searched)
    with Workbench(project) as bench:
        found = place_together(bench, names, {"IMG_0003.jpg": record}, silent)

    assert [set(part) for part in sought] == [set(project.photo_names)]
    assert set(found) == set(project.photo_names)
    assert {name for name, fit in found.items() if fit.reason} == {"IMG_0003.jpg"}
    assert "not borne out by the other photos" in found["IMG_0003.jpg"].reason


def test_a_block_that_fits_nowhere_is_refused_together(placed, sample, tmp_path, monkeypatch):
    """No camera, and one sentence that says what to do. That another thing fits nowhere is a test
    of its own (tests/test_block_placement.py), and takes a minute here.
    """

    def nowhere(*_):
        raise RegistrationError("nothing fits (is it the same object? else pick 8 points)")

    project = without_starts(sample, tmp_path / "stele")
    shutil.copytree(placed[0].work / "block", project.work / "block")
    monkeypatch.setattr("texproj.stages.block_search.place_block", nowhere)
    with Workbench(project) as bench:
        outcomes = register_photos(bench)

    assert all(outcome.failed for outcome in outcomes)
    assert all("pick" in outcome.reason for outcome in outcomes)
    assert all(record.camera is None for record in project.load_cameras().values())


def test_two_photos_are_no_block(sample, tmp_path):
    """They say what there is to do."""
    project = without_starts(sample, tmp_path / "two")
    for name in project.photo_names[2:]:
        project.photo_path(name).unlink()
    with Workbench(Project.open(project.root)) as bench:
        outcomes = register_photos(bench)

    assert all("nothing to start from" in outcome.reason for outcome in outcomes)
