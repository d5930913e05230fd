"""Camera files of other programs, broken in every way: refused by a sentence, or read."""

import json
import os

import numpy as np
import pytest
import trimesh
from fuzzing import broken_bytes, broken_json, broken_text, refused_or_read
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from texproj.camera import Camera, Intrinsics, Pose
from texproj.formats.interchange import READERS, WRITERS, Shot, detect
from texproj.project import Project
from texproj.stages.bench import Workbench
from texproj.stages.exchanging import import_cameras

SIZE = (80, 60)
NAMES = ("one.jpg", "two.png")


def shots(dist=(0.1, -0.05, 0.01, 0.002, 0.01), model="perspective"):
    """Two cameras that look at the unit box."""
    lens = Intrinsics(*SIZE, 90, 91, 41, 30, dist, model)
    poses = [Pose.look_at((5 * np.cos(k), 5 * np.sin(k), 1.5), (0, 0, 0)) for k in (0, 0.7)]
    return [Shot(n, f"images/{n}", Camera(lens, p)) for n, p in zip(NAMES, poses, strict=True)]


def written(kind):
    return WRITERS[kind](shots(), "mesh.ply").files


def text_of(kind, name):
    return written(kind)[name].decode()


def value_of(kind, name):
    return json.loads(text_of(kind, name))


def openmvg():
    def entry(key, data, **more):
        return {"key": key, "value": {**more, "ptr_wrapper": {"data": data}}}

    view = {"filename": "one.jpg", "id_pose": 0, "id_intrinsic": 0}
    lens = {"width": 80, "height": 60, "focal_length": 90, "principal_point": [40, 30],
            "disto_t2": [0.1, 0, 0, 0, 0]}  # fmt: skip
    named = {"polymorphic_id": 2147483649, "polymorphic_name": "pinhole_brown_t2"}
    pose = {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "center": [0, 0, -5]}
    return {"views": [entry(0, view)], "intrinsics": [entry(0, lens, **named)],
            "extrinsics": [{"key": 0, "value": pose}]}  # fmt: skip


def meshroom():
    return {
        "version": ["1", "2", "6"],
        "views": [{"poseId": "5", "intrinsicId": "7", "path": "/x/one.jpg"}],
        "intrinsics": [{"intrinsicId": "7", "width": "80", "height": "60", "type": "radial3",
                        "distortionParams": ["0.1", "0", "0"], "focalLength": "45",
                        "sensorWidth": "36", "principalPoint": ["1", "-1"]}],
        "poses": [{"poseId": "5", "pose": {"transform": {
            "rotation": ["1", "0", "0", "0", "1", "0", "0", "0", "1"],
            "center": ["0", "0", "-5"]}}}],
    }  # fmt: skip


NGP = {
    "camera_angle_x": 0.8, "k1": 0.05, "k2": 0.01, "k4": 0.001, "is_fisheye": True, "w": 80,
    "h": 60,
    "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]], "applied_scale": 2.0,
    "frames": [{"file_path": "./one.jpg", "transform_matrix": np.eye(4).tolist()}],
}  # fmt: skip

SIDECAR = """<?xml version="1.0" encoding="UTF-8"?><x:xmpmeta xmlns:x="adobe:ns:meta/">
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description
xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" xcr:Version="3" xcr:Coordinates="local"
xcr:DistortionModel="brown4t2" xcr:FocalLength35mm="18" xcr:Skew="0" xcr:AspectRatio="1"
xcr:PrincipalPointU="0.01" xcr:PrincipalPointV="-0.01"><xcr:Rotation>0 1 0 -1 0 0 0 0 1
</xcr:Rotation><xcr:Position>1 2 3</xcr:Position>
<xcr:DistortionCoeficients>0.1 0 0 0.02 0.01 0</xcr:DistortionCoeficients></rdf:Description>
</rdf:RDF></x:xmpmeta>"""

SCANNER = {
    "cameraPoseARFrame": np.eye(4).ravel().tolist(), "intrinsics": [90, 0, 40, 0, 90, 30, 0, 0, 1],
}  # fmt: skip
POSES = [{"file_path": "images/one.jpg", "transform": np.eye(4)[:3].tolist()}]

CHUNK_TRANSFORM = """<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 0
</translation><scale>2</scale></transform></chunk>"""

RIG = (
    text_of("metashape", "cameras.xml")
    .replace(
        "</sensor>", "<rotation>1 0 0 0 1 0 0 0 1</rotation><location>1 0 0</location></sensor>"
    )
    .replace('label="two.png"', 'label="two.png" master_id="0"')
)
RIG = RIG[: RIG.rindex("<transform>")] + RIG[RIG.rindex("</transform>") + len("</transform>") :]

