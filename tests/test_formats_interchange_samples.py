"""Camera files of other programs written by hand, with pixels worked out on paper."""

import json

import cv2
import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.interchange import READERS, Shot, detect, other_models
from texproj.formats.interchange.colmap import write_colmap

SIZE = (2000, 1500)


def read(kind, path, size=SIZE):
    return READERS[kind](path, lambda name: size)


def pixel(model, point, index=0):
    return model.cameras[index].camera.project([point])[0][0].tolist()


# --- COLMAP


def colmap_folder(folder, lens="SIMPLE_RADIAL 640 480 500 320 240 0.1"):
    h = np.sqrt(0.5)
    (folder / "cameras.txt").write_text(f"# head\n7 {lens}\n")
    (folder / "images.txt").write_text(
        f"# head\n3 {h} 0 0 {h} 0 0 5 7 left/a b.jpg\n\n4 1 0 0 0 0 0 5 7 right/c.jpg\n1.5 2.5 -1\n"
    )
    return folder


def test_colmap_text(tmp_path):
    """A quarter turn about z puts (1, 0, 0) at (0, 1, 5); k1 = 0.1 makes 0.2 into 0.2008. Names
    may hold spaces, lines of observations may be empty.
    """
    model = read("colmap", colmap_folder(tmp_path))

    assert [c.name for c in model.cameras] == ["left/a b.jpg", "right/c.jpg"]
    assert pixel(model, (1, 0, 0)) == pytest.approx([320, 340.4])
    assert pixel(model, (1, 0, 0), 1) == pytest.approx([420.4, 240])


@pytest.mark.parametrize("observed", [0, 1, 2])
def test_colmap_images_without_their_empty_lines(observed, tmp_path):
    """Scripts that strip a file take the empty lines of observations out; those that are not empty
    stay, and are no images.
    """
    colmap_folder(tmp_path)
    points = "".join(f"{x}.5 {x}.25 -1 " for x in range(10 * observed)).strip()
    rows = [f"{k} 1 0 0 0 0 0 5 7 {k}.jpg" for k in range(1, 5)]
    lines = [rows[0], *([points] if observed else []), rows[1], rows[2],
             *([points] if observed == 2 else []), rows[3]]  # fmt: skip
    (tmp_path / "images.txt").write_text("\n".join(lines) + "\n")

    names = [camera.name for camera in read("colmap", tmp_path).cameras]
    assert names == ["1.jpg", "2.jpg", "3.jpg", "4.jpg"]


def test_colmap_needs_no_points(tmp_path):
    """points3D is not looked at: it may be absent, or anything."""
    colmap_folder(tmp_path)
    (tmp_path / "points3D.txt").write_bytes(b"\xff\x00")

    assert len(read(*detect(tmp_path)).cameras) == 2


LENSES = [
    ("SIMPLE_PINHOLE 640 480 500 320 240", 0.2),
    ("PINHOLE 640 480 500 400 320 240", 0.2),
    ("RADIAL 640 480 500 320 240 0.1 0.5", 0.2 * (1 + 0.1 * 0.04 + 0.5 * 0.0016)),
    ("OPENCV 640 480 500 400 320 240 0.1 0.5 0 0.01", 0.20096 + 0.01 * 3 * 0.04),
    ("FULL_OPENCV 640 480 500 400 320 240 0 0 0 0 2 0.1 0 0", 0.2 * (1 + 2 * 6.4e-5) / 1.004),
]


@pytest.mark.parametrize(("lens", "x"), LENSES, ids=lambda v: str(v).split()[0])
def test_each_colmap_lens(lens, x, tmp_path):
    """(1, 0, 5) has x/z = 0.2; where it falls follows from the model's formula."""
    model = read("colmap", colmap_folder(tmp_path, lens))

    assert pixel(model, (1, 0, 0), 1) == pytest.approx([320 + 500 * x, 240])


WIDE_LENSES = [
    ("RAD_TAN_THIN_PRISM_FISHEYE 640 480 150 150 320 240 0 0 0 0 0 0 0 0 0 0 0 0", "FISHEYE"),
    ("FOV 640 480 500 500 320 240 0.9", "FOV"),
]


@pytest.mark.parametrize(("lens", "word"), WIDE_LENSES)
def test_lenses_without_a_perspective_picture_are_refused_with_a_way_out(lens, word, tmp_path):
    """The reason tells the lens and what to do."""
    model = read("colmap", colmap_folder(tmp_path, lens))

    assert model.cameras == ()
    assert word in model.refused["right/c.jpg"] and "undistort" in model.refused["right/c.jpg"]


