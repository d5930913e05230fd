"""The page in a real browser: what a person sees and does, by real mouse and keyboard events."""

import shutil
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from browsing import (
    CHECKOUT,
    LENS_PHOTO,
    TO_SOLVE,
    WINDOW,
    click_pairs,
    enter,
    model_place,
    opened,
    photo_place,
    pick_page,
    picture,
    residuals,
    row,
    saved,
    settle,
    until,
    violations,
    visible_pairs,
)
from page_tools import with_packages
from preview_project import BROKEN, cameras, corner_points, running

from texproj.preview import work
from texproj.project import Project

GOLDEN = Path(__file__).parent / "golden"


@pytest.fixture
def root(page_template, tmp_path):
    """A fresh copy of the project."""
    return Path(shutil.copytree(page_template, tmp_path / "blocks"))


@pytest.fixture
def page(browser, root):
    with running(root) as home, opened(browser, home) as found:
        yield found


@pytest.fixture
def wide(shown):
    """The same page, larger: two pixels and more for each of a photo's."""
    shown.set_viewport_size({"width": 1280, "height": 600})
    yield shown
    shown.set_viewport_size(dict(zip(("width", "height"), WINDOW, strict=True)))


# --- seeing


@pytest.fixture
def on_a_desk(browser, root):
    """A page in a window of usual size."""
    with running(root) as home, opened(browser, home, 1280, 800) as found:
        yield found


def test_the_page_shows_the_model(on_a_desk):
    """No error on the console; the canvas shows the golden picture (llvm-free software WebGL).

    A new golden picture: delete tests/golden/preview.png and run this test.
    """
    settle(on_a_desk)
    found = picture(on_a_desk)
    found = cv2.resize(found, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    path = GOLDEN / "preview.png"
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), found[..., ::-1])
        pytest.fail(f"wrote {path}: look at it, and keep it if it is right")
    golden = cv2.imread(str(path))[..., ::-1]

    assert found.shape == golden.shape
    off = np.abs(found.astype(int) - golden).max(-1)
    assert (off > 8).mean() < 0.005
    assert found.std() > 20


def test_photos_are_listed_worst_first_with_what_to_do(shown):
    """The broken one first, then what has no camera, then by expected error."""
    names = [r.get_attribute("data-photo") for r in shown.locator(".photo").all()]

    assert names[:2] == [BROKEN, TO_SOLVE]
    assert names.index("0002.png") < names.index("0001.png") < names.index("0000.png")
    assert "cannot" in row(shown, BROKEN).inner_text().lower()
    assert "Replace the file" in row(shown, BROKEN).inner_text()
    assert "Pick 8 points" in row(shown, "0002.png").inner_text()


def photo_and_model(page):
    """The two pictures that a blink shows."""
    page.evaluate("texproj.change({ opacity: 1, wipe: 1 })")
    photo = picture(page)
    page.evaluate("texproj.change({ opacity: 0 })")
    return photo, picture(page)


def tile_shifts(a, b, tile):
    """Shift in pixels of each tile that holds enough structure, by phase correlation."""
    gray = [cv2.cvtColor(i, cv2.COLOR_RGB2GRAY).astype(np.float32) for i in (a, b)]
    window = cv2.createHanningWindow((tile, tile), cv2.CV_32F)
    shifts = []
    for y in range(0, gray[0].shape[0] - tile, tile):
        for x in range(0, gray[0].shape[1] - tile, tile):
            parts = [g[y : y + tile, x : x + tile] for g in gray]
            if min(p.std() for p in parts) > 15:
                shift, response = cv2.phaseCorrelate(*parts, window)
                if response > 0.3:
                    shifts.append(np.hypot(*shift))
    return np.array(shifts)


def canvas_scale(page):
    """Canvas pixels per photo pixel."""
    return page.evaluate(
        "texproj.viewport.window.scale / texproj.viewport.photoCamera.f[0]"
        " * texproj.viewport.canvas.width / texproj.viewport.size[0]"
    )