TEXTS = {
    "metashape rig": ("cameras.xml", RIG),
    "bundler": ("bundle.out", text_of("bundler", "bundle.out")),
    "meshlab": ("cameras.mlp", text_of("meshlab", "cameras.mlp")),
    "metashape": (
        "cameras.xml", text_of("metashape", "cameras.xml").replace("</chunk>", CHUNK_TRANSFORM)
    ),
    "realityscan": ("cameras.csv", text_of("realityscan", "cameras.csv")),
    "realityscan-xmp": ("one.xmp", SIDECAR),
    "blocks-exchange": ("blocks.xml", text_of("blocks-exchange", "blocks.xml")),
    "pix4d": (
        "a_calibrated_camera_parameters.txt",
        text_of("pix4d", "cameras_calibrated_camera_parameters.txt"),
    ),
    "visualsfm": ("cameras.nvm", text_of("visualsfm", "cameras.nvm").replace("0.0 0\n", "0.1 0\n")),
    "texrecon": ("one.cam", text_of("texrecon", "one.cam")),
    "micmac": ("Orientation-one.jpg.xml", text_of("micmac", "Orientation-one.jpg.xml")),
    "table": ("orientations.txt", text_of("table", "orientations.txt")),
}  # fmt: skip
VALUES = {
    "nerfstudio": ("transforms.json", [json.loads(text_of("nerfstudio", "transforms.json")), NGP]),
    "openmvg": ("sfm_data.json", [openmvg()]),
    "meshroom": ("cameras.sfm", [meshroom()]),
    "opensfm": ("reconstruction.json", [value_of("opensfm", "reconstruction.json")]),
    "opf": ("cameras.opf", [value_of("opf", "cameras.opf")]),
    "arkit": ("one.json", [value_of("arkit", "one.json"), SCANNER]),
    "nerfstudio-poses": ("poses.json", [POSES]),
}
POSES_BESIDE = {"transform": np.eye(4)[:3].tolist(), "scale": 0.5}


def read(kind):
    """The reader as the command calls it, the format found by itself."""

    def found(path):
        told, file = detect(path)
        return READERS[told](file, lambda name: SIZE)

    found.__name__ = f"read_{kind}"
    return found


@pytest.mark.parametrize("kind", TEXTS)
@given(data=st.data())
def test_text(kind, data, place):
    """Files of text and XML of each program."""
    name, text = TEXTS[kind]
    (place / "list.txt").write_text("images/one.jpg\nimages/two.png\n")
    if kind == "micmac":
        (place / "AutoCal_0.xml").write_text(text_of("micmac", "AutoCal_0.xml"))
    refused_or_read(read(kind), place / name, data.draw(broken_text([text])))


ROUND = {
    kind: WRITERS[kind](shots((0.03, -0.01, 0.002, -0.001), "fisheye"), "mesh.ply").files
    for kind in ("blocks-exchange", "opf", "micmac")
}
BENT = {"blocks-exchange": "blocks.xml", "opf": "calibration.json", "micmac": "AutoCal_0.xml"}
"""The file of each that tells the lens."""


@pytest.mark.parametrize("kind", ROUND)
@given(data=st.data())
def test_fisheyes(kind, data, place):
    """Their polynomials and matrices broken, all files beside sound."""
    folder = place / "round"
    folder.mkdir(exist_ok=True)
    for name, content in ROUND[kind].items():
        (folder / name).write_bytes(content)
    text = ROUND[kind][BENT[kind]].decode()
    broken = broken_json([json.loads(text)]) if kind == "opf" else broken_text([text])
    path = folder / BENT[kind]

    def found(_path):
        told, file = detect(folder if kind == "micmac" else path)
        return READERS[told](file, lambda name: SIZE)

    found.__name__ = f"read_{kind} fisheye"
    refused_or_read(found, path, data.draw(broken))


@given(data=st.data())
def test_calibration_of_micmac(data, place):
    """The lens broken, the orientation that names it sound."""
    folder = place / "calibration"
    folder.mkdir(exist_ok=True)
    for name in ("one.jpg", "two.png"):
        text = text_of("micmac", f"Orientation-{name}.xml")
        (folder / f"Orientation-{name}.xml").write_text(text)

    def found(path):
        return READERS["micmac"](path.parent, lambda name: SIZE)

    found.__name__ = "read_micmac_lens"
    broken = data.draw(broken_text([text_of("micmac", "AutoCal_0.xml")]))
    refused_or_read(found, folder / "AutoCal_0.xml", broken)