FISHEYES = [
    ("colmap", "OPENCV_FISHEYE 640 480 500 500 320 240 0.05 0.01 0.002 -0.001"),
    ("colmap", "RADIAL_FISHEYE 640 480 500 320 240 0.05 0.01"),
    ("nerfstudio", {"camera_model": "OPENCV_FISHEYE"}),
    ("nerfstudio", {"is_fisheye": True}),
]


@pytest.mark.parametrize(("kind", "lens"), FISHEYES, ids=str)
def test_a_fisheye_comes_as_it_is(kind, lens, tmp_path):
    """Points all over the picture fall where OpenCV's own fisheye puts them; none is left out, so
    nothing need be said.
    """
    k = np.array([0.05, 0.01, 0.002, -0.001])
    if kind == "colmap":
        k[2:] *= not lens.startswith("RADIAL")
        path = colmap_folder(tmp_path, lens)
    else:
        named = dict(zip(("k1", "k2", "k3", "k4"), k, strict=True))
        path = transforms(tmp_path, w=640, h=480, fl_x=500, cx=320, cy=240, **named, **lens)
    found = read(kind, path).cameras[-1]
    pixels = np.random.default_rng(5).uniform((20, 20), (620, 460), (50, 2))
    K = np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1.0]])
    ideal = cv2.fisheye.undistortPoints(pixels[:, None], K, k)[:, 0]

    ours = found.camera.intrinsics.distort(ideal) * 500 + (320, 240)
    np.testing.assert_allclose(ours, pixels, rtol=0, atol=1e-6)
    assert found.camera.intrinsics.model == "fisheye" and found.notes == ()


# --- Bundler


def test_bundler(tmp_path):
    """P = (1, 2, -10): p = (0.1, 0.2), 100 px right of and 200 px above the middle; a photo with
    f = 0 has no camera; the list may tell a focal length.
    """
    identity = "1 0 0\n0 1 0\n0 0 1\n0 0 -10\n"
    text = f"# Bundle file v0.3\n2 1\n1000 0 0\n{identity}0 0 0\n{identity}1 2 3\n255 0 0\n0\n"
    (tmp_path / "bundle").mkdir()
    (tmp_path / "bundle" / "bundle.out").write_text(text)
    (tmp_path / "list.txt").write_text("./my photo.jpg 0 930.5\n./b.jpg\n")
    model = read("bundler", tmp_path / "bundle" / "bundle.out")

    assert [c.name for c in model.cameras] == ["./my photo.jpg"]
    assert pixel(model, (1, 2, 0)) == pytest.approx([1100, 550])
    assert list(model.refused) == ["./b.jpg"] and "no camera" in model.refused["./b.jpg"]


def test_bundler_without_the_photo_says_that_it_is_absent(tmp_path):
    """The format tells no image size: a photo that is not here has no camera, and no error."""
    (tmp_path / "bundle.out").write_text("# v0.3\n1 0\n9 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n")
    (tmp_path / "list.txt").write_text("a.jpg\n")

    model = read("bundler", tmp_path / "bundle.out", None)

    assert (model.cameras, model.absent) == ((), ("a.jpg",))


@pytest.mark.parametrize(
    "name", ["bundle.list.txt", "bundle.out.list.txt", "List.TXT", "pictures.txt", "anything.txt"]
)
def test_bundler_lists_have_many_names(name, tmp_path):
    """Those that programs give them, and the one text that names as many photos."""
    (tmp_path / "bundle.out").write_text("# v0.3\n1 0\n900 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 9\n")
    (tmp_path / name).write_text("C:\\photos\\my photo 2.jpg 2000 1500 930.5\n")
    (tmp_path / "readme.txt").write_text("One line of words.\n")

    model = read("bundler", tmp_path / "bundle.out")
    assert [c.name for c in model.cameras] == ["C:\\photos\\my photo 2.jpg"]


# --- MeshLab

