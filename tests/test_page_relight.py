"""The page shows the recovered surface in another light."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from browsing import opened, picture, settle, until, violations
from page_tools import with_packages
from preview_project import running

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.formats.models import write_ply
from texproj.options import PreviewOptions
from texproj.preview.lights import lights
from texproj.preview.session import Session
from texproj.project import Project
from texproj.stages.relighting import SKY_LUX

GRAY = 188
"""sRGB of linear .5."""
UNLIT = 8
"""A pixel no brighter than this got no light."""


@pytest.fixture
def root(page_template, tmp_path):
    """The blocks, of which `appearance` found that they are gray, under a sky and a sun."""
    folder = Path(shutil.copytree(page_template, tmp_path / "blocks"))
    source = Project.open(folder).load_mesh()
    rgb = np.full((len(source.source_vertices), 3), GRAY, np.uint8)
    (folder / "out").mkdir()
    write_ply(
        folder / "out/appearance.ply", source.source_vertices, source.source_faces, rgb, None, (),
        {"confidence": np.ones(len(rgb), np.float32)},
    )  # fmt: skip
    sky = np.zeros((9, 3))
    sky[0] = 2.0, 1.0, 1.0
    sun = {"sun": [0.0, 0.6, 0.8], "sun_irradiance": [3.0, 3.0, 3.0]}
    (folder / "out/light.json").write_text(json.dumps({"sky": sky.tolist(), **sun}))
    return folder


def test_the_skies_are_those_of_the_command(root):
    """Level ground gets as much light as `texproj relight` says, by nine numbers; the photos' own
    sky and sun are those of light.json, and none where that is broken."""
    session = Session(root, PreviewOptions())
    told = lights(session.project, session.surface)
    up = np.array(told["up"])
    on_ground = basis(up[None]) @ np.array(told["skies"]["overcast"])

    np.testing.assert_allclose(on_ground, SKY_LUX, rtol=0.05)
    np.testing.assert_allclose(told["skies"]["photographed"][0], OPEN_GAINS[0] * np.r_[2, 1, 1])
    assert told["sun"]["direction"] == [0.0, 0.6, 0.8]
    assert abs(up @ told["front"]) < 1e-9
    np.testing.assert_allclose(np.cross(told["right"], told["up"]), told["front"], atol=1e-9)
    for broken in ("[", "{}", '{"sky": [[1, 2, NaN]], "sun": null}'):
        (root / "out/light.json").write_text(broken)
        told = lights(session.project, session.surface)
        assert (told["sun"], list(told["skies"])) == (None, ["overcast"])


def light(page, **choice):
    """The picture in a light."""
    page.evaluate("choice => texproj.relight.change(choice)", choice)
    settle(page)
    return picture(page).astype(int)


def test_the_sun_stands_where_the_dial_says(root, browser):
    """From the front most is lit; from the right the blocks shade each other and the
    plate; a warm sun is red; the dial is moved by keys; the sky alone leaves hardly anything black.
    """
    with running(root) as home, opened(browser, home) as page:
        page.locator('[data-layer="relit"]').click()
        until(page, "texproj.look.layer === 'relit'")
        page.evaluate("texproj.look.frustums = false, texproj.applyLook()")
        sun = {"sky": "none", "sun": True, "tone": "none", "kelvin": 6500}
        front = light(page, **sun, height=0, heading=0)
        aside = light(page, **sun, height=12, heading=80)
        warm = light(page, **{**sun, "kelvin": 2500}, height=0, heading=0)
        cloudy = light(page, sky="overcast", sun=False, tone="filmic")
        black = [int((image.max(axis=2) < UNLIT).sum()) for image in (front, aside, cloudy)]
        lit = front.max(axis=2) > 100
        assert black[0] < 0.5 * lit.sum() < 0.6 * lit.sum() < black[1]
        assert black[2] < 0.02 * lit.sum()
        assert np.median(warm[lit][:, 0] - warm[lit][:, 2]) > 60
        assert abs(np.median(front[lit][:, 0] - front[lit][:, 2])) < 12
        light(page, height=20)
        heading = page.evaluate("texproj.relight.choice.heading")
        page.locator("#sun-dial").focus()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowUp")
        turned = page.evaluate("[texproj.relight.choice.heading, texproj.relight.choice.height]")
        assert turned == [heading + 5, 25]
        assert page.locator("#relight-ev").inner_text().startswith("EV ")
        page.get_by_label("Sky").select_option("photographed")
        height = np.degrees(
            np.arcsin(np.dot([0, 0.6, 0.8], page.evaluate("texproj.relight.lights.up")))
        )
        assert page.evaluate("texproj.relight.choice.height") == pytest.approx(height, abs=1e-6)
        with_packages()
        assert violations(page, "relit") == []
