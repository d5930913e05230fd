"""A usdz as Pixar's own library and checker see it."""

import json
import zipfile

import numpy as np
import pytest

from texproj.formats.models import write_pages, write_usdz
from texproj.mesh import TexturedMesh
from texproj.provenance import Provenance
from texproj.standing import AXES, Standing

OFFSET = np.array([500_000.25, 4_100_000.5, 100])


def model(offset=0.0) -> TexturedMesh:
    """A square of two triangles on page 0, a triangle on page 1, one without a page."""
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1], [2, 1, 1], [3, 0, 1]], float
    )
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2], [4, 6, 5]], np.int32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.25, 0.5], [0.75, 0.5], [0.5, 1]])
    uv_faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [0, 0, 0]], np.int32)
    page = np.array([0, 0, 1, -1], np.int32)
    normals = np.tile([0.0, 0.6, 0.8], (7, 1))
    pages = tuple(np.full((8, 8, 3), 60 * k + 50, np.uint8) for k in range(2))
    return TexturedMesh(vertices + offset, faces, uv, uv_faces, page, pages, normals)


def written(tmp_path, offset=0.0, unlit=True, standing=None, provenance=None):
    path = tmp_path / "model.usdz"
    shown = model(offset)
    images = write_pages(tmp_path / "inside", shown.pages, "png")
    more = {"provenance": provenance} if provenance else {}
    write_usdz(path, shown, images, unlit, standing, **more)
    return path


def test_it_is_a_zip_of_aligned_files_without_compression(tmp_path):
    """As the specification has it: the layer first, each file at a multiple of 64 bytes."""
    path = written(tmp_path)
    data = path.read_bytes()
    with zipfile.ZipFile(path) as package:
        entries = package.infolist()
        assert package.testzip() is None
    for entry in entries:
        head = data[entry.header_offset :]
        start = entry.header_offset + 30 + int.from_bytes(head[26:28], "little")
        start += int.from_bytes(head[28:30], "little")
        assert start % 64 == 0 and entry.compress_type == zipfile.ZIP_STORED
    names = [entry.filename for entry in entries]
    assert names[0].endswith(".usda") and all(n.startswith("textures/") for n in names[1:])


@pytest.fixture
def usd():
    return pytest.importorskip("pxr.Usd")


@pytest.mark.parametrize("unlit", [True, False])
def test_the_checker_has_no_complaint(unlit, usd, tmp_path):
    """usd-core's validators, those of packages among them."""
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    stage = usd.Stage.Open(str(written(tmp_path, unlit=unlit)))
    errors = UsdValidation.ValidationContext(validators).Validate(stage)

    names = {validator.GetMetadata().name for validator in validators}
    assert "usdUtilsValidators:UsdzPackageValidator" in names
    assert [error.GetMessage() for error in errors] == []


@pytest.mark.parametrize("offset", [0.0, OFFSET], ids=["near", "surveyed"])
def test_points_texture_and_upright_node_come_back(offset, usd, tmp_path):
    """In the world of USD the scan stands with z upwards as y, in metres; corners keep their
    texture coordinates.
    """
    from pxr import UsdGeom

    standing = Standing(AXES["z"], 0.01, "")
    stage = usd.Stage.Open(str(written(tmp_path, offset, standing=standing)))
    expected = model(offset)
    found = 0
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        mesh = UsdGeom.Mesh(prim)
        matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
        points = np.array(mesh.GetPointsAttr().Get())
        world = points @ matrix[:3, :3] + matrix[3, :3]
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get())
        page = -1 if prim.GetName() == "untextured" else int(prim.GetName()[-1])
        rows = expected.page_of_face == page
        scan = expected.vertices[expected.faces[rows].ravel()]
        upright = scan[:, [0, 2, 1]] * (0.01, 0.01, -0.01)
        np.testing.assert_allclose(world[corners], upright, rtol=0, atol=1e-7)
        found += rows.sum()
        if page >= 0:
            st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").ComputeFlattened()
            np.testing.assert_allclose(st, expected.uv[expected.uv_faces[rows].ravel()], atol=1e-6)
    assert found == 4 and UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1


def test_provenance_stands_in_the_layer(usd, tmp_path):
    """Any letters, in JSON that comes back."""
    facts = {"photos": [{"file": 'a "b" \\ü.jpg'}]}
    path = written(tmp_path, provenance=Provenance("\u00a9 Müller\n", facts))
    told = usd.Stage.Open(str(path)).GetMetadata("customLayerData")

    assert told["copyright"] == "\u00a9 Müller\n" and json.loads(told["texproj"]) == facts
