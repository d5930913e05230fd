"""Compressed models: as other decoders than ours find them, and as programs bring them."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from page_tools import CHECKOUT, WEB, run, with_packages
from scipy.spatial import cKDTree
from test_formats_models import model, write_glb

from texproj.errors import InputError, UsageError
from texproj.formats.meshes import read_mesh, read_mesh_file
from texproj.formats.models import read_model
from texproj.formats.models.binary import required_extensions
from texproj.formats.models.draco import fineness_of
from texproj.layout import Node
from texproj.mesh import NormalMap, Parts
from texproj.options import ColorOptions, OutputOptions
from texproj.preview.plain_model import plain_glb
from texproj.stages.writing import output_plan

SAMPLES = Path(__file__).parent / "meshes"
"""Files that gltfpack 1.3 and glTF-Transform 4.5 (with draco3dgltf) made of `ball`."""


def ball():
    """Positions, texture coordinates with v down, and faces of what the samples were made from."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    uv_down = sphere.vertices[:, :2] * 0.4 + 0.5
    return sphere.vertices * (1, 2, 3) + (5, 0, 0), uv_down, sphere.faces


def asked(task, *files):
    """What `glb_check.mjs` says of each file."""
    node = with_packages()
    script = str(CHECKOUT / "tests/glb_check.mjs")
    done = run([*node, script, str(WEB), task, *map(str, files)], node)
    assert done.returncode == 0, done.stdout
    return json.loads(done.stdout)


def corners(values, faces):
    """(F, 3, k) values at the corners of faces."""
    return np.asarray(values, np.float64)[np.asarray(faces)]


def same_faces(found, wanted):
    """(F,) rows of the wanted faces (F, 3, 3) and (F, 3) their corners, for each found one."""
    row = cKDTree(wanted.mean(axis=1)).query(found.mean(axis=1))[1]
    gaps = np.linalg.norm(found[:, :, None] - wanted[row][:, None], axis=-1)
    assert np.unique(row).size == len(wanted) == len(found)
    return row, gaps.argmin(axis=2)


