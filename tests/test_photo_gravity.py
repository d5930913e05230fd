"""Upward in a photo, as a gimbal has measured it."""

import io

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from texproj.formats.photos import read_photo_info

HEAD = '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF><rdf:Description {0}>{1}</rdf:Description>'
TURNED = {1: None, 3: Image.ROTATE_180, 6: Image.ROTATE_270, 8: Image.ROTATE_90}
"""What a viewer does to show the picture upright."""


def told(folder, attributes="", elements="", orientation=1):
    exif = Image.Exif()
    exif[274] = orientation
    xmp = (HEAD.format(attributes, elements) + "</rdf:RDF></x:xmpmeta>").encode()
    Image.new("RGB", (48, 32)).save(folder / "a.jpg", exif=exif, xmp=xmp)
    return read_photo_info(folder / "a.jpg").up_in_cam


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (-90, 0), (-30, 0), (15, 12), (-60, -170)])
def test_up_is_where_the_gimbal_says(tmp_path, pitch, roll):
    up = told(
        tmp_path, f'drone-dji:GimbalPitchDegree="{pitch:+.2f}" drone-dji:GimbalRollDegree="{roll}"'
    )
    rolled = Rotation.from_euler("z", -roll, degrees=True)
    pitched = np.array([0, -np.cos(np.radians(pitch)), np.sin(np.radians(pitch))])

    assert up == pytest.approx(rolled.apply(pitched), abs=1e-9)


def test_elements_are_read_as_attributes_are(tmp_path):
    inside = "<drone-dji:GimbalPitchDegree>-90.00</drone-dji:GimbalPitchDegree>"

    assert told(tmp_path, elements=inside) == pytest.approx((0, 0, -1))


@pytest.mark.parametrize("orientation", TURNED)
def test_up_turns_with_the_picture(tmp_path, orientation):
    """A bright top half of the stored picture is where the upright one has it."""
    stored = told(tmp_path, 'drone-dji:GimbalPitchDegree="0"')
    turned = told(tmp_path, 'drone-dji:GimbalPitchDegree="0"', orientation=orientation)
    picture = Image.fromarray(np.repeat(np.uint8([[255], [0]]), 2, axis=1))
    if TURNED[orientation] is not None:
        picture = picture.transpose(TURNED[orientation])
    bright = np.asarray(picture, float)
    gradient = np.array(
        [bright[:, 1].sum() - bright[:, 0].sum(), bright[1].sum() - bright[0].sum()]
    )

    assert stored == pytest.approx((0, -1, 0), abs=1e-9)
    assert turned[:2] == pytest.approx(gradient / np.linalg.norm(gradient), abs=1e-9)


@pytest.mark.parametrize(
    "attributes",
    ["", 'Camera:Pitch="-90"', 'drone-dji:GimbalPitchDegree="nan"',
     'drone-dji:GimbalRollDegree="3"', 'drone-dji:GimbalPitchDegree="-9000"',
     'drone-dji:GimbalPitchDegree="999.0"'],
)  # fmt: skip
def test_what_says_nothing_is_nothing(tmp_path, attributes):
    assert told(tmp_path, attributes) == ()


def test_a_photo_without_xmp_says_nothing(tmp_path):
    buffer = io.BytesIO()
    Image.new("RGB", (8, 8)).save(buffer, "JPEG")
    (tmp_path / "a.jpg").write_bytes(buffer.getvalue())

    assert read_photo_info(tmp_path / "a.jpg").up_in_cam == ()