@pytest.mark.parametrize("kind", VALUES)
@given(data=st.data())
def test_json(kind, data, place):
    """Files of JSON of each program, the others of its set sound beside it."""
    name, values = VALUES[kind]
    folder = place / f"json-{kind}"
    folder.mkdir(exist_ok=True)
    if kind == "opf":
        for other, content in written("opf").items():
            (folder / other).write_bytes(content)
    if kind == "nerfstudio-poses":
        (folder / "dataparser_transforms.json").write_text(json.dumps(POSES_BESIDE))
    refused_or_read(read(kind), folder / name, data.draw(broken_json(values)))


OPF_PARTS = ("camera-list", "input-cameras", "calibration", "scene-reference-frame")


@pytest.mark.parametrize("part", OPF_PARTS)
@given(data=st.data())
def test_parts_of_opf(part, data, place):
    """Each file of a project of the Open Photogrammetry Format beside sound other ones."""
    folder = place / f"opf-{part}"
    folder.mkdir(exist_ok=True)
    for other, content in written("opf").items():
        (folder / other).write_bytes(content)

    def whole(path):
        return READERS["opf"](folder / "cameras.opf", lambda name: SIZE)

    content = data.draw(broken_json([value_of("opf", f"{part}.json")]))
    refused_or_read(whole, folder / f"{part}.json", content, "read_opf")


@given(data=st.data())
def test_what_a_training_tells(data, place):
    """dataparser_transforms.json beside a sound list of nerfstudio's cameras."""
    folder = place / "training"
    folder.mkdir(exist_ok=True)
    (folder / "poses.json").write_text(json.dumps(POSES))

    def listed(path):
        return READERS["nerfstudio-poses"](folder / "poses.json", lambda name: SIZE)

    content = data.draw(broken_json([POSES_BESIDE]))
    refused_or_read(listed, folder / "dataparser_transforms.json", content, "read_poses")


@given(data=st.data())
def test_openmvs(data, place):
    """OpenMVS's exchange file in binary."""
    sound = written("openmvs")["cameras.mvs"]
    refused_or_read(read("openmvs"), place / "cameras.mvs", data.draw(broken_bytes([sound])))


@pytest.mark.parametrize("name", ["cameras.txt", "images.txt"])
@given(data=st.data())
def test_colmap_text(name, data, place):
    """Each file of a text model beside a sound other one."""
    folder = place / f"text-{name}"
    folder.mkdir(exist_ok=True)
    for other, content in written("colmap").items():
        (folder / other).write_bytes(content)
    sound = written("colmap")[name].decode()
    fisheye = sound.replace("FULL_OPENCV", "OPENCV_FISHEYE")
    refused_or_read(read("colmap"), folder / name, data.draw(broken_text([sound, fisheye])))


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin"])
@given(data=st.data())
def test_colmap_binary(name, data, place):
    """Each file of a binary model beside a sound other one."""
    folder = place / f"binary-{name}"
    folder.mkdir(exist_ok=True)
    for other, content in written("colmap-binary").items():
        (folder / other).write_bytes(content)
    sound = written("colmap-binary")[name]
    refused_or_read(read("colmap-binary"), folder / name, data.draw(broken_bytes([sound])))


@given(data=st.data())
def test_bundler_list(data, place):
    """The list beside a sound bundle."""
    folder = place / "list"
    folder.mkdir(exist_ok=True)
    (folder / "bundle.out").write_bytes(written("bundler")["bundle.out"])
    broken = data.draw(broken_text(["images/one.jpg 0 930.5\nimages/two.png\n"]))

    def listed(path):
        return READERS["bundler"](folder / "bundle.out", lambda name: SIZE)

    refused_or_read(listed, folder / "list.txt", broken)


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """A box and two photos, one of which EXIF turns."""
    root = tmp_path_factory.mktemp("box")
    (root / "mesh").mkdir()
    (root / "photos").mkdir()
    trimesh.creation.box().export(root / "mesh" / "box.ply")
    noise = np.random.default_rng(1).integers(0, 255, (60, 80, 3), np.uint8)
    exif = Image.Exif()
    exif[274] = 3
    for name in NAMES:
        Image.fromarray(noise).save(root / "photos" / name, exif=exif)
    return Project.open(root)


@settings(max_examples=int(os.environ.get("TEXPROJ_FUZZ_INPUTS", "60")) // 4)
@given(data=st.data())
def test_whole_import(data, box, place):
    """What a reader lets through is looked at through the mesh, and ends in an entry or a
    sentence.
    """
    values = [json.loads(text_of("nerfstudio", "transforms.json")), NGP]
    content = data.draw(broken_json(values))

    def imported(path):
        with Workbench(box) as bench:
            return import_cameras(bench, path)

    refused_or_read(imported, place / "transforms.json", content, "import_cameras")