RASTER = """<!DOCTYPE MeshLabDocument>
<MeshLabProject><MeshGroup><MLMesh filename="m.ply"><MLMatrix44>{matrix}</MLMatrix44></MLMesh>
</MeshGroup><RasterGroup><MLRaster label="one"><VCGCamera TranslationVector="-1 -2 -10 1"
LensDistortion="{k}" ViewportPx="2000 1500" PixelSizeMm="0.01 0.02" CenterPx="1000 700"
FocalMm="30" CameraType="0" BinaryData="{binary}"
RotationMatrix="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 "/><Plane semantic="1" fileName="photos/a.jpg"/>
</MLRaster></RasterGroup></MeshLabProject>"""
UNMOVED = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"


def meshlab_file(tmp_path, matrix=UNMOVED, k="0 0", binary=0):
    path = tmp_path / "project.mlp"
    path.write_text(RASTER.format(matrix=matrix, k=k, binary=binary))
    return path


def test_meshlab(tmp_path):
    """C = (1, 2, 10), (2, 3, 5) is seen at (1, 1) in depth 5: 600 px right of 1000, 300 px above
    700 counted from the bottom, that is row 500.
    """
    model = read("meshlab", meshlab_file(tmp_path))

    assert model.cameras[0].name == "photos/a.jpg" and model.cameras[0].notes == ()
    assert model.cameras[0].camera.center.tolist() == [1, 2, 10]
    assert pixel(model, (2, 3, 5)) == pytest.approx([1600, 500])


def test_meshlab_layer_matrix_is_undone(tmp_path):
    """The layer doubles the mesh and adds 1 to x: (0.5, 1.5, 2.5) in the file is (2, 3, 5)."""
    model = read("meshlab", meshlab_file(tmp_path, "2 0 0 1 0 2 0 0 0 0 2 0 0 0 0 1"))

    assert pixel(model, (0.5, 1.5, 2.5)) == pytest.approx([1600, 500])
    assert "matrix" in model.notes[0]


def test_meshlab_distortion_is_ignored_with_a_word(tmp_path):
    assert "ignored" in read("meshlab", meshlab_file(tmp_path, k="0.1 0")).cameras[0].notes[0]


def test_meshlab_raster_without_a_viewport_says_what_to_do(tmp_path):
    path = meshlab_file(tmp_path)
    path.write_text(path.read_text().replace('"2000 1500"', '"-1 -1"'))

    reason = read("meshlab", path).refused["photos/a.jpg"]
    assert "-1 x -1" in reason and "align" in reason


# --- Metashape

CHUNK = """<?xml version="1.0" encoding="UTF-8"?><document version="2.0.0"><chunk>
<sensors><sensor id="0" type="frame"><resolution width="2000" height="1500"/>
<calibration type="frame" class="initial"><f>9</f></calibration>
<calibration type="{kind}" class="adjusted"><f>1000</f>{lens}</calibration></sensor></sensors>
{before}<cameras>
<group><camera id="0" sensor_id="0" label="A"><transform>1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1</transform>
</camera></group><camera id="1" sensor_id="0" label="B"/></cameras>{after}</chunk></document>"""
TRANSFORM = """<transform><rotation locked="false">0 -1 0 1 0 0 0 0 1</rotation>
<translation>10 20 30</translation><scale>2</scale></transform>"""


def metashape_file(tmp_path, kind="frame", lens="", before="", after=""):
    path = tmp_path / "cameras.xml"
    path.write_text(CHUNK.format(kind=kind, lens=lens, before=before, after=after))
    return path


def test_metashape_chunk_transform(tmp_path):
    """The camera at (1, 0, 0) of the chunk stands at 2 R (1, 0, 0) + (10, 20, 30) = (10, 22, 30),
    its x axis along world y; a camera without a transform is not aligned.
    """
    model = read("metashape", metashape_file(tmp_path, after=TRANSFORM))

    assert [c.name for c in model.cameras] == ["A"] and "not aligned" in model.refused["B"]
    assert model.cameras[0].camera.center.tolist() == [10, 22, 30]
    assert pixel(model, (10, 23, 34)) == pytest.approx([1000 + 250, 750])


def test_metashape_component_transform(tmp_path):
    """Newer files keep the transform in a component that the camera names."""
    component = f'<components><component id="3">{TRANSFORM}</component></components>'
    path = metashape_file(tmp_path, before=component)
    path.write_text(path.read_text().replace('sensor_id="0"', 'sensor_id="0" component_id="3"'))

    assert read("metashape", path).cameras[0].camera.center.tolist() == [10, 22, 30]


