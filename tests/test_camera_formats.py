"""Every camera format both ways: within 0.05 px of what its own definition says."""

import ast
import json
import subprocess
import sys
from pathlib import Path

import foreign
import foreign_files
import numpy as np
import pytest

from texproj.camera import Camera, Intrinsics, Pose
from texproj.errors import InputError
from texproj.formats.interchange import FORMATS, READERS, WRITERS, Shot, detect
from texproj.formats.interchange.blender import write_blender

SAMPLES = Path(__file__).parent / "cameras"
SIZE = (1000, 750)
POINTS = np.random.default_rng(8).uniform(-1.3, 1.3, (30, 3))
MOST_PX = 0.05

BROUGHT = {
    "opensfm": ("opensfm", "reconstruction.json", "IMG_0001.JPG"),
    "blocks-exchange": ("blocks-exchange", "AT.xml", "D:/survey/photos/IMG_0001.JPG"),
    "pix4d": ("pix4d", "", "IMG 0001.JPG"),
    "opf": ("opf", "project.opf", "/c:/data/images/IMG 0001.JPG"),
    "visualsfm": ("visualsfm", "model.nvm", "photos\\IMG 0001.JPG"),
    "texrecon": ("texrecon", "", "IMG_0001"),
    "arkit": ("arkit", "", "165283245"),
    "arkit-scanner": ("arkit", "", "frame_00042"),
    "table": ("table", "omega_phi_kappa.txt", "IMG 0001"),
    "table-pix4d": ("table", "survey_calibrated_external_camera_parameters.txt", "IMG_0001.JPG"),
    "table-flight": ("table", "reference.csv", "IMG_0001.JPG"),
    "metashape-old": ("metashape", "cameras.xml", "IMG_0001.JPG"),
    "micmac": ("micmac", "", "IMG 0001.JPG"),
    "opf-fisheye": ("opf", "project.opf", "/c:/data/images/IMG 0001.JPG"),
    "blocks-exchange-fisheye": ("blocks-exchange", "AT.xml", "D:/survey/photos/IMG_0001.JPG"),
    "micmac-fisheye": ("micmac", "", "IMG 0001.JPG"),
    "nerfstudio-poses": (
        "nerfstudio-poses", "transforms_train.json", "/data/statue/images/frame_00001.png"
    ),
}  # fmt: skip
"""Folders of files as the programs write them: format, the file, the first camera's name."""

BENT, RADIAL, STRAIGHT = (0.08, -0.03, 0.002, -0.004, 0.01), (0.08, -0.03, 0, 0, 0), (0,) * 5
TAKEN = {
    "opensfm": (900, 870, 507, 366, BENT), "blocks-exchange": (900, 870, 507, 366, BENT),
    "pix4d": (900, 870, 507, 366, BENT), "opf": (900, 900, 507, 366, BENT),
    "visualsfm": (900, 900, 500, 375, STRAIGHT), "texrecon": (900, 870, 500, 375, RADIAL),
    "openmvs": (900, 870, 507, 366, STRAIGHT), "arkit": (900, 870, 507, 366, STRAIGHT),
    "table": (900, 900, 500, 375, STRAIGHT), "openmvg": (900, 900, 507, 366, BENT),
    "micmac": (900, 900, 507, 366, BENT),
    "meshroom": (900, 900, 507, 366, BENT), "realityscan-xmp": (900, 870, 507, 366, BENT),
}  # fmt: skip
"""What each format can hold whole."""
OLDER = {
    "colmap": (900, 870, 507, 366, BENT), "bundler": (900, 900, 500, 375, RADIAL),
    "meshlab": (900, 870, 507, 366, STRAIGHT), "metashape": (900, 870, 507, 366, BENT),
    "realityscan": (900, 900, 507, 366, BENT), "nerfstudio": (900, 870, 507, 366, BENT),
}  # fmt: skip
"""The same, of formats whose losses are held in test_formats_interchange_definitions.py."""
ONE_WAY_OR_BINARY = {"nerfstudio-poses", "blender", "colmap-binary"}
"""Written but not read, read but not written, or with tests by the program itself below."""