def test_the_overlay_lies_on_the_model_to_half_a_pixel(wide):
    """The server's own rendering of normals, through a strong lens and an off-center principal
    point, covers the page's normals: every tile within 0.5 px of the photo, whole and zoomed in.
    """
    wide.keyboard.press("4")
    enter(wide, LENS_PHOTO)
    whole = tile_shifts(*photo_and_model(wide), 192)
    scale = canvas_scale(wide)

    assert len(whole) >= 10
    assert whole.max() / scale < 0.5
    for corner in ((0.35, 0.45), (0.65, 0.6)):
        wide.evaluate("texproj.viewport.fitPhoto()")
        wide.evaluate(
            "([x, y]) => { const [w, h] = texproj.viewport.size;"
            " texproj.viewport.zoomPhoto(3, [x * w, y * h]); }",
            corner,
        )
        settle(wide)
        pictures = photo_and_model(wide)
        factor = 2 / canvas_scale(wide)  # back to two pixels each: the photo has no more to say
        smaller = [
            cv2.resize(p, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            for p in pictures
        ]
        zoomed = tile_shifts(*smaller, 144)
        assert len(zoomed) >= 4
        assert zoomed.max() / 2 < 0.5


def test_a_shifted_overlay_would_be_noticed(wide):
    """The measure above sees half a pixel: a camera moved by 1 px fails it."""
    wide.keyboard.press("4")
    enter(wide, LENS_PHOTO)
    move = "c => { c.c[0] += %d; texproj.viewport.overlay.setCamera(c); }"
    wide.evaluate(f"({move % 1})(texproj.viewport.photoCamera)")
    shifts = tile_shifts(*photo_and_model(wide), 192)
    wide.evaluate(f"({move % -1})(texproj.viewport.photoCamera)")
    scale = canvas_scale(wide)

    assert np.median(shifts) / scale == pytest.approx(1, abs=0.25)


def test_the_lens_in_the_page_is_the_lens_of_the_package(shown):
    """Pixels of surface points agree to 1e-6 px; rays through pixels are their inverse."""
    _, xyz = corner_points(cameras()[1], 10)
    camera = "texproj.facts.photos.find(p => p.name === '0001.png').camera"
    shown.evaluate("() => texproj.view(texproj.facts.photos.find(p => p.name === '0001.png'))")
    settle(shown)
    seen = [
        shown.evaluate(f"p => texproj.lens.project({camera}, p)", point.tolist()) for point in xyz
    ]
    assert np.allclose(seen, cameras()[1].project(xyz)[0], atol=1e-6)
    back = [shown.evaluate(f"p => texproj.lens.ideal({camera}, ...p)", uv) for uv in seen]
    k = cameras()[1].intrinsics
    expected = k.undistort((np.array(seen) - (k.cx, k.cy)) / (k.fx, k.fy))
    assert np.allclose(back, expected, atol=1e-9)


def test_blink_and_escape(shown):
    """Into a photo the view flies; Space shows the model alone and the photo again; Escape goes
    back to orbiting.
    """
    shown.emulate_media(reduced_motion="no-preference")
    enter(shown, "0000.png")
    first = picture(shown)
    shown.keyboard.press("Space")
    second = picture(shown)
    shown.keyboard.press("Space")

    assert np.abs(first.astype(int) - second).mean() > 5
    assert np.array_equal(picture(shown), first)
    shown.keyboard.press("Escape")
    assert shown.evaluate("texproj.viewport.photoCamera") is None
    shown.emulate_media(reduced_motion="reduce")


def test_the_parts_of_a_weight_can_be_chosen(shown):
    """Another factor of the weight is fetched and shown; the hint tells what it is."""
    shown.locator('[data-layer="weights"]').click()
    until(shown, "texproj.look.layer === 'weights'")
    settle(shown)
    whole = picture(shown)
    shown.get_by_label("Factor").select_option("angle")
    shown.get_by_text("Turned towards the camera").wait_for()
    end = time.monotonic() + 60
    while np.abs(whole.astype(int) - picture(shown)).mean() < 0.5:
        assert time.monotonic() < end, "the picture stays as it was"
        shown.wait_for_timeout(200)

    assert shown.get_by_label("Factor").input_value() == "angle"


def test_layers_are_computed_and_shown(shown):
    """Coverage takes a job of the server; the legend says how many photos."""
    shown.locator('[data-layer="coverage"]').click()
    until(shown, "texproj.look.layer === 'coverage'")
    settle(shown)

    assert "4 photos" in shown.locator("#legend").inner_text()
    assert picture(shown).std() > 20


# --- picking


def drag(page, start, stop):
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*[(a + b) / 2 for a, b in zip(start, stop, strict=True)])
    page.mouse.move(*stop)
    page.mouse.up()


