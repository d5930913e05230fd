"""Photos of painted things before each other: right ones agree, wrong ones are named, and what
nothing but somebody's word can tell is said to rest on it.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from block_scenes import mirrored, relief
from painted_scenes import cushion_scene, prior, turn_about_z, turned, vase, vase_scene
from scenes import synthetic_pair

from texproj.demo.views import disturbed
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import RefineOptions
from texproj.records import PROOF
from texproj.register.block.scan_samples import ScanSamples
from texproj.register.block.slides import slides, untold
from texproj.register.joint.lenses import PhotoStart
from texproj.register.proof.agreement import Agreement
from texproj.register.proof.camps import Ruling, rulings
from texproj.register.proof.judge import LooksHere, judge
from texproj.register.proof.together import Together, brought_together
from texproj.render.rays import CPURenderer
from texproj.stages import methods
from texproj.stages.agreeing import edges_in_part
from texproj.stages.bench import Workbench
from texproj.stages.registering import register_photos

CHANNELS = ("depth", "normal")
TURN_DEG = 37.0


@lru_cache(maxsize=1)
def vases():
    """Five photos of a vase, and its scan ready to be rendered."""
    scene = vase_scene(5, 80.0, long_side=400, fine=160)
    return scene, CPURenderer().load(scene.scan, np.ones(len(scene.scan.vertices), np.float32))


def judged(cameras):
    scene, drawn = vases()
    names = list(scene.cameras)
    looks = LooksHere(
        cameras,
        lambda k, longest: scene.photo(names[k]).reduced(longest),
        lambda camera: drawn.gbuffer(camera, CHANNELS),
    )
    return judge(cameras, looks, range(len(cameras)))


def test_true_cameras_agree_far_beyond_chance():
    """Each photo with two others at least, most patches together, at their places."""
    for ruling in judged(list(vases()[0].cameras.values())).values():
        assert len(ruling.agree) >= 2 and not ruling.against
        assert ruling.share > 0.7 > 2 * ruling.chance
        assert ruling.apart_px < 0.5


def test_a_photo_that_all_others_contradict_is_the_only_one_refused():
    """It is turned about the axis: its outline and the mesh's edges fit as before."""
    cameras = list(vases()[0].cameras.values())
    cameras[2] = turn_about_z(TURN_DEG).camera(cameras[2])
    found = judged(cameras)

    assert [k for k, ruling in found.items() if ruling.refused] == [2]
    assert len(found[2].against) >= 2 and not found[2].agree


def test_agreement_does_not_tell_a_vase_from_itself_turned():
    """All photos turned together agree as before; the mesh's edges do not tell either, and that
    the mesh slides so is known.
    """
    scene, drawn = vases()
    turn = turn_about_z(TURN_DEG)
    cameras = [turn.camera(camera) for camera in scene.cameras.values()]
    motions = slides_of(scene.scan)
    photos = [scene.photo(name) for name in list(scene.cameras)[::2]]

    assert not any(ruling.refused or ruling.torn for ruling in judged(cameras).values())
    assert [motion.kind for motion in motions] == ["turn"]
    assert untold(
        cameras[::2], photos, lambda c: drawn.gbuffer(c, ("depth", "normal", "ao")), motions
    ) == motions  # fmt: skip


def slides_of(mesh: Mesh):
    samples = ScanSamples.of(mesh)
    xyz = samples.world_from_unit.apply(samples.xyz)
    return slides(xyz, samples.normal.astype(np.float64))


def test_a_slide_leaves_the_mesh_where_it_is():
    """The vase's turn moves its points along itself; shapes with relief have none."""
    motion = slides_of(vase(97, 120))[0]
    points = vase(97, 120).vertices
    moved = motion.by(0.5).apply(points)

    np.testing.assert_allclose(np.hypot(*moved[:, :2].T), np.hypot(*points[:, :2].T), atol=2e-3)
    assert np.linalg.norm(moved - points, axis=1).mean() > 0.05
    assert slides_of(relief(0)) == ()
    assert slides_of(cushion_scene().scan) == ()


YES, NO = Agreement(100, 80, 0.1), Agreement(100, 10, 0.1)


def test_camps_of_one_size_tear_each_other_unless_edges_bear_one_out():
    """Two and two: nobody is believed, or those that the mesh's edges confirm."""
    pairs = {(0, 1): YES, (2, 3): YES, (0, 2): NO, (1, 2): NO, (0, 3): NO, (1, 3): NO}
    torn, told = rulings(4, pairs, ()), rulings(4, pairs, (1,))

    assert all(ruling.torn and not ruling.refused for ruling in torn.values())
    assert [k for k, ruling in told.items() if ruling.refused] == [2, 3]
    assert not any(ruling.torn for ruling in told.values())


def test_one_contradiction_alone_refuses_nobody():
    """A photo may be hidden or out of focus in one pair."""
    found = rulings(3, {(0, 1): YES, (1, 2): NO}, ())

    assert not any(ruling.refused or ruling.torn for ruling in found.values())
    assert found[2].against == (1,)


def test_few_patches_prove_nothing():
    assert not replace(YES, sought=20, together=20).agrees
    assert not replace(NO, sought=20, together=1).contradicts


