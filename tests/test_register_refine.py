"""Joint refinement: photos that agree with each other, and one that does not belong."""

import pickle
from functools import lru_cache

import numpy as np
from scenes import exposure_round, synthetic_pair

from texproj.camera import Camera
from texproj.options import RefineOptions, RenderOptions
from texproj.register.joint.lenses import PhotoStart
from texproj.register.joint.overlap import choose_partners
from texproj.register.joint.patches import Density
from texproj.register.joint.refine import refine
from texproj.register.joint.search import Level, TieFinder, TieSearcher
from texproj.render import open_renderer

OPTIONS = RefineOptions(working_px=512, partners=4)


def disturbed(cameras, px, seed):
    """Each camera moved by about `px` pixels at the object, at random."""
    rng = np.random.default_rng(seed)
    moved = []
    for camera in cameras:
        angle = px / camera.intrinsics.fx * rng.normal(0, 0.6, 3)
        turned = camera.pose.step([*angle, 0, 0, 0])
        shift = rng.normal(0, 0.5, 3) * px / camera.intrinsics.fx
        moved.append(Camera(camera.intrinsics, turned.step([0, 0, 0, *shift])))
    return moved


def errors_px(found, truth, mesh):
    """(n,) mean distance of the mesh's vertices between found and true cameras."""
    xyz = mesh.vertices[::20]
    return np.array([
        np.nanmean(np.linalg.norm(a.project(xyz)[0] - b.project(xyz)[0], axis=1))
        for a, b in zip(found, truth, strict=True)
    ])  # fmt: skip


def turned(camera, px):
    """The camera turned by `px` pixels to the side."""
    return Camera(camera.intrinsics, camera.pose.step([0, px / camera.intrinsics.fx, 0, 0, 0, 0]))


@lru_cache(maxsize=2)
def refined(foreign: bool, aside_px: float = 0.0):
    """The round of seven photos refined from 2 px on average; the last maybe of another piece, the
    fifth maybe aside.
    """
    data = exposure_round()
    photos = list(data.photos)
    if foreign:
        other = synthetic_pair(1, "capital", seed=3, long_side=720).photos[0]
        photos[-1] = other.resized(photos[-1].width, photos[-1].height)
    start = disturbed(data.cameras, 4.0, 7)
    start[4] = turned(start[4], aside_px)

    def load(number, longest):
        photo = photos[number]
        factor = longest / max(photo.width, photo.height)
        return photo.resized(round(photo.width * factor), round(photo.height * factor))

    with open_renderer(RenderOptions()) as renderer, renderer.load(data.mesh) as scene:
        found = refine(
            [PhotoStart(c, 2.0, c.intrinsics.fx, given=True) for c in start], load,
            lambda c: scene.gbuffer(c, ("depth", "normal")), OPTIONS,
        )  # fmt: skip
    return data, start, found


def test_photos_agree_better_than_each_alone():
    """From 2 px to below one, with exposure steps, a visitor and a blurred photo among them."""
    data, start, found = refined(False)
    before = errors_px(start, data.cameras, data.mesh)
    after = errors_px(found.cameras, data.cameras, data.mesh)

    assert found.thrown_out == {} and len(found.tied) == 7
    assert np.median(before) > 1.0
    assert np.median(after) < 0.5 * np.median(before)
    assert after.max() < before.max()


def test_agreement_and_frame_are_told_apart():
    """Seven numbers with their deviations; the photos agree better than their place is sure."""
    quality = refined(False)[2].quality
    frame, agreement = quality["frame"], quality["agreement"]

    assert 0 < agreement["expected_px"] < frame["expected_px"]
    assert frame["scale_sigma_percent"] > 0
    assert min(frame["rotation_sigma_deg"] + frame["shift_sigma"]) > 0
    assert frame["held_by"].startswith("the mesh")


def test_the_expected_error_is_neither_boast_nor_excuse():
    """What is claimed stands within a factor of four of what is true, on average."""
    data, _, found = refined(False)
    after = errors_px(found.cameras, data.cameras, data.mesh)
    ratio = np.sqrt((after**2).mean() / (found.expected_error_px**2).mean())

    assert 0.25 < ratio < 4


def test_a_photo_of_something_else_is_thrown_out_and_moves_no_other():
    """A photo of another piece: named with a reason, the others end where they end without it."""
    data, _, without = refined(False)
    _, _, found = refined(True)
    apart = errors_px(found.cameras[:6], without.cameras[:6], data.mesh)
    alone = errors_px(found.cameras[:6], data.cameras[:6], data.mesh)

    assert list(found.thrown_out) == [6]
    assert "no other photo" in found.thrown_out[6]
    assert 6 not in found.tied
    assert np.median(apart) < 0.5
    assert np.median(alone) < 1.0


def test_a_photo_that_stands_aside_is_found_again_by_what_the_others_show():
    """Farther off than ties are sought at first: it ends where it ends from near by."""
    data, _, near = refined(False)
    _, _, found = refined(False, aside_px=24.0)
    error = errors_px(found.cameras, data.cameras, data.mesh)

    assert found.found_again == (4,) and found.thrown_out == {}
    assert error[4] < 2 * errors_px(near.cameras, data.cameras, data.mesh).max()


def test_partners_reach_from_near_to_wide():
    """Of many usable photos the closest and the widest are both taken; hidden ones never."""
    share = np.full((5, 5), 0.8)
    share[0, 4] = 0.1
    angle = np.abs(np.subtract.outer(np.arange(5), np.arange(5))) * 10.0
    pairs = [j for i, j in choose_partners(share, angle, 2) if i == 0]

    assert pairs == [1, 3]


def test_a_task_says_all_that_its_ties_depend_on():
    """Each done by somebody who knows nothing of those before, from what was sent: the same ties,
    after photos have moved, too.
    """
    data = exposure_round()
    moved = disturbed(data.cameras, 12.0, 5)
    pairs, points = [(0, 1), (1, 2), (1, 0)], [data.mesh.vertices[::50]] * 3
    level = Level(256, Density(16, 40))

    def load(number, longest):
        photo = data.photos[number]
        factor = longest / max(photo.width, photo.height)
        return photo.resized(round(photo.width * factor), round(photo.height * factor))

    with open_renderer(RenderOptions()) as renderer, renderer.load(data.mesh) as scene:

        def render(camera):
            return scene.gbuffer(camera, ("depth", "normal"))

        def elsewhere(tasks):
            for task in pickle.loads(pickle.dumps(list(tasks))):
                yield TieSearcher(load, render, 512).prepared(task).find()

        here, there = TieFinder(load, render, 512), TieFinder(load, render, 512, elsewhere)
        for cameras in (data.cameras[:3], moved[:3]):
            a, b = (f.find(tuple(cameras), pairs, level, 6, points) for f in (here, there))
            assert sum(len(a[pair].ties) for pair in pairs) > 10
            for pair in pairs:
                assert a[pair].sought == b[pair].sought
                for name in a[pair].ties.__dataclass_fields__:
                    mine, other = getattr(a[pair].ties, name), getattr(b[pair].ties, name)
                    assert np.array_equal(mine, other)