def size_of(name):
    return SIZE


def projected(kind, folder, point):
    """Where the format's definition puts a point by the files of a folder."""
    binary = {"openmvs"}
    read = {p.name: p.read_bytes() if kind in binary else p.read_text() for p in folder.iterdir()}
    if kind in OLDER:
        sized = (SIZE,) if kind in ("bundler", "realityscan") else ()
        return getattr(foreign, kind)(read, point.tolist(), *sized)
    function = getattr(foreign_files, kind.split("-scanner")[0].replace("-", "_"), None)
    return (function or getattr(foreign_files, kind.split("-")[0]))(read, point.tolist(), SIZE)


def camera_of(fx, fy, cx, cy, dist):
    pose = Pose.look_at((-2.0, -4.5, 2.1), (0.1, 0, 0.2), (0.2, 0, 1))
    return Camera(Intrinsics(*SIZE, fx, fy, cx, cy, dist), pose)


ROUND = {
    "opf": (0.03, -0.01, 0.002, 0), "blocks-exchange": (0.03, -0.01, 0.002, 0),
    "micmac": (0.03, -0.01, 0.002, -0.001, 0.002, -0.003, 0, 0),
}  # fmt: skip
"""Fisheyes that a format holds, whole or within `MOST_PX`."""


@pytest.mark.parametrize("kind", ROUND)
def test_fisheyes_that_we_write_mean_our_camera(kind, tmp_path):
    """By the format's definition, 65 degrees off the axis."""
    k = Intrinsics(*SIZE, 410, 410, 507, 366, ROUND[kind], "fisheye")
    camera = Camera(k, Pose.look_at((-0.6, -1.35, 0.63), (0.1, 0, 0.2), (0.2, 0, 1)))
    notes = put(kind, tmp_path, camera).notes
    ours, depth = camera.project(POINTS)
    seen = np.isfinite(ours).all(axis=1)
    told = [projected(kind, tmp_path, point) for point in POINTS[seen]]

    assert (
        np.degrees(np.arccos((depth / np.linalg.norm(POINTS - camera.center, axis=1))[seen])).max()
        > 60
    )
    np.testing.assert_allclose(told, ours[seen], rtol=0, atol=MOST_PX)
    assert all("no place" not in note for note in notes.values())


def put(kind, folder, camera, *names):
    """The written files in a folder, and what was not expressed."""
    shots = [Shot(name, f"../photos/{name}", camera) for name in names or ("a b.jpg",)]
    result = WRITERS[kind](shots, "../mesh/scan.ply")
    for name, content in result.files.items():
        (folder / name).write_bytes(content)
    return result


@pytest.mark.parametrize("sample", BROUGHT)
def test_files_as_programs_write_them_are_read(sample):
    """The format is found by itself; points fall where the definition puts them."""
    kind, file, name = BROUGHT[sample]
    folder = SAMPLES / sample
    assert detect(folder / file)[0] == kind
    model = READERS[kind](detect(folder / file)[1], size_of)
    ours = model.cameras[0].camera.project(POINTS)[0]
    told = [projected(sample, folder, point) for point in POINTS]

    assert model.cameras[0].name == name
    assert np.isfinite(ours).all() and np.ptp(ours, axis=0).max() > 300
    np.testing.assert_allclose(ours, told, rtol=0, atol=MOST_PX)


