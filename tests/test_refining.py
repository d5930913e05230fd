"""The refine stage: what counts as fresh, and what a person writes into cameras.json meanwhile."""

import json
import shutil
from pathlib import Path

import pytest

from texproj.cli import main
from texproj.project import Project
from texproj.records import PROOF
from texproj.stages.entries import start_of
from texproj.stages.refining import refine_freshness


@pytest.fixture(scope="module")
def refined(demo_folder, tmp_path_factory):
    """A small project, two of its photos picked, registered and refined once."""
    folder = Path(shutil.copytree(demo_folder, tmp_path_factory.mktemp("refining") / "stele"))
    (folder / "photos" / "IMG_0003.jpg").unlink()  # hardly found from its start: a long search
    main(["register", str(folder)])
    main(["refine", str(folder)])
    return folder


@pytest.fixture
def folder(refined, tmp_path):
    return Path(shutil.copytree(refined, tmp_path / "stele"))


def refine_state(folder: Path, capsys) -> dict:
    """The refine stage's line of `status`."""
    capsys.readouterr()
    main(["refine", str(folder), "--json"])
    return json.loads(capsys.readouterr().out)


def entry(folder: Path, change) -> str:
    """Change the entry of the first photo that has picks; returns its name."""
    path = folder / "cameras.json"
    data = json.loads(path.read_text())
    picked = {p.stem for p in (folder / "correspondences").glob("*.csv")}
    photo = next(p for p in data["photos"] if Path(p["file"]).stem in picked)
    change(photo)
    path.write_text(json.dumps(data))
    return photo["file"]


def test_a_second_refinement_does_nothing(folder, capsys):
    """Fresh, and cameras.json stays byte for byte."""
    before = (folder / "cameras.json").read_bytes()

    assert refine_state(folder, capsys)["kept"]
    assert (folder / "cameras.json").read_bytes() == before
    assert refine_freshness(Project.open(folder), in_run=True).fresh  # as part of `run`, too


def test_what_was_refined_before_proofs_were_told_stays(folder, capsys):
    """A project of an earlier version: what was refined is not asked and refined at each run."""
    path = folder / "cameras.json"

    def without_proof(found):
        return {key: value for key, value in found.items() if key != PROOF}

    path.write_text(json.dumps(json.loads(path.read_text(), object_hook=without_proof)))
    for command in ("refine", "register", "refine"):
        main([command, str(folder)])
    kept = path.read_bytes()
    main(["register", str(folder)])

    assert refine_state(folder, capsys)["kept"]
    assert path.read_bytes() == kept


def test_a_registration_made_again_is_refined_again(folder, capsys):
    """Also where it gives the very same camera, so that color never uses unrefined ones."""
    name = sorted((folder / "correspondences").glob("*.csv"))[0]
    name.write_text(name.read_text() + "\n")
    main(["register", str(folder)])

    assert not refine_state(folder, capsys)["kept"]


def test_a_camera_given_in_place_of_a_failure_is_used(folder):
    """The advice of the message works: an entry of status prior is where the search starts."""

    def give(photo):
        photo.update(status="prior", t=[1.0, 2.0, 3.0], start=None)

    name = entry(folder, give)
    record = Project.open(folder).load_cameras()[name]

    assert start_of(record).pose.t.tolist() == [1.0, 2.0, 3.0]


def test_what_others_write_into_an_entry_is_kept(folder):
    """Foreign keys survive a new registration."""
    name = entry(folder, lambda photo: photo.update(note="by hand"))
    picks = folder / "correspondences" / f"{Path(name).stem}.csv"
    picks.write_text(picks.read_text() + "\n")
    main(["register", str(folder)])

    assert Project.open(folder).load_cameras()[name].extra["note"] == "by hand"
