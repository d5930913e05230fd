"""The page while photos are placed all together: the best place so far; "is it here, or here?"."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from browsing import opened, picture, settle, until, violations
from page_tools import with_packages
from preview_project import cameras, running
from turned_places import ask_about, turned

from texproj.preview import work
from texproj.project import Project
from texproj.register.block.placed_block import PlacedBlock
from texproj.register.block.similarity import Similarity
from texproj.stages import drafting

BLUE = np.array([0x4F, 0xC3, 0xF7])


@pytest.fixture
def root(page_template, tmp_path):
    """Photos of which none has a camera; the last of them is a picture of normals."""
    folder = Path(shutil.copytree(page_template, tmp_path / "blocks"))
    for name in ("cameras.json", "photos/9999.jpg", "photos/0004.png"):
        (folder / name).unlink()
    return folder


@pytest.fixture
def asked(root):
    """The second of two places is right."""
    true = cameras()
    ask_about(Project.open(root), [[turned(camera) for camera in true], true])
    return root


def registered_only(monkeypatch):
    """What follows from a choice, without coloring."""
    monkeypatch.setattr(work, "_run", work._register)


def colored(image, color):
    """How many pixels have a color, about."""
    return int((np.abs(image.astype(int) - color).max(axis=2) < 40).sum())


def test_one_click_says_which_place_is_right(asked, browser, monkeypatch):
    """Both places are shown through the same photos, and as cameras; a picture of one leads into
    its view; after the click the photos are there, and the panel says why."""
    registered_only(monkeypatch)
    with running(asked) as home, opened(browser, home) as page:
        page.wait_for_selector("#places[data-filled=true]")
        settle(page)
        assert page.locator("#places th[scope=col]").all_inner_texts() == [
            "Place 1 33 %", "Place 2 31 %",
        ]  # fmt: skip
        assert page.locator("#start").is_hidden()
        assert colored(picture(page), BLUE) > 100
        means = page.evaluate(
            "[...document.querySelectorAll('canvas[data-look]')].map(c => c.getContext('2d')"
            ".getImageData(0, 0, c.width, c.height).data.reduce((a, b) => a + b) / c.height)"
        )
        assert len(set(means)) == 4
        page.get_by_label("Place 2 through 0000.png").click()
        page.wait_for_selector('body[data-overlay="0000.png 8192"]')
        settle(page)
        assert page.locator("#model-title").inner_text() == "Through 0000.png, place 2"
        assert page.evaluate("texproj.look.wipe") == 0.5
        with_packages()
        assert violations(page, "two places") == []
        page.get_by_label("It is here: place 2").click()
        until(page, "texproj.facts.photos.every(photo => photo.status === 'registered')")
        page.get_by_text("Placed where you said: place 2 of 2.").wait_for()
        assert page.locator("#places").is_hidden()
    found = Project.open(asked).load_cameras()
    for record, true in zip(found.values(), cameras(), strict=True):
        np.testing.assert_allclose(record.camera.center, true.center, atol=1e-6)


def test_none_of_the_places_may_be_right(asked, browser):
    """Nothing is registered then, and the page says what to do; it can be chosen again."""
    with running(asked) as home, opened(browser, home) as page:
        page.get_by_role("button", name="None of them").click()
        page.get_by_text("Pick 8 points in one photo.").first.wait_for()
        until(page, "document.querySelector('#places').hidden")
        assert page.locator("#start").is_visible()
        page.get_by_role("button", name="Not now").click()
        page.get_by_role("button", name="Choose again").click()
        page.wait_for_selector("#places:not([hidden])")
        page.get_by_role("button", name="Later").click()
        page.get_by_role("button", name="Choose the place").click()
        page.wait_for_selector("#places:not([hidden])")


def test_the_best_place_so_far_is_shown_while_the_photos_are_placed(root, browser):
    """Its cameras and points come into the view, whoever works on the project, and go."""
    project = Project.open(root)
    part = SimpleNamespace(
        names=tuple(project.photo_names), cameras=tuple(cameras()), points=np.zeros((400, 3))
    )
    project.features_path()  # makes the folder, as comparing the photos does before
    best = SimpleNamespace(placed=PlacedBlock(Similarity.identity()), support=0.2)
    with running(root) as home, opened(browser, home) as page:
        page.get_by_role("button", name="Not now").click()
        settle(page)
        assert colored(picture(page), BLUE) == 0
        with drafting.Draft(project, part) as draft:
            draft.show(best)
            draft.show(best)  # too soon to be written again
            until(page, "texproj.places.group.children.length === 2")
            settle(page)
            assert colored(picture(page), BLUE) > 100
        until(page, "texproj.places.group.children.length === 0")


def test_a_draft_that_is_none_is_not_shown(root):
    """Anybody may have been in work/."""
    project = Project.open(root)
    path = project.record_path("block", "now")
    path.parent.mkdir(parents=True)
    for told in ({"inputs": {}}, {"inputs": {}, "support": 1, "cameras": [{"file": 3}]}, [1]):
        path.write_text(json.dumps(told))
        assert drafting.draft_of(project) is None