def kept(textured):
    """The model with coordinates of a file that are to stay, over several tiles."""
    uv_down = np.float32(textured.uv * (3, 1)).astype(np.float64)
    node = np.zeros(len(textured.faces), np.int32)
    return replace(textured, parts=Parts(("a", "b"), (Node("ball"),), node, uv_down))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Two models, one with kept coordinates and one with tangents, and their compressed files."""
    folder = tmp_path_factory.mktemp("draco")
    plain = model(normals=True)
    tangents = np.tile([0.6, 0.8, 0.0, -1.0], (len(plain.uv), 1))
    plain = replace(plain, normal_map=NormalMap((), tangents))
    models = {"plain": plain, "kept": kept(model(normals=True))}
    for name, textured in models.items():
        write_glb(folder / f"{name}.glb", replace(textured, normal_map=None), compressed=True)
        write_glb(folder / f"{name} open.glb", replace(textured, normal_map=None))
    return folder, models


def test_the_decoder_of_web_viewers_finds_the_same_corners(written):
    """three.js's own decoder, by the numbers that the glb tells: each face once, wound as before,
    positions within the step that is promised, kept texture coordinates bit for bit.
    """
    folder, models = written
    for name, parts in zip(
        models, asked("draco", *(folder / f"{n}.glb" for n in models)), strict=True
    ):
        textured = models[name]
        side = np.ptp(textured.vertices, axis=0).max()
        step = side / 2 ** fineness_of(textured).position_bits
        wanted_xyz = corners(textured.vertices, textured.faces)
        uv_down = textured.parts.uv_down if textured.parts else textured.uv * (1, -1) + (0, 1)
        wanted_uv = corners(uv_down, textured.uv_faces)
        assert sum(len(part["faces"]) for part in parts) == len(textured.faces)
        for part in parts:
            rows = textured.page_of_face == (part["material"] if part["material"] < 2 else -1)
            found = corners(np.reshape(part["POSITION"], (-1, 3)), part["faces"])
            row, corner = same_faces(found, wanted_xyz[rows])
            assert set(map(tuple, corner.tolist())) <= {(0, 1, 2), (1, 2, 0), (2, 0, 1)}
            gaps = found - wanted_xyz[rows][row[:, None], corner]
            assert step / 100 < np.abs(gaps).max() <= 0.51 * step
            if "TEXCOORD_0" not in part:
                assert part["material"] == 2
                continue
            uv = corners(np.reshape(part["TEXCOORD_0"], (-1, 2)), part["faces"])
            gaps = np.abs(uv - wanted_uv[rows][row[:, None], corner])
            assert gaps.max() == 0 if name == "kept" else gaps.max() < 1 / 16 / 64


def test_the_validator_of_khronos_has_nothing_to_say(written, tmp_path):
    """Of compressed models and of all others; of a broken one it does."""
    folder, models = written
    bent = tmp_path / "bent.glb"
    bent.write_bytes((folder / "plain.glb").read_bytes().replace(b'"count":', b'"kount":'))
    files = [folder / f"{name}{kind}.glb" for name in models for kind in ("", " open")]
    *said, of_bent = asked("validate", *files, bent)
    assert [[message["code"] for message in one] for one in said] == [[]] * len(files)
    assert of_bent


def test_compressed_models_are_read_back_and_smaller(written):
    """By trimesh, and by our own reader as a mesh with its coordinates."""
    folder, models = written
    for name, textured in models.items():
        assert len(read_model(folder / f"{name}.glb").faces) == len(textured.faces)
        mesh = read_mesh_file(folder / f"{name}.glb")
        assert mesh.notes == () and len(mesh.faces) == len(textured.faces)
        textureless = (textured.page_of_face < 0).sum()
        assert (~mesh.layout.placed).sum() == textureless


def test_the_page_gets_what_it_can_show(written, tmp_path):
    """The same mesh, coordinates and names to the bit, without the extension, and valid; a damaged
    file is one sentence.
    """
    folder, models = written
    files = []
    for name in models:
        packed = folder / f"{name}.glb"
        files.append(tmp_path / f"{name}.glb")
        files[-1].write_bytes(plain_glb(packed))
        assert "draco" not in str(required_extensions(files[-1]))
        before, after = read_mesh_file(packed), read_mesh_file(files[-1])
        np.testing.assert_array_equal(after.vertices, before.vertices)
        np.testing.assert_array_equal(after.faces, before.faces)
        np.testing.assert_array_equal(after.layout.uv, before.layout.uv)
        assert [m.name for m in after.layout.materials] == [m.name for m in before.layout.materials]
    assert [[m["code"] for m in one] for one in asked("validate", *files)] == [[]] * len(files)
    (tmp_path / "cut.glb").write_bytes(packed.read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"cut\.glb: damaged"):
        plain_glb(tmp_path / "cut.glb")


def test_a_large_model_takes_a_tenth(tmp_path):
    """Geometry alone, on a page as unwrapping makes it: each vertex has one place."""
    sphere = trimesh.creation.icosphere(subdivisions=5)
    uv = np.asarray(sphere.vertices[:, :2] * 0.4 + 0.5)
    faces = sphere.faces.astype(np.int32)
    textured = replace(
        model(1, False), vertices=np.array(sphere.vertices), faces=faces, uv=uv, uv_faces=faces,
        page_of_face=np.zeros(len(faces), np.int32),
    )  # fmt: skip
    sizes = []
    for compressed in (False, True):
        write_glb(
            tmp_path / "m.glb",
            replace(textured, normals=sphere.vertex_normals),
            compressed=compressed,
        )
        sizes.append((tmp_path / "m.glb").stat().st_size)
    assert sizes[1] < sizes[0] / 5


@pytest.mark.parametrize("name", ["gltf-transform", "gltfpack", "gltfpack-floats"])
def test_what_compressors_write_is_read(name):
    """Draco; meshopt with integers, transforms of node and texture; meshopt with floats. The same
    faces within the steps of these programs.
    """
    xyz, uv_down, faces = ball()
    mesh = read_mesh_file(SAMPLES / f"{name}.glb")
    found = corners(mesh.vertices, mesh.faces)
    row, corner = same_faces(found, corners(xyz, faces))
    wanted = corners(xyz, faces)[row[:, None], corner]
    assert np.abs(found - wanted).max() < 5e-4
    uv = corners(mesh.layout.uv_down, mesh.layout.faces)
    assert np.abs(uv - corners(uv_down, faces)[row[:, None], corner]).max() < 2e-4
    assert mesh.notes == () and mesh.layout.materials[0].name == "skin"


def test_a_missing_decoder_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "meshopt", None)
    with pytest.raises(InputError, match=r"gltfpack\.glb: .* pip install meshopt"):
        read_mesh(SAMPLES / "gltfpack.glb")


def test_other_counts_than_the_text_says_are_refused(tmp_path):
    """Before the decoder, which would work on what a spoiled head promises for minutes."""
    data = bytearray((SAMPLES / "gltf-transform.glb").read_bytes())
    at = data.index(b"DRACO") + 12
    assert data[at : at + 4] == b"\xa2\x01\xc0\x02"  # 162 vertices, 320 faces
    for place in (at, at + 2):
        spoiled = data[:place] + b"\xff\x7f" + data[place + 2 :]
        (tmp_path / "a.glb").write_bytes(spoiled)
        with pytest.raises(InputError, match="other counts"):
            read_mesh(tmp_path / "a.glb")


@pytest.mark.parametrize(
    ("color", "output"),
    [({"to": "vertices"}, {"models": ("glb",)}), ({}, {"models": ("obj",)})],
)
def test_only_a_textured_glb_is_compressed(color, output):
    with pytest.raises(UsageError, match="compression: only a glb with a texture"):
        output_plan(ColorOptions(**color), OutputOptions(compression="draco", **output))
