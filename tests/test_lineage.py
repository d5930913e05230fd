"""What a registration rests on: photos found through others, and the way back from refinement."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from texproj.cli import main
from texproj.photo import Correspondences
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.stages.lineage import in_order
from texproj.stages.neighborhood import Behind


def command(capsys, *words) -> dict:
    capsys.readouterr()
    main([*map(str, words), "--json"])
    return json.loads(capsys.readouterr().out)


def photos_of(told: dict) -> dict[str, dict]:
    return {photo["file"]: photo for photo in told["photos"]}


def stale(folder: Path, capsys, stage: str = "register") -> dict[str, str]:
    """What `status` calls stale, and why."""
    items = command(capsys, "status", folder)["items"]
    return {s["item"]: s["reason"] for s in items if s["stage"] == stage and not s["fresh"]}


def edited(folder: Path, change) -> None:
    path = folder / "cameras.json"
    data = json.loads(path.read_text())
    for photo in data["photos"]:
        change(photo)
    path.write_text(json.dumps(data))


@pytest.fixture(scope="module")
def registered(demo_folder, tmp_path_factory):
    """Two photos by picks, another by what it shows of the same surface."""
    folder = Path(shutil.copytree(demo_folder, tmp_path_factory.mktemp("lineage") / "stele"))
    (folder / "cameras.json").unlink()
    (folder / "photos" / "IMG_0003.jpg").unlink()  # too far from the others to be found
    main(["register", str(folder)])
    return folder


@pytest.fixture(scope="module")
def refined_once(registered, tmp_path_factory):
    folder = Path(shutil.copytree(registered, tmp_path_factory.mktemp("refined") / "stele"))
    main(["refine", str(folder)])
    return folder


@pytest.fixture
def folder(registered, tmp_path):
    return Path(shutil.copytree(registered, tmp_path / "stele"))


@pytest.fixture
def refined(refined_once, tmp_path):
    return Path(shutil.copytree(refined_once, tmp_path / "stele"))


def shift_picks(folder: Path, by_px: float) -> str:
    """Move all picks of the first picked photo, as if it had been cropped; returns its name."""
    project = Project.open(folder)
    name = next(n for n in project.photo_names if project.correspondences_path(n).is_file())
    picks = project.load_correspondences(name)
    project.save_correspondences(name, Correspondences(picks.xy_px + by_px, picks.xyz_in_world))
    return name


# --- photos found through others


def test_a_photo_found_through_others_is_redone_when_one_of_them_moves(folder, capsys):
    """Picks of one photo change: it and what was found through it are stale, and both are redone;
    then everything is fresh.
    """
    before = Project.open(folder).load_cameras()
    found = [n for n, entry in before.items() if entry.method == "features"]
    picked = shift_picks(folder, 9.0)

    assert found and set(stale(folder, capsys)) >= {picked, *found}
    redone = [n for n, p in photos_of(command(capsys, "register", folder)).items() if not p["kept"]]
    after = Project.open(folder).load_cameras()

    assert {picked, *found} <= set(redone)
    assert all(np.abs(after[n].pose.t - before[n].pose.t).max() > 0 for n in found)
    command(capsys, "register", folder)
    assert stale(folder, capsys) == {}


def test_picks_that_change_nothing_redo_no_other_photo(folder, capsys):
    """What counts is where the other photo was found, not when."""
    found = [n for n, e in Project.open(folder).load_cameras().items() if e.method == "features"]
    picked = next((folder / "correspondences").iterdir())
    picked.write_text(picked.read_text() + "\n")
    photos = photos_of(command(capsys, "register", folder))

    assert not photos[f"{picked.stem}.jpg"]["kept"]
    assert found and all(photos[name]["kept"] for name in found)


def test_what_was_found_through_a_photo_stays_when_that_is_left_out(folder, capsys):
    """It was found all the same; nothing is registered anew."""
    entries = json.loads((folder / "cameras.json").read_text())["photos"]
    through = next(e["quality"]["through"] for e in entries if e["quality"].get("through"))
    (folder / "project.toml").write_text(f"exclude = [{json.dumps(through[0])}]\n")

    assert stale(folder, capsys) == {}


def test_refinement_makes_no_registration_stale(refined, capsys):
    """Refined cameras differ from those through which a photo was found; those are remembered."""
    assert stale(refined, capsys) == {}


def test_a_replaced_picture_counts_too(folder, capsys):
    """The features were those of the picture that is not there any more."""
    project = Project.open(folder)
    entry = next(e for e in project.load_cameras().values() if e.method == "features")
    other = project.photo_path(entry.quality["through"][0])
    other.write_bytes(other.read_bytes() + b"\0")

    assert entry.file in stale(folder, capsys)


def found(name: str, *through: str) -> CameraRecord:
    quality = {"through": list(through)}
    return CameraRecord(name, 4, 3, None, None, "prior", "features", quality, sought=True)


def test_no_photo_rests_on_itself():
    """c was found through b, b through a: neither may prove a; a circle by hand is survived."""
    entries = {"a": found("a"), "b": found("b", "a"), "c": found("c", "b"), "d": found("d")}
    circle = {"a": found("a", "b"), "b": found("b", "a")}

    assert Behind(entries.values()).of("a") == {"b", "c"}
    assert in_order(["c", "d", "b", "a"], entries) == ["d", "a", "b", "c"]
    assert in_order(["a", "b"], circle) == ["a", "b"]
    assert Behind(circle.values()).of("a") == {"a", "b"}


# --- refinement switched off later


def off(folder: Path) -> None:
    (folder / "project.toml").write_text("[refine]\nenabled = false\n[color]\nto = 'vertices'\n")


def cameras(folder: Path) -> dict[str, tuple]:
    entries = Project.open(folder).load_cameras()
    return {n: (e.pose.t.tolist(), e.intrinsics) for n, e in entries.items() if e.pose}


def test_refinement_switched_off_goes_back(refined, registered, capsys):
    """The cameras are those before, bit for bit; status foretells it, run and the report say it."""
    moved = [n for n, c in cameras(registered).items() if cameras(refined)[n] != c]
    off(refined)
    assert "own registration" in stale(refined, capsys, "refine")["all photos"]
    told = command(capsys, "run", refined)

    assert moved and sorted(told["unrefined"]) == moved
    assert cameras(refined) == cameras(registered)
    assert "before_refine" not in (refined / "cameras.json").read_text()
    assert "switched off" in json.loads((refined / "out/report.json").read_text())["refinement"]
    assert stale(refined, capsys, "refine") == stale(refined, capsys) == {}
    assert command(capsys, "run", refined)["unrefined"] == []


def test_what_was_edited_since_the_refinement_stays(refined, registered, capsys):
    """A camera corrected by hand is not undone; a note beside an undone one is kept."""
    first, *others = cameras(refined)

    def change(photo):
        photo["note"] = "mine"
        if photo["file"] == first:
            photo["t"] = [value + 0.01 for value in photo["t"]]

    edited(refined, change)
    moved = cameras(refined)[first]
    off(refined)
    command(capsys, "run", refined)
    entries = Project.open(refined).load_cameras()

    assert cameras(refined)[first] == moved
    assert all(cameras(refined)[name] == cameras(registered)[name] for name in others)
    assert all(entry.extra["note"] == "mine" for entry in entries.values())


def test_a_refinement_on_request_stays_though_run_would_not_refine(registered, tmp_path, capsys):
    """`texproj refine` always refines; `run` does not undo what was asked for."""
    folder = Path(shutil.copytree(registered, tmp_path / "stele"))
    off(folder)
    command(capsys, "refine", folder)
    moved = cameras(folder)

    assert command(capsys, "run", folder)["unrefined"] == []
    assert cameras(folder) == moved != cameras(registered)


def test_notes_survive_a_second_refinement(refined, capsys):
    """What people write into a refined entry is kept when it is refined anew."""
    edited(refined, lambda photo: photo.update(note="mine"))
    picks = next((refined / "correspondences").iterdir())
    picks.write_text(picks.read_text() + "\n")
    command(capsys, "register", refined)
    command(capsys, "refine", refined)

    assert all(e.extra["note"] == "mine" for e in Project.open(refined).load_cameras().values())


# --- what `refine` says


def test_refine_says_what_it_did_and_then_that_nothing_changed(folder, capsys):
    """ "moved by" is for cameras that moved; a second time nothing did."""
    capsys.readouterr()
    main(["refine", str(folder)])
    first = capsys.readouterr().out
    main(["refine", str(folder)])
    second = capsys.readouterr().out

    assert first.count("moved by") >= 2 and "fresh" not in first
    assert "moved by" not in second and "fresh, kept" in second


def test_refine_says_that_photos_show_different_sides(folder, capsys):
    """Two photos from opposite sides have nothing to compare: each is named, nothing fails."""
    names = list(cameras(folder))[:2]
    truth = json.loads((folder / "truth/cameras.json").read_text())["photos"]
    given = [photo for photo in truth if photo["file"] in names]
    center = Project.open(folder).load_mesh().mesh.center
    turn = np.diag([-1.0, -1.0, 1.0])  # half a turn about the upright axis through the piece
    R, t = np.array(given[0]["R"]), np.array(given[0]["t"])
    given[1] |= {"R": (R @ turn).tolist(), "t": (t + R @ (center - turn @ center)).tolist()}
    given[1] |= {key: given[0][key] for key in ("K", "dist", "width", "height")}
    cameras_file = {"format": "texproj-cameras", "version": 1, "photos": given}
    (folder / "cameras.json").write_text(json.dumps(cameras_file))
    capsys.readouterr()

    assert main(["refine", str(folder)]) == 0
    out = capsys.readouterr().out
    assert all(f"{name}: stays as it is" in out for name in names) and "moved" not in out
