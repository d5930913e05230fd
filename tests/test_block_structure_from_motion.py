"""Photos alone, without any camera, place each other; what is known stays known; a process that
dies or is stopped takes nothing with it.
"""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from block_errors import errors_px
from scenes import scan_of, scene_of, synthetic_pair, taken

from texproj.camera import Intrinsics
from texproj.colmap import run as colmap_run
from texproj.colmap.messages import Lens, Task
from texproj.demo.photographer import ShotOptions
from texproj.demo.views import View
from texproj.errors import InputError, RegistrationError
from texproj.register.block.graph import PhotoGraph
from texproj.register.block.structure_from_motion import (
    BlockPhoto,
    picture_of,
    structure_from_motion,
)
from texproj.solve.retrieval import ALIKE, ALL_WITH_ALL, IN_TURN, centers_of, chosen_pairs, vlad

VIEWS = tuple(
    View(azimuth, height, upright=False)
    for azimuth, height in ((-24, 12), (-12, 20), (0, 10), (11, 22), (22, 14))
)
LONG_SIDE = 560
LENS = Intrinsics(1600, 1200, 1500.0, 1500.0, 800.0, 600.0)


def silent(what, done, total):
    """Listens to nothing."""


@pytest.fixture(scope="module")
def colmap():
    """Skips where there is no COLMAP."""
    pytest.importorskip("pycolmap", reason="pycolmap has no wheel for this system")


@pytest.fixture(scope="module")
def scene(colmap):
    """Five photos of the stele and one of another piece; who took them, and through what lens."""
    data = taken(scene_of(), scan_of(), VIEWS, [ShotOptions()] * len(VIEWS), LONG_SIDE)
    stranger = synthetic_pair(1, "capital", seed=3, long_side=LONG_SIDE).photos[0]
    stranger = replace(stranger, info=replace(stranger.info, name="stranger.jpg"))
    return data, {photo.info.name: photo for photo in (*data.photos, stranger)}


def truth_of(scene):
    """The true cameras by the photos' names."""
    return {p.info.name: c for p, c in zip(scene[0].photos, scene[0].cameras, strict=True)}


def as_block(photos, **known):
    """Photos of one lens of which nothing is known."""
    return [
        BlockPhoto(replace(p.info, focal_px=None), Path(p.info.name).stem, "lens", **known)
        for p in photos
    ]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder that lasts from test to test."""
    return tmp_path_factory.mktemp("block")


def solved(kept, photos, load, listen=silent, **known):
    """The photos' places, with what the folder `kept` knows already."""
    scratch = mkdtemp(dir=kept)
    database = str(kept / "features.db")
    return structure_from_motion(as_block(photos, **known), load, database, scratch, listen)


@pytest.fixture(scope="module")
def motion(scene, kept):
    """What the six photos alone say, and the names of those that were read for it."""
    read = []

    def load(name):
        read.append(name)
        return scene[1][name]

    return solved(kept, scene[1].values(), load), read


def test_photos_alone_place_each_other(scene, motion):
    """No pose, no focal length: all photos of the piece, within .3 % of the width though the true
    lens has five coefficients and its center is off.
    """
    (block,) = motion[0].parts

    assert block.names == tuple(photo.info.name for photo in scene[0].photos)
    assert errors_px(block, truth_of(scene), scene[0].mesh.vertices).max() < 0.003 * LONG_SIDE
    assert 0.05 < np.median(block.error_px) < 1


def test_what_shows_something_else_is_left_out_by_name(motion):
    """The other piece is in no part, and a sentence says so."""
    assert set(motion[0].left_out) == {"stranger.jpg"}
    assert re.search("shows nothing|shares only", motion[0].left_out["stranger.jpg"])


def test_points_are_where_the_photos_saw_them(motion):
    """Each sighting is near the point's image, full-size pixels; each point has two at least and
    the largest angle between its rays.
    """
    (block,) = motion[0].parts
    for k, camera in enumerate(block.cameras):
        points, xy = block.seen_from(k)
        gap = np.linalg.norm(camera.project(block.points[points])[0] - xy, axis=1)
        assert np.median(gap) < 1 and gap.max() < 6
    assert min(map(len, block.seen_by)) >= 2
    rays = block.points[0] - [block.cameras[k].center for k in block.seen_by[0]]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.cos(block.angle_rad[0]) == pytest.approx((rays @ rays.T).min(), abs=1e-9)


