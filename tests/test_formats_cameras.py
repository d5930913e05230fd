"""cameras.json: what it keeps, what it refuses, and how it says so."""

import json

import numpy as np
import pytest

from texproj.camera import DISTORTION_LENGTHS, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.cameras import cameras_json, entry_of_record, read_cameras, record_of_entry
from texproj.records import CameraRecord

R90 = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


def entry(**changes):
    base = {
        "file": "a.jpg",
        "width": 300,
        "height": 200,
        "K": [[250.5, 0, 151.25], [0, 251.5, 99.75], [0, 0, 1]],
        "dist": [0.1, -0.02, 0.001, 0.002, 0.003],
        "R": R90,
        "t": [1, 2, 3],
        "status": "registered",
        "method": "points",
        "quality": {"expected_error_px": 0.5},
    }
    return {key: value for key, value in (base | changes).items() if value is not ...}


def written(tmp_path, *entries, **top):
    path = tmp_path / "cameras.json"
    content = {"format": "texproj-cameras", "version": 1, "photos": list(entries)} | top
    path.write_text(json.dumps(content))
    return path


def random_rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_an_entry_is_read_as_the_conventions_say(tmp_path):
    record = read_cameras(written(tmp_path, entry())).records[0]
    assert (record.file, record.width, record.height) == ("a.jpg", 300, 200)
    assert (record.status, record.method) == ("registered", "points")
    k = record.intrinsics
    assert (k.fx, k.fy, k.cx, k.cy) == (250.5, 251.5, 151.25, 99.75)
    assert k.dist == (0.1, -0.02, 0.001, 0.002, 0.003)
    np.testing.assert_array_equal(record.camera.pose.apply([[1, 0, 0]]), [[1, 3, 3]])
    assert record.quality == {"expected_error_px": 0.5}


@pytest.mark.parametrize("count", DISTORTION_LENGTHS)
def test_writing_and_reading_gives_back_every_bit(tmp_path, count):
    rng = np.random.default_rng(count)
    k = Intrinsics(300, 200, *(rng.random(4) * 1000), tuple(rng.normal(size=count)))
    pose = Pose(random_rotation(rng), rng.normal(size=3) * 1e6)
    record = CameraRecord("b.tif", 300, 200, k, pose, "registered", "structure")
    (tmp_path / "cameras.json").write_text(cameras_json([record]))
    read = read_cameras(tmp_path / "cameras.json").records[0]
    assert read.intrinsics == k
    np.testing.assert_array_equal(read.pose.R, pose.R)
    np.testing.assert_array_equal(read.pose.t, pose.t)


def test_unknown_keys_survive_in_the_file_and_in_each_entry(tmp_path):
    path = written(tmp_path, entry(note={"by": ["hand"]}), source="laser", n=[1, 2])
    file = read_cameras(path)
    path.write_text(cameras_json(file.records, file.extra))
    content = json.loads(path.read_text())
    assert (content["source"], content["n"]) == ("laser", [1, 2])
    assert content["photos"][0]["note"] == {"by": ["hand"]}
    assert content["photos"] == [entry(note={"by": ["hand"]})]


def test_a_prior_may_know_the_lens_alone_the_pose_alone_or_both(tmp_path):
    lens = entry(file="1", status="prior", R=..., t=...)
    pose = entry(file="2", status="prior", K=..., dist=...)
    both = entry(file="3", status="prior")
    one, two, three = read_cameras(written(tmp_path, lens, pose, both)).records
    assert (one.pose, one.camera) == (None, None)
    assert (two.intrinsics, two.camera) == (None, None)
    assert three.camera is not None


def test_a_failed_photo_is_written_without_its_pose(tmp_path):
    record = record_of_entry(entry())
    failed = CameraRecord("a.jpg", 300, 200, record.intrinsics, record.pose, "failed")
    assert {"R", "t", "method"}.isdisjoint(entry_of_record(failed))
    assert record_of_entry(entry_of_record(failed)).status == "failed"


def test_numpy_numbers_in_quality_become_plain_ones():
    record = record_of_entry(entry())
    record.quality.update(rms=np.float64(0.5), count=np.int64(3), residuals=np.array([1.0, 2.0]))
    quality = entry_of_record(record)["quality"]
    assert quality["rms"] == 0.5
    assert type(quality["count"]) is int
    assert quality["residuals"] == [1.0, 2.0]


def test_a_number_that_json_does_not_have_is_never_written():
    record = record_of_entry(entry())
    record.quality["rms"] = float("nan")
    with pytest.raises(ValueError, match="JSON"):
        cameras_json([record])