def test_metashape_lens(tmp_path):
    """x = 0.2, y = 0, r^2 = 0.04: u gains 3 p1 r^2 and v gains p2 r^2; b1 widens x, cx counts from
    the middle.
    """
    lens = "<cx>5</cx><cy>-3</cy><b1>100</b1><k1>0.1</k1><p1>0.01</p1><p2>0.02</p2>"
    model = read("metashape", metashape_file(tmp_path, lens=lens))
    x, y = 0.2 * 1.004 + 0.01 * 0.12, 0.02 * 0.04

    assert pixel(model, (2, 0, 5)) == pytest.approx([1005 + 1100 * x, 747 + 1000 * y])


def test_metashape_fourth_radial_term_is_fitted(tmp_path):
    """k4, which OpenCV's lens lacks, is met within the error that the note tells, all over the
    picture; the note's error is small.
    """
    path = metashape_file(tmp_path, lens="<k1>-0.1</k1><k2>0.05</k2><k4>0.02</k4>")
    found = read("metashape", path).cameras[0]
    x = np.linspace(0.0, 1.0, 50)
    told = x * (1 - 0.1 * x**2 + 0.05 * x**4 + 0.02 * x**8)
    ours = found.camera.intrinsics.distort(np.stack([x, 0 * x], axis=1))[:, 0]
    claimed = float(found.notes[0].split("within ")[1].split(" px")[0])

    assert 1000 * np.abs(ours - told).max() <= 1.05 * claimed < 0.05


def test_metashape_skew_is_told(tmp_path):
    """b2 = 2 at half the height of 1500 px and f = 1000: 1.5 px."""
    found = read("metashape", metashape_file(tmp_path, lens="<b2>2</b2>")).cameras[0]

    assert "b2 = 2" in found.notes[0] and "1.5 px" in found.notes[0]


def test_metashape_fisheye_is_one_and_a_sphere_is_refused(tmp_path):
    found = read("metashape", metashape_file(tmp_path, kind="fisheye")).cameras[0]
    assert found.camera.intrinsics.model == "fisheye"
    assert "neither" in read("metashape", metashape_file(tmp_path, kind="spherical")).refused["A"]


def test_metashape_georeferenced_chunk_is_told(tmp_path):
    after = '<reference>GEOGCS["WGS 84"]</reference>'

    assert "georeferenced" in read("metashape", metashape_file(tmp_path, after=after)).notes[0]


RIGS = {
    # second sensor: looks along the master's x, 3 in front of it; by hand: at (1, 0, 0) + (0, 0, 3)
    "slave": ('master_id="0"', '<rotation locked="false">0 0 1 0 1 0 -1 0 0</rotation>'
              "<location>0 0 3</location>", (1, 0, 3), (6, 1, 3), (1000, 950)),
    "apart": ('master_id="0"', "<location>1 0 0</location>", (2, 0, 0), (3, 0, 5), (1200, 750)),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGS)
def test_metashape_rigs(name, tmp_path):
    """The other cameras of a rig stand where their sensors' places on it lead from the master's."""
    attribute, place, center, point, expected = RIGS[name]
    path = metashape_file(tmp_path)
    text = path.read_text().replace(
        'sensor_id="0" label="B"', 'sensor_id="1" master_id="0" label="B"'
    )
    second = (
        f'<sensor id="1" type="frame" {attribute}>{place}<resolution width="2000" height="1500"/>'
    )
    second += '<calibration class="adjusted"><f>1000</f></calibration></sensor></sensors>'
    path.write_text(text.replace("</sensors>", second))
    model = read("metashape", path)

    assert [camera.name for camera in model.cameras] == ["A", "B"]
    assert model.cameras[1].camera.center == pytest.approx(center)
    assert pixel(model, point, 1) == pytest.approx(expected)
    assert not model.cameras[1].start_only
    path.write_text(path.read_text().replace("</chunk>", f"{TRANSFORM}</chunk>"))
    scaled = read("metashape", path)
    assert "in which unit" in scaled.cameras[1].start_only and not scaled.cameras[0].start_only


def test_metashape_rigs_and_disabled_cameras_say_what_to_do(tmp_path):
    """Without a place on the rig its photos but the first have no pose; disabled cameras keep the
    pose of an earlier day.
    """
    path = metashape_file(tmp_path)
    text = path.read_text().replace('label="B"', 'label="B" master_id="0"')
    text = text.replace('label="A"', 'label="A" enabled="false"')
    path.write_text(text)
    model = read("metashape", path)

    assert model.cameras == ()
    assert "rig" in model.refused["B"] and "COLMAP" in model.refused["B"]
    assert "disabled" in model.refused["A"] and "enable" in model.refused["A"]