@pytest.mark.parametrize("kind", TAKEN | OLDER)
def test_files_that_we_write_mean_our_camera(kind, tmp_path):
    """By the definition, and by our own reader; nothing is said to be lost that is held."""
    camera = camera_of(*(TAKEN | OLDER)[kind])
    notes = put(kind, tmp_path, camera).notes
    told = [projected(kind, tmp_path, point) for point in POINTS]
    found, file = detect(tmp_path)
    again = READERS[found](file, size_of).cameras[0]

    assert found == kind
    np.testing.assert_allclose(told, camera.project(POINTS)[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        again.camera.project(POINTS)[0], camera.project(POINTS)[0], rtol=0, atol=1e-6
    )
    assert all("no place" not in note for note in notes.values())


@pytest.mark.parametrize("kind", [*TAKEN, "blender"])
def test_what_is_lost_is_said(kind, tmp_path):
    """A lens of twelve terms with two focal lengths off the middle: each loss has its word."""
    lens = Intrinsics(*SIZE, 900, 870, 507, 366, (*BENT, 0.02, -0.01, 0.003, 0.001, 0, 0, 0))
    notes = put(kind, tmp_path, Camera(lens, Pose.identity())).notes
    assert "dist[5] = 0.02" in notes["a b.jpg"]
    square = kind in ("opf", "visualsfm", "table", "openmvg", "meshroom", "blender", "micmac")
    assert ("fx - fy = 30" in notes["a b.jpg"]) == square
    straight = kind in ("visualsfm", "openmvs", "arkit", "table", "texrecon", "blender")
    assert ("k1 = 0.08" in notes["a b.jpg"]) == straight


def test_each_format_is_in_a_table_of_this_kind():
    """None goes unproved."""
    held = TAKEN.keys() | OLDER.keys() | ONE_WAY_OR_BINARY
    assert {form.name for form in FORMATS} == held


def test_photos_without_a_whole_pose_are_refused():
    """Each with its reason; the others come in."""
    model = READERS["blocks-exchange"](SAMPLES / "blocks-exchange" / "AT.xml", size_of)
    assert "position alone" in model.refused["D:/survey/photos/IMG_0002.JPG"]
    model = READERS["opf"](SAMPLES / "opf" / "calibrated_cameras.json", size_of)
    assert "spherical" in model.refused["IMG_0002.JPG"] and "shifted" in model.notes[0]
    model = READERS["table"](SAMPLES / "table-flight" / "reference.csv", size_of)
    assert "empty" in model.refused["IMG_0002.JPG"]


def test_tables_and_lists_without_a_lens_are_starts():
    """A pose alone vouches for nothing, whatever the picture says."""
    tables = READERS["table"](SAMPLES / "table" / "omega_phi_kappa.txt", size_of)
    poses = SAMPLES / "nerfstudio-poses" / "transforms_train.json"
    trained = READERS["nerfstudio-poses"](poses, size_of)

    assert tables.cameras[0].start_only and not tables.cameras[0].focal_told
    assert not trained.cameras[0].start_only


@pytest.mark.parametrize(
    ("angles", "point", "expected"),
    [
        ("0,0,0", (1, 2, 0), (600, 175)),  # looks down, top to north: x right, y up
        ("0,0,-90", (1, 2, 0), (300, 275)),  # top to east: north is left
        ("90,0,0", (1, 10, 12), (600, 175)),  # level, looks north: east is right, z up
    ],
)
def test_omega_phi_kappa_on_paper(angles, point, expected, tmp_path):
    """From (0, 0, 10) with f = 1000 px and 10 units of distance."""
    path = tmp_path / "a.txt"
    path.write_text(f"name;x;y;z;omega;phi;kappa\na.jpg;0;0;10;{angles.replace(',', ';')}\n")
    found = READERS["table"](path, size_of).cameras[0].camera

    assert found.project([point])[0][0] == pytest.approx(expected)


def test_a_binary_sfm_data_names_the_converter(tmp_path):
    """The sentence is the command that makes the file that is read."""
    (tmp_path / "sfm_data.bin").write_bytes(b"\0" * 20)
    kind, file = detect(tmp_path)
    with pytest.raises(InputError, match="openMVG_main_ConvertSfM_DataFormat"):
        READERS[kind](file, size_of)


def test_openmvs_projects_of_its_own_say_what_to_give(tmp_path):
    (tmp_path / "scene.mvs").write_bytes(b"MVS\0" + b"\0" * 60)
    with pytest.raises(InputError, match="exchange file"):
        READERS["openmvs"](tmp_path / "scene.mvs", size_of)


def test_degrees_of_longitude_are_refused(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text('# CoordinateSystem: GEOGCS["WGS 84"]\n#name,x,y,z,omega,phi,kappa\n')
    with pytest.raises(InputError, match="longitude"):
        READERS["table"](path, size_of)


# --- readers of other hands


def test_pyopf_reads_the_project(tmp_path):
    """Pix4D's own package takes the files and finds lens, position and angles."""
    pytest.importorskip("pyopf")
    from pyopf.io import load
    from pyopf.resolve import resolve

    camera = camera_of(*TAKEN["opf"])
    put("opf", tmp_path, camera)
    project = resolve(load(str(tmp_path / "cameras.opf")))
    calibrated = project.calibration.calibrated_cameras
    k = calibrated.sensors[0].internals

    assert list(calibrated.cameras[0].position) == pytest.approx(camera.center.tolist())
    assert (k.focal_length_px, *k.principal_point_px) == (900, 507, 366)
    assert list(project.input_cameras.sensors[0].image_size_px) == list(SIZE)


@pytest.mark.parametrize("kind", ["colmap", "colmap-binary"])
def test_pycolmap_reads_the_model(kind, tmp_path):
    """COLMAP's own library puts points on our pixels."""
    pycolmap = pytest.importorskip("pycolmap")
    camera = camera_of(900, 870, 507, 366, BENT)
    put(kind, tmp_path, camera)
    image = next(iter(pycolmap.Reconstruction(str(tmp_path)).images.values()))
    told = [image.project_point(point) for point in POINTS]

    np.testing.assert_allclose(told, camera.project(POINTS)[0], rtol=0, atol=1e-6)


def test_a_name_is_no_part_of_the_script():
    """Whatever the names of mesh and photo hold, Blender's script reads them as they are."""
    name = "a'b\"\"\"\\\n__import__('os')#\U0001f600{x}.ply"
    shot = Shot(name, f"../{name}", camera_of(900, 900, 507, 366, STRAIGHT))
    script = write_blender([shot], name).files["cameras.py"]
    values = {
        ast.unparse(node.targets[0]): node.value
        for node in ast.parse(script).body
        if isinstance(node, ast.Assign)
    }

    assert ast.literal_eval(values["MESH"]) == name
    [entry] = json.loads(ast.literal_eval(values["CAMERAS"].args[0]))
    assert (entry["name"], entry["photo"]) == (name, f"../{name}")


def test_blender_builds_the_scene(tmp_path):
    """Blender itself runs the script; its own projection puts points on our pixels."""
    pytest.importorskip("bpy")
    import trimesh
    from PIL import Image

    for folder in ("mesh", "photos", "out"):
        (tmp_path / folder).mkdir()
    trimesh.creation.box().export(tmp_path / "mesh" / "scan.ply")
    Image.new("RGB", SIZE).save(tmp_path / "photos" / "a b.jpg")
    camera = camera_of(900, 900, 507, 366, STRAIGHT)
    put("blender", tmp_path / "out", camera)
    script = tmp_path / "out" / "cameras.py"
    check = (
        "import runpy, sys, json, bpy; from mathutils import Vector;"
        "from bpy_extras.object_utils import world_to_camera_view as see;"
        f"runpy.run_path({str(script)!r}); s = bpy.context.scene; bpy.context.view_layer.update();"
        f"print('TOLD', json.dumps([list(see(s, s.camera, Vector(p))) for p in {POINTS.tolist()}]),"
        "len(s.camera.data.background_images), len([o for o in s.objects if o.type == 'MESH']))"
    )
    run = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    line = next(line for line in run.stdout.splitlines() if line.startswith("TOLD"))
    told, photos, meshes = line.removeprefix("TOLD ").rsplit(maxsplit=2)
    pixels = np.array(json.loads(told))[:, :2] * SIZE

    assert (photos, meshes) == ("1", "1")
    expected = camera.project(POINTS)[0]
    np.testing.assert_allclose(pixels, expected * (1, -1) + (0, SIZE[1]), rtol=0, atol=MOST_PX)