BAD_ENTRIES = {
    "width": (entry(width=0), "width"),
    "no height": (entry(height=...), "height"),
    "status": (entry(status="done"), "status"),
    "method": (entry(method="magic"), "method"),
    "K shape": (entry(K=[[1, 0], [0, 1]]), "K"),
    "K text": (entry(K=[["f", 0, 1], [0, 1, 1], [0, 0, 1]]), "K"),
    "skew": (entry(K=[[9, 1, 1], [0, 9, 1], [0, 0, 1]]), "K must be"),
    "focal": (entry(K=[[-9, 0, 1], [0, 9, 1], [0, 0, 1]]), "K must be"),
    "dist": (entry(dist=[1, 2, 3]), "dist has 3 coefficients"),
    "nan": (entry(t=[0, float("nan"), 0]), "t"),
    "scaled R": (entry(R=[[2, 0, 0], [0, 2, 0], [0, 0, 2]]), "not a rotation"),
    "mirrored R": (entry(R=[[1, 0, 0], [0, 1, 0], [0, 0, -1]]), "not a rotation"),
    "R alone": (entry(t=...), "R and t together"),
    "no pose": (entry(R=..., t=...), "registered camera has K, R and t"),
    "failed with pose": (entry(status="failed"), "failed photo has no R and t"),
}


@pytest.mark.parametrize(("bad", "says"), BAD_ENTRIES.values(), ids=BAD_ENTRIES.keys())
def test_a_bad_entry_is_named_with_its_key(tmp_path, bad, says):
    good = entry(file="good.jpg")
    with pytest.raises(InputError, match=says) as error:
        read_cameras(written(tmp_path, good, bad))
    assert "photo a.jpg" in str(error.value)
    assert "cameras.json" in str(error.value)
    assert "\n" not in str(error.value)


def test_an_entry_without_a_name_is_called_by_its_number(tmp_path):
    with pytest.raises(InputError, match=r"photo number 2: file"):
        read_cameras(written(tmp_path, entry(), entry(file=...)))


BAD_FILES = {
    "not json": ('{"format": "texproj-cameras",\n "version": 1,\n "photos": [}', "line 3"),
    "list": ("[]", "cameras.json"),
    "no photos": ('{"format": "texproj-cameras", "version": 1}', "photos"),
    "other format": ('{"format": "colmap", "version": 1, "photos": []}', "'colmap'"),
    "newer": ('{"format": "texproj-cameras", "version": 2, "photos": []}', "version 2"),
}


@pytest.mark.parametrize(("text", "says"), BAD_FILES.values(), ids=BAD_FILES.keys())
def test_a_file_that_is_not_ours_says_why(tmp_path, text, says):
    (tmp_path / "cameras.json").write_text(text)
    with pytest.raises(InputError, match=says):
        read_cameras(tmp_path / "cameras.json")


def test_a_missing_binary_or_repeating_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_cameras(tmp_path / "none.json")
    (tmp_path / "cameras.json").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(InputError, match="UTF-8"):
        read_cameras(tmp_path / "cameras.json")
    with pytest.raises(InputError, match=r"a\.jpg appears twice"):
        read_cameras(written(tmp_path, entry(), entry()))


def test_the_reference_cameras_of_the_real_scenes_are_read(real_data):
    for scene, count in {"fountain-P11": 11, "sceaux-castle": 10}.items():
        file = read_cameras(real_data(scene) / "cameras_reference.json")
        assert len(file.records) == count
        assert all(record.camera for record in file.records)
        assert "source" in file.extra


def test_what_registration_and_refinement_left_is_a_field_and_is_written_as_it_was(tmp_path):
    """`start` and `before_refine`, as every version has written them: byte by byte the same."""
    plain = {key: value for key, value in entry().items() if key != "file"}
    own = {"note": 1, "start": plain, **entry(t=[1, 2, 3.5])}
    refined = {"entry": own, "refined": "abc", "asked": True}
    whole = {"note": 1, "start": plain, "before_refine": refined, **entry()}
    record = read_cameras(written(tmp_path, whole)).records[0]

    assert record.sought and record.start.pose.t.tolist() == [1, 2, 3]
    assert record.refinement.own.pose.t.tolist() == [1, 2, 3.5] and record.refinement.asked
    assert record.refinement.own.sought and record.extra == {"note": 1}
    again = json.loads(json.dumps(whole), parse_int=float)  # matrices are of floating point
    assert json.loads(json.dumps(entry_of_record(record)), parse_int=float) == again
    assert list(entry_of_record(record)) == list(whole)
    unsought = record_of_entry({**entry(), "start": None})
    assert unsought.sought and unsought.start is None
    assert not record_of_entry(entry()).sought


@pytest.mark.parametrize(
    ("left", "words"),
    [
        ({"start": 5}, "start: must be an entry"),
        ({"start": {"width": 3}}, "start: height"),
        ({"before_refine": {"entry": 3, "refined": ""}}, "before_refine: entry"),
        ({"before_refine": {"refined": "x"}}, "before_refine: entry"),
    ],
)
def test_what_registration_left_and_somebody_broke_is_named(tmp_path, left, words):
    """Not kept in silence until it is needed: the key is named at once."""
    with pytest.raises(InputError, match=words):
        read_cameras(written(tmp_path, entry(**left)))


@pytest.mark.parametrize(("model", "count"), [("perspective", 5), ("fisheye", 4)])
def test_a_lens_without_a_distortion_has_none(tmp_path, model, count):
    """Nobody is told of coefficients that he did not write."""
    k = read_cameras(written(tmp_path, entry(model=model, dist=...))).records[0].intrinsics
    assert (k.model, k.dist) == (model, (0.0,) * count)