def test_six_pairs_by_mouse_solve_a_photo(page, root):
    """Picked, saved, solved; a dragged point shows in red and its way back makes residuals fall;
    all of it is there after a reload.
    """
    pick_page(page)
    pairs = visible_pairs(page, 7)
    click_pairs(page, pairs)
    saved(page)
    on_disk = Project.open(root).load_correspondences(TO_SOLVE)
    assert len(on_disk) == 7
    assert np.abs(on_disk.xy_px - [uv for uv, _ in pairs]).max() < 1.5

    good = np.median(residuals(page))
    home = photo_place(page, pairs[2][0])
    away = (home[0] + 30, home[1] - 20)
    drag(page, home, away)
    bad = residuals(page)
    assert page.locator("#photo-marks .mark.outlier").get_attribute("data-pick") == "3"
    assert bad[2] > 20 > good
    drag(page, away, home)
    assert np.median(residuals(page)) < good + 0.3
    assert page.locator("#photo-marks .mark.outlier").count() == 0

    page.locator("#solve").click()
    until(
        page,
        f"texproj.facts.photos.find(p => p.name === '{TO_SOLVE}').status === 'registered'",
    )
    record = Project.open(root).load_cameras()[TO_SOLVE]
    truth = np.array([xyz for _, xyz in pairs])
    apart = record.camera.project(truth)[0] - cameras()[3].project(truth)[0]
    assert np.hypot(*apart.T).max() < 3
    page.reload()
    page.wait_for_selector("body[data-ready=true]")
    pick_page(page)
    until(page, "texproj.picking.picks.length === 7")


def test_undo_redo_and_delete(page, root):
    """Each step back and forth is on disk at once."""
    pick_page(page)
    click_pairs(page, visible_pairs(page, 2))
    page.keyboard.press("Delete")
    saved(page)
    assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 1
    page.keyboard.press("Control+z")
    saved(page)
    assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 2
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+y")
    saved(page)
    assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 2


def test_picking_by_keyboard_alone(page, root):
    """Cursor, Enter, Tab, Enter make a pair; arrows then move its half by one pixel."""
    pick_page(page)
    page.locator("#photo-pane").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    until(page, "texproj.picking.picks[0]?.xyz")
    saved(page)
    first = Project.open(root).load_correspondences(TO_SOLVE)
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowDown")
    saved(page)
    second = Project.open(root).load_correspondences(TO_SOLVE)

    assert np.allclose(second.xy_px - first.xy_px, [[1, 10]])


def test_a_click_is_answered_with_a_prediction(page):
    """With a camera, the other side's place is proposed near the truth; Enter takes it."""
    pick_page(page, "0000.png")
    uv, _ = corner_points(cameras()[0], 1)
    page.mouse.click(*photo_place(page, uv[0]))
    until(page, "texproj.picking.guess")
    page.keyboard.press("Enter")
    found = page.evaluate("texproj.picking.picks[0].xyz")

    seen = cameras()[0].project([found])[0][0]
    assert np.hypot(*(seen - uv[0])) < 4


def test_two_pages_keep_each_other_s_picks(browser, root):
    """Picks made in two tabs end up in one file and on both screens."""
    with running(root) as home, opened(browser, home) as one, opened(browser, home) as two:
        for page in (one, two):
            pick_page(page)
        pairs = visible_pairs(one, 4)
        click_pairs(one, pairs[:2])
        click_pairs(two, pairs[2:])
        for page in (one, two):
            until(page, "texproj.picking.picks.filter(p => p.uv && p.xyz).length === 4")
        assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 4


def test_an_edit_of_the_file_shows_up(page, root):
    """Whoever writes the CSV, the screen follows."""
    pick_page(page)
    path = root / "correspondences" / "0003.csv"
    path.write_text("u,v,x,y,z,name\n100.5,90.25,0,0,0.1,by hand\n")
    until(page, "texproj.picking.picks[0]?.name === 'by hand'")

    assert "by hand" in page.locator(".pairs").inner_text()


def test_a_dead_server_is_announced_and_work_survives(browser, root):
    """The page says so, keeps what is picked meanwhile, and saves it when the server is back."""
    server = running(root)
    home = server.__enter__()
    with opened(browser, home) as page:
        pick_page(page)
        uv, xyz = visible_pairs(page, 1)[0]
        page.mouse.click(*photo_place(page, uv))
        server.__exit__(None, None, None)
        page.wait_for_selector("body[data-online=false]", timeout=30_000)
        assert "does not answer" in page.locator("#notice").inner_text()
        hit = {"xyz": xyz.tolist(), "normal": [0, 0, 1]}
        page.evaluate("hit => texproj.picking.place('model', null, hit)", hit)
        page.wait_for_selector('#saved[data-state="unsaved"]')
        with running(root, port=int(home.rsplit(":", 1)[1])):
            page.wait_for_selector("body[data-online=true]", timeout=30_000)
            saved(page)
            assert page.locator("#notice").is_hidden()
            assert len(Project.open(root).load_correspondences(TO_SOLVE)) == 1


