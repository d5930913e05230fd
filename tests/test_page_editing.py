"""The page changes what the folder holds: photos left out, masks, settings; and gives it away."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from browsing import enter, opened, picture, row, settle, until
from preview_project import HEIGHT, WIDTH, running

from texproj.formats.models import write_ply
from texproj.preview import work
from texproj.project import Project

PHOTO = "0001.png"


@pytest.fixture
def root(page_template, tmp_path):
    """A fresh copy of the project."""
    return Path(shutil.copytree(page_template, tmp_path / "blocks"))


@pytest.fixture
def page(browser, root):
    with running(root) as home, opened(browser, home) as found:
        yield found


def test_a_photo_is_left_out_and_taken_back(root, page):
    """project.toml keeps its comments; the photo stays in the list under its filter."""
    (root / "project.toml").write_text("# my settings\n[color] # how\nbits = 8\n")
    row(page, PHOTO).click()
    row(page, PHOTO).locator(".leave-out").click()
    until(page, f"texproj.facts.excluded.includes('{PHOTO}')")
    assert PHOTO not in Project.open(root).photo_names
    assert "# my settings" in (root / "project.toml").read_text()
    page.get_by_label("Which photos").select_option("out")
    assert page.locator(".photo").count() == 1
    row(page, PHOTO).click()
    row(page, PHOTO).get_by_role("button", name="Take it back").click()
    until(page, "texproj.facts.excluded.length === 0")

    assert PHOTO in Project.open(root).photo_names
    assert page.get_by_text("No photo is like that.").is_visible()


def test_the_list_is_searched_and_sorted(shown):
    """By a part of the name; by name; by error, the largest first."""
    names = "[...document.querySelectorAll('.photo')].map(item => item.dataset.photo)"
    shown.get_by_label("Order of photos").select_option("name")
    assert shown.evaluate(names) == sorted(shown.evaluate(names))
    shown.get_by_label("Order of photos").select_option("error")
    assert shown.evaluate(names)[:2] == ["0002.png", "0001.png"]
    shown.get_by_label("Search photos").fill("3")

    assert shown.evaluate(names) == ["0003.png"]
    shown.get_by_label("Search photos").fill("")


def stroke(page, points):
    """Drag over pixels of the photo."""
    box = page.locator("#photo-canvas").bounding_box()
    places = [
        page.evaluate("uv => texproj.picking.pane.toScreen(uv)", list(point)) for point in points
    ]
    for k, (x, y) in enumerate(places):
        page.mouse.move(box["x"] + x, box["y"] + y, steps=1 if k == 0 else 4)
        if k == 0:
            page.mouse.down()
    page.mouse.up()


def painted(page, undo):
    until(page, f"!texproj.masks.busy && texproj.masks.facts?.undo === {undo}")


def mask_on_disk(root):
    return cv2.imread(str(root / "masks" / "0001.png"), cv2.IMREAD_UNCHANGED)


def test_a_mask_is_painted_grown_and_undone(root, page):
    """What is dragged over is 0 in masks/, the overlay shows it, Undo brings back no mask."""
    row(page, PHOTO).click()
    page.get_by_role("button", name="Paint a mask").click()
    until(page, "texproj.masks.facts")
    page.evaluate("texproj.masks.setRadius(10)")
    stroke(page, [(200, 150), (400, 150)])
    painted(page, 1)
    mask = mask_on_disk(root)
    assert mask.shape == (HEIGHT, WIDTH)
    assert (mask[145:156, 205:396] == 0).all()
    assert (mask[170:] == 255).all()
    assert 0.8 < (mask == 0).sum() / (200 * 20 + np.pi * 100) < 1.2
    page.get_by_role("button", name="Grow").click()
    painted(page, 2)
    assert (mask_on_disk(root)[132:168, 205:396] == 0).all()
    page.get_by_role("radio", name="Erase").click()
    stroke(page, [(300, 150), (300, 151)])
    painted(page, 3)
    assert (mask_on_disk(root)[145:155, 295:305] == 255).all()
    for undo in (2, 1, 0):
        page.locator("#mask-undo").click()
        painted(page, undo)
    assert not (root / "masks" / "0001.png").exists()


def test_settings_are_a_form(root, page):
    """Made from the options and their help; a bound is kept, what is changed stands in the file."""
    page.locator("#do-settings").click()
    bits = page.locator('[data-setting="color.bits"]')
    assert "Bits per channel" in bits.inner_text()
    bits.locator("select").select_option("16")
    bits.get_by_role("button", name="Default of Bits").wait_for()
    assert Project.open(root).settings.color.bits == 16
    density = page.locator('[data-setting="color.texels_per_pixel"] input')
    density.fill("99")
    density.press("Enter")
    page.get_by_text("less than or equal to 4").wait_for()
    assert Project.open(root).settings.color.texels_per_pixel < 8
    bits.get_by_role("button", name="Default of Bits").click()
    until(page, "document.querySelector('[data-setting=\"color.bits\"] button').hidden")
    assert "bits" not in (root / "project.toml").read_text()
    page.locator("summary").filter(has_text="Light").click()
    for axis, value in (("x", "0.06"), ("y", "-0.08"), ("z", "0")):
        field = page.get_by_label(f"Position, {axis}")
        field.fill(value)
        field.press("Tab")
    page.get_by_role("button", name="Default of Position").wait_for()
    assert Project.open(root).settings.light.position == (0.06, -0.08, 0)
    assert page.locator('[data-setting^="preview."]').count() == 0
    page.get_by_role("button", name="Close").click()
    page.locator("#make-to").select_option("patches")
    until(page, "texproj.facts.to === 'patches'")
    assert Project.open(root).settings.color.to == "patches"


def test_what_is_made_can_be_taken_away(root, page):
    """A picture of the view as PNG; the report opens without any right to ask the server."""
    with page.expect_download() as kept:
        page.locator("#take-picture").click()
    assert kept.value.suggested_filename == "blocks.png"
    assert cv2.imread(str(kept.value.path())).std() > 20
    (root / "out").mkdir()
    (root / "out/report.html").write_text("<title>told</title><body>All well.")
    link = page.get_by_role("link", name="Open the report")
    link.wait_for()
    with page.context.expect_page() as found:
        link.click()
    found.value.wait_for_load_state()
    assert found.value.title() == "told"
    asked = "fetch('/api/project').then(() => 'answered', () => 'refused')"
    assert found.value.evaluate(asked) == "refused"


def test_the_model_is_filmed_and_lit_from_nothing(root, page, monkeypatch):
    """As the commands do it: each is a button, and what came of it is at hand: the film to be
    downloaded, the surface without the light as a layer. Without a model there is no film."""
    source = Project.open(root).load_mesh()

    def film(bench, progress):
        progress("turntable", 1, 2, "")
        (bench.project.out / "turntable.webp").write_bytes(b"film")
        return "The film is made."

    def appearance(bench, progress):
        progress("appearance", 1, 2, "")
        rgb = np.full((len(source.source_vertices), 3), (200, 20, 20), np.uint8)
        seen = {"confidence": np.ones(len(rgb), np.float32)}
        path = bench.project.out / "appearance.ply"
        write_ply(path, source.source_vertices, source.source_faces, rgb, None, (), seen)
        return "The light is taken out."

    made = {"turntable": ("Film the model", film), "appearance": ("Take out", appearance)}
    monkeypatch.setattr(work, "STAGES", {**work.STAGES, **made})
    (root / "out").mkdir()
    assert page.locator("#film").is_disabled()
    page.locator("#do-more").click()
    page.locator("#do-appearance").click()
    until(page, "texproj.look.layer === 'base'")
    page.get_by_text("The light is taken out.").wait_for()
    settle(page)
    red, green, _ = picture(page)[300:500, 300:500].reshape(-1, 3).T
    assert np.median(red) == 200
    assert np.median(green) == 20
    (root / "out/model.obj").write_text("o model")
    until(page, "!document.querySelector('#film').disabled")
    page.locator("#film").click()
    with page.expect_download() as kept:
        page.get_by_role("link", name="Download film").click()
    assert kept.value.suggested_filename == "blocks.webp"


def test_the_plain_mean_is_a_layer(shown):
    """Made as a job; where no photo sees the surface it is hatched."""
    settle(shown)
    before = shown.evaluate("texproj.viewport.picture()")
    shown.locator('[data-layer="mean"]').click()
    until(shown, "texproj.look.layer === 'mean'")
    settle(shown)

    assert shown.evaluate("texproj.viewport.picture()") != before
    assert "a photo is off" in shown.locator("#legend").inner_text()


def test_other_photos_that_show_the_same_are_a_click_away(shown):
    """As far as it was found out which do."""
    shown.route("**/partners", lambda route: route.fulfill(json={"photos": ["0002.png"]}))
    enter(shown, PHOTO)
    shown.locator(".seen-also button").click()
    until(shown, "texproj.chosen === '0002.png'")
    shown.unroute_all(behavior="wait")
