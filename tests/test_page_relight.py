"""The page shows the recovered surface in another light."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from browsing import opened, picture, settle, until, violations
from page_tools import with_packages
from preview_project import running

from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.errors import InputError
from texproj.formats.models import write_ply
from texproj.options import PreviewOptions
from texproj.preview.lights import lights
from texproj.preview.materials import material_table
from texproj.preview.session import Session
from texproj.project import Project
from texproj.stages.relighting import SKY_LUX

GRAY = 188
"""sRGB of linear .5."""
MATERIAL = {
    "name": "material_0", "metallic": True, "roughness": 0.1, "f0": None, "share": 1.0,
    "base_color": [0.5, 0.5, 0.5], "luminance": 0.5,
}  # fmt: skip
UNLIT = 8
"""A pixel no brighter than this got no light."""
SMALL = 820, 420
"""Pixels of the window: what lights a surface is drawn slowly without a card."""


def write_surface(folder, roughness, metallic):
    """What `appearance` and `color` would have written: gray, photographed in red."""
    source = Project.open(folder).load_mesh()
    rgb = np.full((len(source.source_vertices), 3), GRAY, np.uint8)
    given = source.source_vertices, source.source_faces
    one = np.ones(len(rgb), np.float32)
    values = {"roughness": roughness * one, "metallic": metallic * one, "confidence": one}
    write_ply(folder / "out/appearance.ply", *given, rgb, None, (), values)
    write_ply(folder / "out/model.ply", *given, rgb * np.uint8([1, 0, 0]), None)
    (folder / "out/materials.json").write_text(json.dumps([MATERIAL]))


@pytest.fixture
def root(page_template, tmp_path):
    """The blocks, of which `appearance` found that they are gray, matte, under a sky and a sun."""
    folder = Path(shutil.copytree(page_template, tmp_path / "blocks"))
    (folder / "out").mkdir()
    write_surface(folder, 1.0, 0.0)
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
    shown = np.array(told["skies"]["photographed"][0]) / (OPEN_GAINS[0] * np.r_[2, 1, 1])
    np.testing.assert_allclose(np.array(told["sun"]["irradiance"]) / 3, shown)
    assert told["sun"]["direction"] == [0.0, 0.6, 0.8]
    assert abs(up @ told["front"]) < 1e-9
    np.testing.assert_allclose(np.cross(told["right"], told["up"]), told["front"], atol=1e-9)
    for broken in ("[", "{}", '{"sky": [[1, 2, NaN]], "sun": null}'):
        (root / "out/light.json").write_text(broken)
        told = lights(session.project, session.surface)
        assert (told["sun"], list(told["skies"])) == (None, ["overcast"])


def test_materials_that_cannot_be_are_refused(root):
    session = Session(root, PreviewOptions())
    assert material_table(session.project) == [MATERIAL]
    path = root / "out/materials.json"
    for broken in ("{}", "[1]", json.dumps([MATERIAL | {"roughness": None}]), "["):
        path.write_text(broken)
        with pytest.raises(InputError, match=r"materials\.json"):
            material_table(session.project)
    path.unlink()
    assert material_table(session.project) == []


def light(page, **choice):
    """The picture in a light."""
    page.evaluate("choice => texproj.relight.change(choice)", choice)
    settle(page)
    return picture(page).astype(int)


def test_the_sun_stands_where_the_dial_says(root, browser):
    """From the front most is lit; from the right the blocks shade each other and the
    plate; a warm sun is red; the dial is moved by keys; the sky alone leaves hardly anything black.
    """
    with running(root) as home, opened(browser, home, *SMALL) as page:
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


def red_and_blue(path):
    """A picture of all directions: red to the right, blue to the left."""
    rgb = np.zeros((32, 64, 3), np.float32)
    rgb[:, 32:, 0] = rgb[:, :32, 2] = 500
    cv2.imwrite(str(path), rgb[..., ::-1])
    return path


def test_a_picture_lights_the_surface_and_is_mirrored(root, browser, tmp_path):
    """Polished metal shows the red of the right or the blue of the left, not their mean; beside it,
    left of the wipe, is what was photographed; each material has a sphere with its numbers; what is
    no picture is told.
    """
    write_surface(root, 0.1, 1.0)
    with running(root) as home, opened(browser, home, *SMALL) as page:
        page.locator('[data-layer="relit"]').click()
        until(page, "texproj.look.layer === 'relit'")
        page.evaluate("texproj.look.frustums = false, texproj.applyLook()")
        assert page.locator("#materials li").inner_text().startswith("Metal, 100 %")
        page.set_input_files("#sky-file", red_and_blue(tmp_path / "sky.hdr"))
        until(page, "texproj.relight.choice.sky === 'picture'")
        shown = light(page, sun=False, tone="none")
        seen = shown.max(axis=2) > 100
        either = np.abs(shown[seen][:, 0] - shown[seen][:, 2]) > 60
        assert either.mean() > 0.8
        page.get_by_label("As photographed | relit").check()
        until(page, "texproj.viewport.beside === 'photographed'")
        settle(page)
        half = picture(page).astype(int)[:, : shown.shape[1] // 2 - 4]
        lit = half.max(axis=2) > 100
        assert (half[lit][:, 1:].max(axis=1) < 20).mean() > 0.95
        (tmp_path / "sky.hdr").write_bytes(b"no picture")
        page.set_input_files("#sky-file", tmp_path / "sky.hdr")
        page.get_by_text("sky.hdr cannot be read as a picture of light").wait_for()