def test_a_phone_shows_everything(browser, root):
    """At 390 x 760 nothing is wider than the screen, and the list is one tap away."""
    with running(root) as home, opened(browser, home, 390, 760) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.get_by_role("button", name="Photos", exact=True).click()
        assert row(page, "0000.png").is_visible()


# --- making the model


def stage(*steps):
    """Work of the page that only tells how far it is: each step until somebody has seen it, for a
    minute at most; and what says that it was seen.
    """
    seen = threading.Semaphore(0)

    def work_on(_, progress):
        for step in steps:
            for _ in range(400):
                progress(*step)
                if seen.acquire(timeout=0.15):
                    break
        return "The model is made from 4 of 5 photos."

    return work_on, seen


@pytest.fixture
def made(monkeypatch):
    """A run of three steps, each of which waits to be seen."""
    run, seen = stage(("register", 2, 5, "a.png"), ("refine", 0, 1, ""), ("color", 5, 10, ""))
    monkeypatch.setattr(work, "STAGES", {**work.STAGES, "run": ("Make the model", run)})
    yield seen
    seen.release(3)


def test_one_button_makes_the_model(made, shown):
    """It says what is going on and cannot be pressed twice; words and tab tell how far it is; the
    end is told, with what is missing.
    """
    button = shown.locator("#do-run")
    button.click()
    until(shown, "document.querySelector('#do-run').disabled")
    assert "Making the model" in button.inner_text()
    assert shown.locator("#do-color").is_disabled()
    until(shown, "document.querySelector('#job-title').textContent.includes('photo 3 of 5')")
    assert shown.title().startswith("\u2026 40 %")
    made.release()
    until(shown, "document.querySelector('#job-title').textContent.includes('refining')")
    made.release(2)
    until(shown, "!document.querySelector('#do-run').disabled")
    shown.get_by_text("The model is made from 4 of 5 photos.").wait_for()

    assert button.inner_text() == "Make the model"
    assert shown.locator("#job").is_hidden()


def test_stop_stops(monkeypatch, shown):
    """The button says so at once; what comes is told as stopped, not as failed."""
    endless, _ = stage(("register", 2, 5, "a.png"))
    monkeypatch.setattr(work, "STAGES", {**work.STAGES, "run": ("Make the model", endless)})
    shown.locator("#do-run").click()
    until(shown, "!document.querySelector('#job').hidden")
    shown.locator("#job-cancel").click()
    shown.get_by_text("Stopped; what was finished before is kept.").wait_for()

    assert shown.locator("#do-run").is_enabled()
    assert shown.locator("#notice").get_attribute("data-kind") == "warn"


@pytest.fixture
def empty(browser, root):
    """The page of a project in which nothing is registered."""
    (root / "cameras.json").unlink()
    with running(root) as home, opened(browser, home) as found:
        yield found


def test_an_empty_project_tells_three_ways_to_start(empty):
    """The first starts a run, the second picking in a photo; the model is seen with z up."""
    card = empty.locator("#start")
    assert card.locator("li").count() == 3
    assert "texproj import" in card.inner_text()
    assert empty.locator('[data-up="z"]').get_attribute("aria-checked") == "true"
    empty.locator("#start-pick").click()
    until(empty, "document.body.dataset.mode === 'pick'")
    until(empty, "document.querySelector('#start').hidden")


def test_the_model_can_be_stood_on_any_side(empty, browser):
    """Buttons turn it, also over the poles; the side is remembered."""
    empty.get_by_role("button", name="Not now").click()
    empty.locator('[data-up="-y"]').click()
    settle(empty)
    up = "texproj.viewport.toScreen([0, -0.5, 0])[1] < texproj.viewport.toScreen([0, 0.5, 0])[1]"
    assert empty.evaluate(up)
    empty.get_by_role("button", name="Turn over").click()
    settle(empty)
    assert not empty.evaluate(up)
    empty.reload()
    empty.wait_for_selector("body[data-ready=true]")
    assert empty.locator('[data-up="-y"]').get_attribute("aria-checked") == "true"