def test_rough_cameras_of_a_patterned_cushion_come_to_agree():
    """From 3 % off to less than .1 %, and the told error is of that size; one that was far beyond
    reach is not confirmed.
    """
    scene = cushion_scene(5, long_side=360, fine=100)
    drawn = CPURenderer().load(scene.scan)
    names, points = list(scene.cameras), scene.scan.vertices[::37]
    starts = [
        disturbed(c, points, 10 if k else 80, np.random.default_rng([7, k]))
        for k, c in enumerate(scene.cameras.values())
    ]
    found = brought_together(
        [PhotoStart(start, 0.0, given=True) for start in starts],
        lambda k, longest: scene.photo(names[k]).reduced(longest),
        lambda camera: drawn.gbuffer(camera, CHANNELS), RefineOptions(),
    )  # fmt: skip
    off = [scene.off_percent(name, c) for name, c in zip(names, found.cameras, strict=True)]
    told = 100 * found.expected_error_px / 360

    assert max(off[1:]) < 0.1 < off[0], off
    assert not found.rulings[0].agree
    assert all(found.rulings[k].camp == 4 for k in range(1, 5))
    assert (told[1:] < 0.3).all() and (told[1:] > 0.3 * np.array(off[1:])).all()


@pytest.fixture(scope="module")
def picked(tmp_path_factory):
    """The vase with picks in three photos, those of one turned about the axis."""
    scene = vases()[0]
    a, b, c = list(scene.cameras)[::2]
    picks = {a: scene.picks(a), b: turned(scene.picks(b), TURN_DEG), c: scene.picks(c)}
    project = scene.written(tmp_path_factory.mktemp("vase") / "p", picks=picks)
    with Workbench(project) as bench:
        outcomes = {outcome.name: outcome for outcome in register_photos(bench)}
    return scene, project.load_cameras(), outcomes, b


def test_wrong_picks_in_one_photo_are_found_out_and_mended(picked):
    """The photo is registered through the others instead, and says whom its picks contradict."""
    scene, entries, outcomes, wrong = picked

    assert entries[wrong].method == "features"
    assert "show something else there" in outcomes[wrong].reason
    off = [scene.off_percent(name, entry.camera) for name, entry in entries.items()]
    assert max(off) < 0.5


def test_a_vase_says_that_its_place_rests_on_picks(picked):
    """All photos bear each other out; along the turn about the axis only picks tell."""
    _, entries, outcomes, wrong = picked
    for entry in entries.values():
        proof = entry.quality[PROOF]
        assert "other photos" in proof["by"] and len(proof["photos"]) >= 1
        assert "turned about its axis" in proof["rests_on"]
        assert "your picks in" in proof["rests_on"] and wrong not in proof["rests_on"]
    assert any("rests on your picks" in outcome.reason for outcome in outcomes.values())


def test_rough_cameras_of_a_cushion_are_registered_by_agreement(tmp_path, monkeypatch):
    """By `register` itself, after the mesh's edges told nothing (that they do not: the benchmark);
    a second run finds nothing to do.
    """

    def no_edges(_job, _start):
        raise RegistrationError("nothing in the photo looks like the mesh")

    monkeypatch.setattr(methods, "_from_camera", no_edges)
    scene = cushion_scene(3, long_side=360, fine=100)
    points = scene.scan.vertices[::37]
    starts = [
        prior(name, disturbed(c, points, 6.0, np.random.default_rng([7, k])))
        for k, (name, c) in enumerate(scene.cameras.items())
    ]
    project = scene.written(tmp_path / "p", starts=starts)
    with Workbench(project) as bench:
        first = register_photos(bench)
        again = register_photos(bench)
    entries = project.load_cameras()

    assert not any(outcome.failed for outcome in first)
    assert all(outcome.kept for outcome in again)
    assert {entry.method for entry in entries.values()} == {"block"}
    assert all(entry.quality[PROOF]["by"] == ["other photos"] for entry in entries.values())
    assert max(scene.off_percent(name, e.camera) for name, e in entries.items()) < 0.3


def test_photos_that_agree_on_a_mirrored_mesh_are_not_believed():
    """A stele is nearly symmetric: its photos agree on the mirrored mesh, whose edges are found in
    part; a vase has none to be found.
    """
    stele, vase_photos = synthetic_pair(3), vases()[0]
    names = list(vase_photos.cameras)
    for mesh, cameras, load, believed in (
        (mirrored(stele.mesh), stele.cameras, lambda k, px: stele.photos[k].reduced(px), False),
        (vase_photos.scan, list(vase_photos.cameras.values()),
         lambda k, px: vase_photos.photo(names[k]).reduced(px), True),
    ):  # fmt: skip
        drawn = CPURenderer().load(mesh)
        rulings_ = {k: Ruling(camp=3) for k in range(3)}
        found = Together(tuple(cameras), np.zeros(3), 1.0, rulings_)
        reason = edges_in_part(
            found, load, lambda c, drawn=drawn: drawn.gbuffer(c, ("depth", "normal", "front"))
        )
        assert (reason == "") == believed, reason