def test_neighbors_come_by_what_they_show(motion):
    """The photos next to each other share most; the graph counts each pair in either order."""
    graph = motion[0].graph
    assert graph.neighbors("0001.jpg")[0] == "0002.jpg"
    assert graph.count("0002.jpg", "0001.jpg") == graph.matches["0001.jpg", "0002.jpg"] > 50
    assert PhotoGraph({("a", "b"): 40, ("a", "c"): 60}).neighbors("a") == ("c", "b")
    assert graph.neighbors("unknown.jpg") == ()


def test_what_is_known_is_not_found_again_and_gives_the_same(scene, kept, motion):
    """A second run reads no photo and gives the same numbers; a new photo alone is read."""
    again = solved(kept, scene[1].values(), lambda name: pytest.fail(f"{name} is read again"))
    new = replace(scene[0].photos[0], info=replace(scene[0].photos[0].info, name="new.jpg"))
    read = []
    photos = {"new.jpg": new, **scene[1]}

    def load(name):
        read.append(name)
        return photos[name]

    solved(kept, photos.values(), load)

    assert sorted(motion[1]) == sorted(scene[1])
    assert np.array_equal(again.parts[0].points, motion[0].parts[0].points)
    assert again.graph.matches == motion[0].graph.matches
    assert read == ["new.jpg"]


@dataclass(frozen=True)
class Here:
    """Workers that are this process. damaged: a photo that cannot be read."""

    photos: dict
    damaged: str
    count: int = 1

    def features(self, name, key):
        from texproj.colmap.work import features_of

        if name == self.damaged:
            return Refused(InputError(f"{name} is damaged"))
        return Found(features_of(picture_of(key, self.photos[name])))

    def match(self, batch):
        from texproj.colmap.work import matched

        return Found(matched(batch, threads=1))


@dataclass(frozen=True)
class Found:
    value: object

    def result(self, _listen):
        return self.value


@dataclass(frozen=True)
class Refused:
    why: Exception

    def result(self, _listen):
        raise self.why


def test_workers_elsewhere_find_the_same(scene, motion, tmp_path):
    """Features and pairs to the last bit, in a database of their own; no photo is read here, and
    one that workers cannot read stops no other.
    """
    new = replace(scene[0].photos[0], info=replace(scene[0].photos[0].info, name="new.jpg"))
    photos = {**scene[1], "new.jpg": new}
    database, scratch = str(tmp_path / "features.db"), mkdtemp(dir=tmp_path)
    found = structure_from_motion(
        as_block(photos.values()),
        lambda name: pytest.fail(f"{name} is read here"),
        database,
        scratch,
        silent,
        Here(photos, "new.jpg"),
    )

    assert found.left_out.pop("new.jpg") == "new.jpg is damaged"
    assert found.left_out == motion[0].left_out
    assert np.array_equal(found.parts[0].points, motion[0].parts[0].points)
    assert found.graph.matches == motion[0].graph.matches


def test_a_broken_database_is_begun_anew(scene, tmp_path):
    """Nothing in it cannot be found again. One photo that cannot be read stops no other."""
    (tmp_path / "features.db").write_bytes(b"not a database" * 99)
    photos = scene[0].photos[:4]

    def load(name):
        if name == "0004.jpg":
            raise InputError("0004.jpg is damaged")
        return scene[1][name]

    found = solved(tmp_path, photos, load)

    assert found.left_out == {"0004.jpg": "0004.jpg is damaged"}
    assert found.parts[0].names == ("0001.jpg", "0002.jpg", "0003.jpg")


def test_a_calibrated_lens_stays_as_it_is(scene, kept, motion):
    """Given intrinsics are given back, and the cameras are nearer to the truth than without."""
    data = scene[0]
    given = data.cameras[0].intrinsics
    (block,) = solved(kept, data.photos, scene[1].__getitem__, intrinsics=given).parts
    exact, solved_too = (
        errors_px(part, truth_of(scene), data.mesh.vertices) for part in (block, motion[0].parts[0])
    )

    assert [camera.intrinsics for camera in block.cameras] == [given] * len(data.photos)
    assert 0.01 < np.median(exact) < 0.001 * LONG_SIDE
    assert np.median(exact) < np.median(solved_too)