def test_metashape_tells_the_orientation(tmp_path):
    path = metashape_file(tmp_path)
    text = path.read_text().replace("</transform>\n</camera>", "</transform><orientation>6"
                                    "</orientation></camera>")  # fmt: skip
    path.write_text(text)

    assert read("metashape", path).cameras[0].orientation == 6


# --- RealityScan

HEADER = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n"


@pytest.mark.parametrize(
    ("angles", "point", "expected"),
    [
        ("0,0,0", (1, 2, 0), (1200, 350)),  # looks down, top to north: x right, y up
        ("90,0,0", (1, 2, 0), (600, 550)),  # top to east: north is left
        ("0,90,0", (1, 10, 12), (1200, 350)),  # level, looks north: east is right, z up
        ("90,90,0", (10, 2, 12), (600, 350)),  # level, looks east: north is left
    ],
)
def test_realityscan(angles, point, expected, tmp_path):
    """From (0, 0, 10) with f = 36 mm, that is 2000 px, and 10 units of distance."""
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER}a.jpg,0,0,10,{angles},36,0,0,0,0,0,0,0,0\n")

    assert pixel(read("realityscan", path), point) == pytest.approx(expected)


def test_realityscan_principal_point(tmp_path):
    """px = 0.01 of the longer side is 20 px, also down."""
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER}a.jpg,0,0,10,0,0,0,36,0.01,0.01,0,0,0,0,0,0\n")

    assert pixel(read("realityscan", path), (0, 0, 0)) == pytest.approx((1020, 770))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-8-sig"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_realityscan_tables_of_other_countries(encoding, end, tmp_path):
    """Semicolons between the values, decimals with commas, any line end and encoding."""
    path = tmp_path / "a.csv"
    text = f"{HEADER}a.jpg,0,0,10,0,0,0,36,0.01,0.01,0,0,0,0,0,0\n".replace(",", ";")
    path.write_bytes(text.replace(".01", ",01").replace("\n", end).encode(encoding))

    assert pixel(read("realityscan", path), (0, 0, 0)) == pytest.approx((1020, 770))


def test_decimal_commas_between_commas_are_told(tmp_path):
    """Nothing tells which comma is which: the sentence says how to export."""
    path = tmp_path / "a.csv"
    path.write_text(f"{HEADER}a.jpg,0,0,10,0,0,0,36,0,01,0,01,0,0,0,0,0,0\n")

    with pytest.raises(InputError, match=r"line 2: 18 values for 16 columns.*semicolons"):
        read("realityscan", path)


SIDECAR = """<x:xmpmeta xmlns:x="adobe:ns:meta/">
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description
xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" xcr:Version="3" xcr:Coordinates="{world}"
xcr:DistortionModel="{model}" xcr:FocalLength35mm="18" xcr:Skew="0" xcr:AspectRatio="1"
xcr:PrincipalPointU="0.01" xcr:PrincipalPointV="-0.01"><xcr:Rotation>0 1 0 -1 0 0 0 0 1
</xcr:Rotation><xcr:Position>1 2 3</xcr:Position>
<xcr:DistortionCoeficients>0.1 0 0 0 0 0</xcr:DistortionCoeficients></rdf:Description></rdf:RDF>
</x:xmpmeta>"""


def test_realityscan_sidecars(tmp_path):
    """f = 18 mm of 36 is 1000 px of 2000; x along world y: (1, 3, 8) is at (1, 0, 5)."""
    (tmp_path / "a.xmp").write_text(SIDECAR.format(model="brown3", world="local"))
    (tmp_path / "b.xmp").write_text(SIDECAR.format(model="division", world="local"))
    (tmp_path / "raw.xmp").write_text("<x:xmpmeta xmlns:x='adobe:ns:meta/'/>")
    model = read(*detect(tmp_path))

    assert [c.name for c in model.cameras] == ["a"] and "division" in model.refused["b"]
    assert pixel(model, (1, 3, 8)) == pytest.approx([1020 + 200.8, 730])
    assert detect(tmp_path / "a.xmp") == ("realityscan-xmp", tmp_path)