def test_a_late_layer_does_not_steal_the_view(shown):
    """Whoever chose another one meanwhile keeps it."""
    held = []
    shown.route("**/api/layers/source", lambda route: held.append(route))  # noqa: PLW0108 - Playwright marks it
    shown.locator('[data-layer="source"]').click()
    shown.locator('[data-layer="normals"]').click()
    until(shown, "texproj.look.layer === 'normals'")
    with shown.expect_response("**/api/layers/source") as late:
        held[0].continue_()
    assert late.value.ok
    late.value.finished()
    shown.unroute_all(behavior="wait")
    shown.wait_for_timeout(300)

    assert shown.evaluate("texproj.look.layer") == "normals"
    assert shown.locator('[data-layer="normals"]').get_attribute("aria-checked") == "true"


def test_the_wipe_s_handle_stays_inside_and_picking_leaves_no_trace(shown):
    """At both ends the handle can be taken hold of; after picking, the photo's view is opaque."""
    enter(shown, "0000.png")
    pane = shown.locator("#model-pane").bounding_box()
    for wipe in (0, 1):
        shown.evaluate(f"texproj.change({{ wipe: {wipe} }})")
        handle = shown.locator("#wipe").bounding_box()
        assert handle["x"] >= pane["x"]
        assert handle["x"] + handle["width"] <= pane["x"] + pane["width"]
    pick_page(shown, "0000.png")
    assert shown.evaluate("texproj.look.opacity") == 0
    shown.locator("#leave-pick").click()
    assert shown.evaluate("texproj.look.opacity") == 1


FROM_BEHIND = """(() => {
  const { viewport } = texproj;
  viewport.lookFrom(viewport.camera.position.clone().set(0, 0.02, -1));
})()"""


def test_the_back_of_a_surface_is_dark_and_cannot_be_picked(browser, root):
    """A box open to the front, seen into from behind: its inside is dark, a click says why."""
    box = trimesh.creation.box((4, 3, 1))
    box.update_faces(box.face_normals[:, 2] > -0.5)
    (root / "cameras.json").unlink()
    box.export(root / "mesh" / "blocks.ply")
    with running(root) as home, opened(browser, home) as page:
        page.get_by_role("button", name="Not now").click()
        page.evaluate(FROM_BEHIND)
        settle(page)
        middle = picture(page)
        h, w = middle.shape[:2]
        assert middle[h // 2, w // 2].max() < 40
        pick_page(page, "0000.png")
        page.evaluate(FROM_BEHIND)
        settle(page)
        page.mouse.click(*model_place(page, [0, 0, 0.5]))
        page.get_by_text("the back of the surface").wait_for()
        assert page.evaluate("texproj.picking.picks.length") == 0


# --- for everybody


def test_axe_finds_nothing_in_any_view(browser, root):
    """Result, photo, factors of its weight, single steps, help, settings, mask, picking."""
    with_packages()
    with running(root) as home, opened(browser, home) as page:
        found = violations(page, "result")
        enter(page, "0000.png")
        found += violations(page, "photo")
        page.locator('[data-layer="weights"]').click()
        until(page, "texproj.look.layer === 'weights'")
        found += violations(page, "weights")
        page.locator("#do-more").click()
        found += violations(page, "single steps")
        page.keyboard.press("Escape")
        page.locator("#do-help").click()
        found += violations(page, "help")
        page.get_by_role("button", name="Close").click()
        page.locator("#do-settings").click()
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true })")
        found += violations(page, "settings")
        page.get_by_role("button", name="Close").click()
        page.evaluate("texproj.mask(texproj.photo)")
        until(page, "texproj.masks.facts")
        found += violations(page, "mask")
        page.locator("#leave-mask").click()
        pick_page(page, "0000.png")
        page.locator("#photo-pane").focus()
        page.keyboard.press("Enter")
        page.keyboard.press("Enter")
        until(page, "texproj.picking.picks.length === 1")
        assert found + violations(page, "picking") == []


def test_axe_finds_nothing_on_a_phone(browser, root):
    """A new project: how to start, photos, view, settings."""
    with_packages()
    (root / "cameras.json").unlink()
    with running(root) as home, opened(browser, home, 390, 760) as page:
        found = violations(page, "start")
        page.get_by_role("button", name="Photos", exact=True).click()
        found += violations(page, "photos")
        page.get_by_role("button", name="View", exact=True).click()
        found += violations(page, "panel")
        page.locator("#do-settings").click()
        page.locator("#settings details").first.wait_for()
        assert found + violations(page, "settings") == []


def test_the_bundle_is_small():
    """At most 1 MB compressed, all of it."""
    import gzip

    folder = CHECKOUT / "texproj" / "preview" / "static" / "bundle"
    if not folder.is_dir():
        pytest.skip("the page is not built")
    assert sum(len(gzip.compress(p.read_bytes())) for p in folder.iterdir()) < 1_000_000