def synthetic_model(center_px):
    """COLMAP's own synthetic scene, noise .5 px, by a lens that is believed to be centered."""
    import pycolmap

    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs = options.num_cameras_per_rig = 1
    options.num_frames_per_rig, options.num_points3D = 8, 400
    options.camera_width, options.camera_height = 1600, 1200
    options.camera_params = [1500.0, *center_px, 0.0]
    pycolmap.set_random_seed(1)
    model = pycolmap.synthesize_dataset(options)
    noise = pycolmap.SyntheticNoiseOptions()
    noise.point2D_stddev = 0.5
    pycolmap.synthesize_noise(noise, model)
    for camera in model.cameras.values():
        camera.params = [1500.0, 800.0, 600.0, 0.0]
    return model


@pytest.mark.parametrize("lens", ["off center", "centered", "calibrated"])
def test_a_principal_point_is_solved_where_the_photos_tell_it(colmap, lens):
    """A lens that is off center is found so to a fraction of a pixel; one that is centered, or
    calibrated, stays exactly as it was.
    """
    from texproj.colmap.mapping import with_principal_points

    model = synthetic_model((830, 575) if lens == "off center" else (800, 600))
    known = LENS if lens == "calibrated" else None
    keys = tuple(image.name for image in model.images.values())
    task = Task("", "", keys, (Lens(1600, 1200, intrinsics=known),), (0,) * len(keys), 1)
    (camera,) = with_principal_points(model, task).cameras.values()
    found = (camera.principal_point_x, camera.principal_point_y)

    if lens == "off center":
        assert found == pytest.approx((830, 575), abs=0.6)
        assert found != (830, 575)
    else:
        assert found == (800, 600)


def test_nothing_is_found_where_the_mask_forbids(scene, tmp_path):
    """All sightings lie where the mask is not 0."""
    mask = np.zeros((scene[0].photos[0].height, LONG_SIDE), np.uint8)
    mask[:, LONG_SIDE // 3 :] = 255
    masked = {p.info.name: replace(p, mask=mask) for p in scene[0].photos[:3]}
    (block,) = solved(tmp_path, masked.values(), masked.__getitem__).parts

    assert block.xy_px[:, 0].min() > LONG_SIDE / 3 - 1


def test_the_same_photo_twice_counts_once(scene, tmp_path):
    """It is named, with the photo whose content it has."""
    twin = BlockPhoto(replace(scene[0].photos[0].info, name="twin.jpg"), "0001", "lens")
    photos = [*as_block(scene[0].photos[:2]), twin]
    found = structure_from_motion(
        photos, scene[1].__getitem__, str(tmp_path / "features.db"), str(tmp_path), silent
    )

    assert found.left_out["twin.jpg"] == "it is the same as 0001.jpg"


def test_without_colmap_one_sentence_says_what_to_do(monkeypatch, tmp_path):
    """Where there is no wheel, the rest of texproj works."""
    monkeypatch.setattr("texproj.register.block.structure_from_motion.available", lambda: False)
    with pytest.raises(RegistrationError, match="pip install pycolmap"):
        structure_from_motion([], lambda name: None, "", str(tmp_path), silent)


@pytest.fixture
def started(monkeypatch):
    """The processes that COLMAP's runs start."""
    found = []
    popen = subprocess.Popen

    def noted(*args, **kwargs):
        found.append(popen(*args, **kwargs))
        return found[-1]

    monkeypatch.setattr(colmap_run.subprocess, "Popen", noted)
    return found


@pytest.mark.parametrize(
    ("how", "sentence"), [("SIGKILL", "lack of memory"), ("SIGSEGV", "ended unexpectedly")]
)
def test_a_process_that_dies_is_told_in_a_sentence(scene, tmp_path, started, how, sentence):
    """Whatever ends it, the caller goes on."""
    if not hasattr(signal, how):
        pytest.skip(f"there is no {how} here")

    def load(name):
        os.kill(started[0].pid, getattr(signal, how))
        return scene[1][name]

    with pytest.raises(RegistrationError, match=sentence):
        solved(tmp_path, scene[0].photos, load)
    assert started[0].returncode is not None


def test_stop_ends_the_process_at_once(scene, tmp_path, started, monkeypatch):
    """What `listen` raises comes out within a second or so, and no process is left, nor a log in
    the system's temporary folder; what was found until then is not found again.
    """
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))

    def listen(what, done, total):
        if what == "features" and done >= 2:
            raised.append(time.perf_counter())
            raise KeyboardInterrupt

    raised = []
    with pytest.raises(KeyboardInterrupt):
        solved(tmp_path, scene[0].photos, scene[1].__getitem__, listen)
    assert started[0].returncode is not None
    assert time.perf_counter() - raised[0] < 10
    read = []

    def load(name):
        read.append(name)
        return scene[1][name]

    solved(tmp_path, scene[0].photos, load)
    assert len(read) <= len(scene[0].photos) - 2
    assert not list(temporary.iterdir())