def test_absolute_sidecars_are_told(tmp_path):
    (tmp_path / "a.xmp").write_text(SIDECAR.format(model="brown3", world="absolute"))

    assert "same system" in read(*detect(tmp_path)).notes[0]


# --- nerfstudio


def transforms(tmp_path, **more):
    matrix = [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 10], [0, 0, 0, 1]]
    frame = {"file_path": "./images/a.png", "transform_matrix": matrix}
    content = {"w": 2000, "h": 1500, "fl_x": 1000, "cx": 1000, "cy": 750, "frames": [frame]}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({k: v for k, v in (content | more).items() if v is not None}))
    return path


def test_nerfstudio(tmp_path):
    """From (1, 2, 10) down -z, (2, 3, 5) is 0.2 right and 0.2 up."""
    assert pixel(read("nerfstudio", transforms(tmp_path)), (2, 3, 5)) == pytest.approx([1200, 550])


def test_nerfstudio_applied_transform_is_undone(tmp_path):
    """The file's world is (x, z, -y) of ours, twice as large: (2, 3, 5) there is ours at
    (1, -2.5, 1.5).
    """
    applied = [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]]
    model = read("nerfstudio", transforms(tmp_path, applied_transform=applied, applied_scale=2))

    assert pixel(model, (1, -2.5, 1.5)) == pytest.approx([1200, 550])
    assert "undone" in model.notes[0]


def test_nerfstudio_field_of_view(tmp_path):
    """90 degrees over 2000 px: f = 1000."""
    path = transforms(tmp_path, fl_x=None, camera_angle_x=np.pi / 2)

    assert pixel(read("nerfstudio", path), (2, 3, 5)) == pytest.approx([1200, 550])


def test_nerfstudio_panoramas_are_refused(tmp_path):
    model = read("nerfstudio", transforms(tmp_path, camera_model="EQUIRECTANGULAR"))

    assert "EQUIRECTANGULAR" in model.refused["./images/a.png"]


# --- openMVG


def openmvg_file(tmp_path):
    def view(number, pose, lens):
        data = {"filename": f"{number}.jpg", "id_pose": pose, "id_intrinsic": lens}
        return {"key": number, "value": {"ptr_wrapper": {"data": data}}}

    def lens(key, type_number, name, data):
        named = {"polymorphic_name": name} if name else {}
        return {"key": key, "value": {"polymorphic_id": type_number, **named,
                                      "ptr_wrapper": {"data": data}}}  # fmt: skip

    base = {"width": 2000, "height": 1500, "focal_length": 1000, "principal_point": [1000, 750]}
    t2 = [0.1, 0, 0, 0.02, 0.01]
    content = {
        "sfm_data_version": "0.3",
        "views": [view(0, 0, 0), view(1, 0, 1), view(2, 9, 0), view(3, 0, 2)],
        "intrinsics": [
            lens(0, 0x80000001, "pinhole_brown_t2", {**base, "disto_t2": t2}),
            lens(1, 1, None, {"value0": base, "disto_t2": [0] * 5}),
            lens(2, 0x80000002, "fisheye", {**base, "fisheye": [0] * 4}),
        ],
        "extrinsics": [{"key": 0, "value": {"rotation": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
                                            "center": [1, 2, 3]}}],
    }  # fmt: skip
    path = tmp_path / "sfm_data.json"
    path.write_text(json.dumps(content))
    return path


def test_openmvg(tmp_path):
    """(1, 3, 8) is seen at (1, 0, 5): x = 0.2, r^2 = 0.04; a type is named only once in the file,
    and a base class may be an object of its own.
    """
    model = read("openmvg", openmvg_file(tmp_path))
    x, y = 0.2 * 1.004 + 0.01 * 0.12, 0.02 * 0.04

    assert [c.name for c in model.cameras] == ["0.jpg", "1.jpg"]
    assert pixel(model, (1, 3, 8)) == pytest.approx([1000 + 1000 * x, 750 + 1000 * y])
    assert pixel(model, (1, 3, 8), 1) == pytest.approx([1200, 750])
    assert "no pose" in model.refused["2.jpg"] and "fisheye" in model.refused["3.jpg"]


# --- Meshroom

