"""Picking on the page beyond setting points: refused picks, other photos' points, Solve."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from browsing import TO_SOLVE, opened, pick_page, residuals, row, settle, until
from preview_project import cameras, corner_points, running

from texproj.photo import Correspondences
from texproj.preview.picking import fit_picks
from texproj.project import Project
from texproj.records import Fit
from texproj.stages import methods


@pytest.fixture
def root(page_template, tmp_path):
    """A fresh copy of the project."""
    return Path(shutil.copytree(page_template, tmp_path / "blocks"))


@pytest.fixture
def page(browser, root):
    with running(root) as home, opened(browser, home) as found:
        yield found


def put_picks(root, photo, number, noise_px=0.0, count=8, seed=1):
    """Picks of one of the photos, each off by about `noise_px`."""
    uv, xyz = corner_points(cameras()[number], count)
    off = np.random.default_rng(seed).normal(0, 1, uv.shape) * noise_px
    picks = Correspondences(uv + off, xyz)
    Project.open(root).save_correspondences(photo, picks)
    return picks


def test_a_refused_fit_still_tells_how_far_off_each_pick_is(root):
    """Of sloppy picks each has its residual, the reason is told once, nothing is accepted; without
    a pick, the fit is that of the others and the pick's residual is told all the same.
    """
    picks = put_picks(root, TO_SOLVE, 3, noise_px=5)
    project = Project.open(root)
    found = fit_picks(project, TO_SOLVE, picks)
    fewer = fit_picks(project, TO_SOLVE, picks, {"2"})

    assert not found["accepted"]
    assert "uncertain" in found["reason"]
    assert not found["reason"].startswith(TO_SOLVE)
    assert 1 < np.median(found["residual_px"]) < 15
    assert fewer["used"] == [name != "2" for name in picks.names]
    assert fewer["residual_px"][1] > 0
    assert fewer["residual_px"] != found["residual_px"]


def test_refused_picks_show_arrows_and_a_row_can_be_unticked(root, page):
    """Red verdict, worst first, an arrow at each; unticking tells the fit without the point."""
    put_picks(root, TO_SOLVE, 3, noise_px=5)
    pick_page(page)
    before = residuals(page)
    assert page.locator("#verdict").get_attribute("class") == "verdict bad"
    assert page.locator("#photo-marks line.residual").count() == 8
    shown = [
        float(cell.split()[0]) for cell in page.locator(".pairs td:nth-child(3)").all_inner_texts()
    ]
    assert shown == sorted(shown, reverse=True)
    page.locator('.pairs tr[data-pick="1"] input').uncheck()
    until(page, "texproj.picking.fit?.used[0] === false && !texproj.picking.fitting")

    assert residuals(page) != before
    assert "Without point 1" in page.locator("#verdict").inner_text()
    assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 8


def test_points_of_other_photos_are_proposed_and_enter_takes_them(root, page):
    """Once four points give a camera, what another photo has is proposed where it lies; Enter
    makes it a pick near the truth.
    """
    elsewhere = put_picks(root, "0000.png", 0, count=12, seed=5)
    put_picks(root, TO_SOLVE, 3, count=5)
    pick_page(page)
    until(page, "texproj.picking.live.proposals.length > 0")
    first = page.evaluate("texproj.picking.proposal")
    assert first["photo"] == "0000.png"
    assert any(np.allclose(first["xyz"], xyz) for xyz in elsewhere.xyz_in_world)
    assert page.locator("#photo-marks .mark.guess").count() >= 1
    page.locator("#photo-pane").focus()
    page.keyboard.press("Enter")
    until(page, "texproj.picking.picks.length === 6 && texproj.picking.saved === 'saved'")

    made = Project.open(root).load_correspondences(TO_SOLVE)
    seen = cameras()[3].project(made.xyz_in_world[-1:])[0][0]
    assert np.hypot(*(made.xy_px[-1] - seen)) < 4


def test_solve_goes_on_where_picks_are_refused(root, page, monkeypatch):
    """As Register does: structure from their rough camera. The panel then is green, and offers to
    find the photos that have no camera yet.
    """
    put_picks(root, TO_SOLVE, 3, noise_px=5)

    def found(job, start):
        assert job.name == TO_SOLVE
        assert np.isfinite(start.pose.t).all()
        ok = np.ones(4, bool)
        return Fit(cameras()[3], "structure", 0.7, np.zeros(4), ok, np.eye(6))

    monkeypatch.setattr(methods, "_from_camera", found)
    text = (root / "cameras.json").read_text()
    (root / "cameras.json").write_text(text.replace('"0002.png"', '"elsewhere.png"'))
    until(page, "texproj.unregistered === 2")
    pick_page(page)
    residuals(page)
    page.locator("#solve").click()
    until(page, f"texproj.facts.photos.find(p => p.name === '{TO_SOLVE}').status === 'registered'")
    page.locator("#verdict.good").wait_for()

    assert "from structure" in page.locator("#verdict").inner_text()
    assert "Find the other photo" in page.locator("#find-others").inner_text()
    assert Project.open(root).load_cameras()[TO_SOLVE].method == "structure"
    assert page.evaluate("(p => p.scrollWidth <= p.clientWidth)(document.querySelector('#panel'))")


def test_exposure_works_on_the_photo_too(page):
    """The slider of the picking panel brightens the photo and the list on linear light."""
    pick_page(page)
    slope = "document.querySelector('#exposed feFuncR').getAttribute('slope')"
    filtered = "getComputedStyle(document.querySelector('#photo-canvas')).filter"
    assert page.evaluate(filtered) == "none"
    page.get_by_role("slider", name="Exposure").fill("2")
    settle(page)

    assert float(page.evaluate(slope)) == 4
    assert "exposed" in page.evaluate(filtered)
    assert row(page, TO_SOLVE).is_visible()