KILLED = """
import os, pickle, sys
import numpy as np
import pycolmap
from texproj.colmap.database import FeatureStore
from texproj.colmap.messages import Features, Lens, Match, Task
task = Task(sys.argv[1], "", ("a", "b"), (Lens(64, 48),), (0, 0), 1)
points = np.arange(8, dtype=np.float32).reshape(2, 4)
rows = pycolmap.FeatureDescriptors(
    type=pycolmap.FeatureExtractorType.SIFT, data=np.zeros((2, 128), np.uint8)
)
if sys.argv[2]:
    setattr(pycolmap.Database, sys.argv[2], lambda *values: os._exit(9))
with FeatureStore(task) as store:
    for key in task.keys:
        if not store.has_features(key):
            store.save_features(Features(key, points, pickle.dumps(rows)))
    if not store.was_matched(*task.keys):
        geometry = pickle.dumps(pycolmap.TwoViewGeometry())
        store.save_match(Match(task.keys, np.zeros((1, 2), np.uint32), geometry))
    sys.exit(0 if store.was_matched(*task.keys) else 1)
"""


def test_killed_between_two_writes_it_goes_on(colmap, tmp_path):
    """Whatever was half-written is not there for the next run, which writes it all."""
    for last in ("write_frame", "write_descriptors", "write_two_view_geometry", ""):
        said = subprocess.run(
            [sys.executable, "-c", KILLED, tmp_path / "features.db", last],
            check=False, capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        assert said.returncode == (9 if last else 0), said.stderr


ORPHAN = """
import sys
from texproj.colmap.messages import Task, send
from texproj.colmap.run import _process
with _process() as process:
    print(process.pid, flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="process ids are looked at as on Unix")
def test_nobody_waits_so_nothing_runs(colmap):
    """When the program is killed, the process that it started ends by itself."""
    parent = subprocess.Popen(
        [sys.executable, "-c", ORPHAN], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    with parent:
        child = int(parent.stdout.readline())
        assert alive(child)
        parent.kill()
    end = time.monotonic() + 20
    while alive(child) and time.monotonic() < end:
        time.sleep(0.05)
    assert not alive(child)


def alive(pid: int) -> bool:
    """Whether a process runs; a zombie does not."""
    try:
        return " Z " not in Path(f"/proc/{pid}/stat").read_text()[:80]
    except OSError:
        return False


def test_pairs_grow_as_the_photos_do():
    """Beyond a few photos, each is matched with a bounded number of others: its likes wherever
    they stand, and its neighbors in turn.
    """
    rng = np.random.default_rng(0)

    def pairs_of(count):
        places = rng.normal(size=(count // 10, 64)).astype(np.float32)
        vectors = np.repeat(places, 10, axis=0) + 0.1 * rng.normal(size=(count, 64))
        shuffled = rng.permutation(count)
        vectors = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)
        return shuffled, set(chosen_pairs(count, vectors[shuffled]))

    sizes = {count: len(pairs_of(count)[1]) for count in (200, 2000)}
    shuffled, pairs = pairs_of(300)
    place = shuffled // 10
    same_place = [(i, j) for i in range(300) for j in range(i + 1, 300) if place[i] == place[j]]

    assert sizes[2000] <= 2000 * (ALIKE + IN_TURN)
    assert sizes[2000] / sizes[200] == pytest.approx(10, rel=0.2)
    assert pairs.issuperset(same_place)
    assert pairs.issuperset((i, i + 1) for i in range(299))
    assert len(chosen_pairs(ALL_WITH_ALL, None)) == ALL_WITH_ALL * (ALL_WITH_ALL - 1) // 2


def test_photos_of_the_same_are_alike():
    """Two photos of the same features, with noise, are more alike than photos of others."""
    rng = np.random.default_rng(0)
    here, there = rng.random((2, 500, 128), dtype=np.float32)

    def photo(place):
        return place[:450] + 0.1 * rng.random((450, 128), dtype=np.float32)

    photos = [photo(here), photo(here), photo(there)]
    centers = centers_of(np.concatenate(photos))
    a, b, c = (vlad(descriptors, centers) for descriptors in photos)

    assert a @ b > 0.8
    assert a @ c < 0.4
    assert np.linalg.norm(a) == pytest.approx(1, abs=1e-5)
    assert not vlad(np.zeros((0, 128), np.float32), centers).any()
