"""Where the photos fit the mesh in several places: the question, the answer, and what follows."""

import json

import cv2
import numpy as np
import pytest
from preview_project import HEIGHT, WIDTH, blocks, cameras
from turned_places import ask_about, turned

from texproj.cli import main
from texproj.errors import UsageError
from texproj.project import Project
from texproj.records import PROOF
from texproj.stages.bench import Workbench
from texproj.stages.choosing import choose, open_question, questions, told_of
from texproj.stages.lineage import registration_freshness
from texproj.stages.registering import register_photos
from texproj.stages.story import story_of

RIGHT, WRONG = 2, 1


@pytest.fixture
def asked(tmp_path):
    """A project of four photos without cameras, and the question which of two places is right;
    the second is."""
    true = cameras()
    for folder in ("mesh", "photos"):
        (tmp_path / "blocks" / folder).mkdir(parents=True)
    blocks().export(tmp_path / "blocks/mesh/blocks.ply")
    for k in range(len(true)):
        plain = np.full((HEIGHT, WIDTH), 100 + k, np.uint8)
        cv2.imwrite(str(tmp_path / f"blocks/photos/{k:04d}.png"), plain)
    project = Project.open(tmp_path / "blocks")
    ask_about(project, [[turned(camera) for camera in true], true])
    return project, dict(zip(project.photo_names, true, strict=True))


def register(project):
    with Workbench(Project.open(project.root)) as bench:
        return register_photos(bench)


def test_the_place_that_was_chosen_is_taken(asked):
    """Without any new search: each photo is exactly there, says so, and a second run keeps it."""
    project, true = asked
    choose(project, RIGHT)
    outcomes = register(project)
    records = project.load_cameras()

    assert all(o.reason == "placed where you said" for o in outcomes), [o.reason for o in outcomes]
    assert {r.method for r in records.values()} == {"block"}
    for name, camera in true.items():
        np.testing.assert_allclose(records[name].camera.pose.R, camera.pose.R, atol=1e-9)
        np.testing.assert_allclose(records[name].camera.pose.t, camera.pose.t, atol=1e-9)
        assert "your choice" in records[name].quality[PROOF]["by"]
    assert "placed as one block on the scan (where you said; structure 31%" in story_of(project)
    assert all(outcome.kept for outcome in register(project))


def test_whoever_chose_wrongly_chooses_again(asked):
    """The photos are stale, and go to the other place."""
    project, true = asked
    choose(project, WRONG)
    register(project)
    choose(project, RIGHT)
    assert not any(item.settled for item in registration_freshness(Project.open(project.root)))
    register(project)

    for name, record in project.load_cameras().items():
        np.testing.assert_allclose(record.camera.pose.R, true[name].pose.R, atol=1e-9)


def test_as_long_as_nobody_chose_it_is_told(asked, capsys):
    """By `status`, with what to do; not any more once somebody said that none is right."""
    project, _ = asked
    assert main(["status", str(project.root)]) == 0
    told = capsys.readouterr().out.splitlines()[-1]
    assert told.startswith(
        "two places fit 4 photos: 1 (33%), 2 (31%) of the mesh's structure; open"
    )
    assert told.endswith(f"choose, or `texproj place {project.root} 1`")
    assert main(["place", str(project.root), "0"]) == 0
    assert "pick 8 points" in capsys.readouterr().out

    assert told_of(project) == ""
    assert questions(project)[0].answer == 0


def test_an_answer_to_nothing_is_refused(asked):
    """There are two places; and none at all before any search."""
    project, _ = asked
    with pytest.raises(UsageError, match="no place 3: 1 to 2, 0 for none"):
        choose(project, 3)
    project.record_path("block", "places").unlink()
    with pytest.raises(UsageError, match="no places to choose from"):
        choose(project, 1)


def test_a_question_about_other_photos_is_none(asked):
    """One photo has changed since then; nobody could know what was seen in it."""
    project, _ = asked
    other = np.zeros((HEIGHT, WIDTH), np.uint8)
    cv2.imwrite(str(project.photo_path("0000.png")), other)

    changed = Project.open(project.root)
    assert questions(changed) == []
    with pytest.raises(UsageError, match="its mesh or photos have changed since"):
        choose(changed, 1)


@pytest.mark.parametrize("answer", [3, -1, "1 or 2", [1]])
def test_a_record_that_cannot_be_is_as_none(asked, answer):
    """Anybody may have been in work/."""
    project, _ = asked
    path = project.record_path("block", "places")
    record = json.loads(path.read_text())
    record["questions"][0]["answer"] = answer
    path.write_text(json.dumps(record))

    assert open_question(project) is None
    assert questions(project) == []


def test_picks_hold_the_block_and_not_the_choice(asked):
    """Where one of its photos is registered by other means, the choice is not taken."""
    from texproj.stages.choosing import chosen_fits

    project, true = asked
    choose(project, RIGHT)
    names = [*true]

    assert chosen_fits(project, names[1:], names[:1]) == {}
    assert set(chosen_fits(project, names, ())) == set(names)