VERSIONS = [
    ((1, 1, 0), {"pxFocalLength": "1000", "principalPoint": ["1010", "740"]}),
    ((1, 2, 0), {"pxFocalLength": ["1000", "1000"], "principalPoint": ["1010", "740"]}),
    ((1, 2, 1), {"pxFocalLength": ["1000", "1000"], "principalPoint": ["10", "-10"]}),
    ((1, 2, 6), {"focalLength": "18", "sensorWidth": "36", "principalPoint": ["10", "-10"]}),
]


@pytest.mark.parametrize(("version", "lens"), VERSIONS, ids=lambda v: str(v)[:12])
def test_meshroom(version, lens, tmp_path):
    """The same camera in each version's words: (1, 3, 8) from (1, 2, 3) with x along world y is at
    (1, 0, 5); the rotation is written by columns, a view may have no pose.
    """
    content = {
        "version": [str(n) for n in version],
        "views": [{"poseId": "5", "intrinsicId": "7", "path": "/x/a.jpg"},
                  {"poseId": "6", "intrinsicId": "7", "path": "/x/b.jpg"}],
        "intrinsics": [{"intrinsicId": "7", "width": "2000", "height": "1500", "type": "radial3",
                        "distortionParams": ["0.1", "0", "0"], **lens}],
        "poses": [{"poseId": "5", "pose": {"transform": {
            "rotation": ["0", "-1", "0", "1", "0", "0", "0", "0", "1"],
            "center": ["1", "2", "3"]}}}],
    }  # fmt: skip
    path = tmp_path / "cameras.sfm"
    path.write_text(json.dumps(content))
    model = read("meshroom", path)

    assert pixel(model, (1, 3, 8)) == pytest.approx([1010 + 200.8, 740])
    assert "no pose" in model.refused["/x/b.jpg"]


# --- which format


def test_the_format_is_found_from_name_and_content(tmp_path):
    """Files by their ending, JSON by what is in it, COLMAP by its folder or one of its files."""
    (tmp_path / "sparse" / "0").mkdir(parents=True)
    colmap_folder(tmp_path / "sparse" / "0")
    kinds = {
        meshlab_file(tmp_path): "meshlab", metashape_file(tmp_path): "metashape",
        transforms(tmp_path): "nerfstudio", openmvg_file(tmp_path): "openmvg",
        tmp_path / "sparse" / "0" / "images.txt": "colmap", tmp_path: "colmap",
    }  # fmt: skip

    assert {path: detect(path)[0] for path in kinds} == kinds
    assert detect(tmp_path)[1] == tmp_path / "sparse" / "0"
    assert detect(tmp_path, "metashape") == ("metashape", tmp_path / "cameras.xml")


@pytest.mark.parametrize("binary", [False, True])
def test_the_largest_colmap_model_is_found(binary, tmp_path):
    """Of sparse/0, sparse/1, ... the one with most photos; the others are told."""
    lens = Intrinsics(640, 480, 500, 500, 320, 240)
    for part, count in (("0", 2), ("1", 3), ("10", 1)):
        folder = tmp_path / "sparse" / part
        folder.mkdir(parents=True)
        shots = [Shot(f"{k}.jpg", "", Camera(lens, Pose.identity())) for k in range(count)]
        for name, content in write_colmap(shots, binary).files.items():
            (folder / name).write_bytes(content)
    kind, found = detect(tmp_path)

    assert (kind, found) == ("colmap", tmp_path / "sparse" / "1")
    assert len(read(kind, found).cameras) == 3
    assert "0 (2 photos), 10 (1 photos)" in other_models(tmp_path, found)[0]
    assert other_models(found, found) == ()


