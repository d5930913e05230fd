"""The page on a large mesh: the light one at first, all of it when somebody asks for it."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from browsing import opened, picture, settle, until
from preview_project import running

from texproj.preview import geometry
from texproj.project import Project
from texproj.register.block import light_mesh


@pytest.fixture
def root(page_template, tmp_path, monkeypatch):
    """A project whose mesh counts as large."""
    monkeypatch.setattr(geometry, "LARGE_FACES", 2_000)
    monkeypatch.setattr(light_mesh, "MOST_FACES", 2_000)
    monkeypatch.setattr(light_mesh, "LIGHT_FACES", 6_000)
    return Path(shutil.copytree(page_template, tmp_path / "blocks"))


def test_a_large_mesh_is_fetched_light_and_whole_only_on_request(browser, root):
    """Both show the same but for detail; a layer has its colors on both."""
    faces = len(Project.open(root).load_mesh().mesh.faces)
    with running(root) as home, opened(browser, home) as page:
        fetched = []
        page.on("request", lambda request: fetched.append(request.url.removeprefix(home)))
        page.reload()
        page.wait_for_selector("body[data-ready=true]", timeout=30_000)
        page.locator('[data-layer="ao"]').click()
        until(page, "texproj.look.layer === 'ao'")
        settle(page)
        light = picture(page).astype(np.float32)
        shown = page.evaluate("texproj.viewport.surface.shownFaces")
        assert "/api/mesh/first" in fetched
        assert "/api/mesh/full" not in fetched
        assert f"{faces:,} faces" in page.locator("#project-facts").inner_text()

        page.get_by_role("button", name=f"Show all {faces:,}").click()
        until(page, "texproj.viewport.surface.whole && !document.getElementById('show-whole')")
        settle(page)
        whole = picture(page).astype(np.float32)
        assert page.evaluate("texproj.viewport.surface.shownFaces") == faces > shown
        assert whole.std() > 20
        ground = whole[0, 0]
        assert np.mean((whole == ground).all(axis=2) != (light == ground).all(axis=2)) < 0.02
        coarse = [cv2.resize(one, (24, 24), interpolation=cv2.INTER_AREA) for one in (whole, light)]
        assert np.abs(coarse[0] - coarse[1]).mean() < 8
