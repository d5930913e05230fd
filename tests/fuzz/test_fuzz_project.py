"""cameras.json, picks and project.toml end in values within bounds or in one sentence."""

import numpy as np
from fuzzing import broken_json, broken_text, refused_or_read
from hypothesis import given

from texproj.formats.camera_bounds import MOST_SIDE_PX, MOST_TRANSLATION
from texproj.formats.cameras import cameras_json, read_cameras
from texproj.formats.correspondences import read_correspondences, read_pixels
from texproj.formats.picked_points import read_picked_points
from texproj.settings import read_settings

CAMERAS = {
    "format": "texproj-cameras",
    "version": 1,
    "by": "hand",
    "photos": [
        {
            "file": "a.jpg", "width": 640, "height": 480, "status": "registered",
            "K": [[500.0, 0, 320], [0, 500.0, 240], [0, 0, 1]],
            "dist": [0.1, -0.2, 0.001, 0.002, 0.3],
            "R": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "t": [1, 2, 3],
            "method": "points", "quality": {"expected_error_px": 0.5, "picks": []},
            "extra": {"note": [1, "x"]},
        },
        {"file": "b.jpg", "width": 640, "height": 480, "status": "failed"},
    ],
}  # fmt: skip
PICKS = (
    "u,v,x,y,z,name\n10.5,20.25,1,2,3,nose\n30,40,-4,5e2,6,\n",
    "# by hand\nu;v;x;y;z\n1,5;2;3;4;5\n",
)
NAMED_POINTS = (
    "<!DOCTYPE PickedPoints>\n<PickedPoints>\n <DocumentData/>\n"
    ' <point x="1.5" y="-2.25" z="0.125" name="nose" active="1"/>\n'
    ' <point y="3" x="4" z="5" name="ear"/>\n</PickedPoints>\n',
)
SETTINGS = (
    'mesh = "mesh/a.ply"\nphotos = "photos"\nlargest_photo_mp = 500\n'
    '[color]\nto = "patches"\n[points]\nseed = 3\n[output]\nmodels = ["glb", "ply"]\n',
    "[mutual-information]\n[register]\nmax_error_percent = 1.5\n[preview]\nport = 8765\n",
)


@given(broken_json((CAMERAS,)))
def test_cameras(place, data):
    """What is read has finite numbers of possible size, and can be written and read again."""
    file = refused_or_read(read_cameras, place / "cameras.json", data)
    for record in file.records if file else ():
        assert 1 <= record.width <= MOST_SIDE_PX
        assert 1 <= record.height <= MOST_SIDE_PX
        if record.pose is not None:
            assert np.abs(record.pose.t).max() <= MOST_TRANSLATION
        if record.camera is not None:
            xy, depth = record.camera.project(np.eye(3) * 5)
            assert np.isfinite(depth).all()
            record.camera.rays(np.array([[1.0, 1.0], [record.width / 2, record.height / 2]]))
            assert xy.shape == (3, 2)
    if file:
        again = place / "again.json"
        again.write_text(cameras_json(file.records, file.extra))
        assert len(read_cameras(again).records) == len(file.records)


@given(broken_text(PICKS))
def test_picks(place, data):
    """What is read are finite numbers."""
    picks = refused_or_read(read_correspondences, place / "a.csv", data)
    if picks is not None:
        assert np.isfinite(picks.xy_px).all()
        assert np.isfinite(picks.xyz_in_world).all()
        assert len(picks.names) == len(picks)


@given(broken_text((*PICKS, "u,v,name\n1,2,a\n3,4,\n")))
def test_pixels_that_name_points(place, data):
    """Pixels are finite; a point is there or not."""
    found = refused_or_read(read_pixels, place / "p.csv", data)
    if found is not None:
        xy, xyz, names = found
        assert np.isfinite(xy).all()
        assert len(xy) == len(xyz) == len(names)


@given(broken_text(NAMED_POINTS))
def test_named_points(place, data):
    """What is read are finite numbers under names of their own."""
    points = refused_or_read(read_picked_points, place / "a.pp", data)
    for point in (points or {}).values():
        assert np.isfinite(point).all()


@given(broken_text(SETTINGS))
def test_settings(place, data):
    """Every key and value is known, or the sentence says which is not."""

    def read(path):
        return read_settings(path.read_bytes().decode("utf-8", "replace"), str(path))

    settings = refused_or_read(read, place / "project.toml", data, "read_settings")
    assert settings is None or 0 < settings.largest_photo_mp <= 1000