@pytest.mark.parametrize("name", ["absent.xml", "empty", "a.txt", "other.json"])
def test_what_is_no_camera_file_is_said(name, tmp_path):
    """One sentence that names the path."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("hello")
    (tmp_path / "other.json").write_text("{}")

    with pytest.raises(InputError, match=name):
        detect(tmp_path / name)


# --- broken files

BROKEN = [
    ("metashape", "c.xml", "<document><chunk>", "not XML"),
    ("metashape", "c.xml", "<html/>", "not a Metashape camera file"),
    ("metashape", "c.xml", CHUNK.format(
        kind="frame", lens="<k1>x</k1>", before="", after=""), "k1"),
    ("metashape", "c.xml", CHUNK.replace("1 0 0 1 0 1", "1 0 0 1 0 5").format(
        kind="frame", lens="", before="", after=""), "not a rotation"),
    ("metashape", "c.xml", CHUNK.format(kind="frame", lens="", before="", after=TRANSFORM.replace(
        "<scale>2", "<scale>-2")), "scale"),
    ("meshlab", "p.mlp", "<project/>", "not a MeshLab project"),
    ("meshlab", "p.mlp", RASTER.format(matrix=UNMOVED, k="0 0", binary=1), "binary"),
    ("meshlab", "p.mlp", RASTER.format(matrix="1 2", k="0 0", binary=0), "16 numbers"),
    ("meshlab", "p.mlp", RASTER.format(matrix=UNMOVED, k="nan 0", binary=0), "LensDistortion"),
    ("realityscan", "c.csv", "name,x,y\n", "no column 'alt'"),
    ("realityscan", "c.csv", f"{HEADER}a.jpg,1,2\n", "line 2"),
    ("realityscan", "c.csv", f"{HEADER}a.jpg,0,0,east,0,0,0,36,0,0,0,0,0,0,0,0\n", "alt"),
    ("nerfstudio", "t.json", '{"frames": 3}', "must be a list"),
    ("nerfstudio", "t.json", '{"frames": [', "line 1: not JSON"),
    ("nerfstudio", "t.json", '{"frames": [{"file_path": "a"}]}', "focal length"),
    ("nerfstudio", "t.json",
     '{"fl_x": 900, "frames": [{"file_path": "a", "transform_matrix": [1]}]}', "3 or 4 rows"),
    ("nerfstudio", "t.json", "[]", "an object"),
    ("openmvg", "s.json", '{"views": [], "intrinsics": []}', "no 'extrinsics'"),
    ("meshroom", "c.sfm", '{"version": ["1", "9", "0"]}', "1.9.0"),
    ("meshroom", "c.sfm", '{"version": ["1", "2", "0"], "views": []}', "no 'intrinsics'"),
    ("bundler", "b.out", "no cameras here\n", "not a Bundler file"),
    ("bundler", "b.out", "# v0.3\n2 0\n9 0 0\n", "ends in the middle"),
    ("bundler", "b.out", "# v0.3\n2 0\n" + "9 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n" * 2, "1 photos"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "name", "text", "words"), BROKEN)
def test_a_broken_file_is_one_sentence(kind, name, text, words, tmp_path):
    """It names the file and what is wrong in it."""
    (tmp_path / name).write_text(text)
    (tmp_path / "list.txt").write_text("a.jpg\n")

    with pytest.raises(InputError, match=words) as error:
        read(kind, tmp_path / name)

    assert name in str(error.value) and "\n" not in str(error.value)


BROKEN_COLMAP = [
    ("cameras.txt", "7 LENS 1 2 3\n", "line 1"),
    ("cameras.txt", "7\n", "line 1"),
    ("cameras.txt", "7 PINHOLE 640 480 500\n", "6 numbers"),
    ("cameras.txt", "8 PINHOLE 640 480 500 500 320 240\n", "camera 7 is not in"),
    ("images.txt", "3 1 0 0 0 0 0\n\n", "line 1"),
    ("images.txt", "3 0 0 0 0 0 0 5 7 a.jpg\n\n", "unit quaternion"),
    ("images.txt", "3 nan 0 0 0 0 0 5 7 a.jpg\n\n", "line 1"),
    ("cameras.bin", b"\x01\0\0\0\0\0\0\0\x01\0", "ends in the middle"),
    ("cameras.bin", b"\x01" + 7 * b"\0" + b"\x01\0\0\0\x63\0\0\0" + 16 * b"\0", "unknown model 99"),
]


@pytest.mark.parametrize(("name", "content", "words"), BROKEN_COLMAP)
def test_a_broken_colmap_model_is_one_sentence(name, content, words, tmp_path):
    """It names the file, the line and what is wrong."""
    colmap_folder(tmp_path)
    if isinstance(content, bytes):
        (tmp_path / name).write_bytes(content)
        (tmp_path / "images.bin").write_bytes(8 * b"\0")
    else:
        (tmp_path / name).write_text(content)

    with pytest.raises(InputError, match=words):
        read("colmap", tmp_path)


def test_a_bundle_without_its_list_says_what_to_do(tmp_path):
    (tmp_path / "bundle").mkdir()
    (tmp_path / "bundle" / "b.out").write_text("# v0.3\n0 0\n")

    with pytest.raises(InputError, match=r"list\.txt"):
        read("bundler", tmp_path / "bundle" / "b.out")
