"""Texture coordinates of a ply: as MeshLab and others write them, kept bit for bit."""

import numpy as np
import pymeshlab
import pytest
import trimesh
from layout_files import Read, image
from plyfile import PlyData, PlyElement
from test_layouts import colored, loaded, renderer, write

from texproj.errors import InputError
from texproj.formats.meshes import read_mesh_file, read_picture
from texproj.formats.meshes.companions import companions
from texproj.options import UnwrapOptions
from texproj.unwrap.kept import kept_pages

__all__ = ["renderer"]  # a fixture


def wedges(seed=0):
    """A ball and a place of its own for each corner of its faces, as float32."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    uv = np.random.default_rng(seed).random((3 * len(ball.faces), 2)).astype(np.float32)
    return ball, uv.astype(np.float64)


@pytest.mark.parametrize("binary", [True, False])
def test_what_meshlab_writes_is_read(binary, tmp_path):
    """At the corners, in the order of the faces; text has the digits that MeshLab gives it."""
    ball, uv = wedges()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(ball.vertices, ball.faces, w_tex_coords_matrix=uv))
    path = tmp_path / "a b.ply"
    meshes.save_current_mesh(str(path), binary=binary, save_wedge_texcoord=True)
    mesh = read_mesh_file(path)
    np.testing.assert_array_equal(mesh.faces, ball.faces)
    found = mesh.layout.uv_up[mesh.layout.faces].reshape(-1, 2)
    if binary:
        np.testing.assert_array_equal(found, uv)
    else:
        np.testing.assert_allclose(found, uv, atol=5e-7)
    assert mesh.notes == () and [node.name for node in mesh.layout.nodes] == ["a b"]


TEXT = """ply
format ascii 1.0
comment TextureFile red one.png
comment TextureFile blue.png
element vertex 4
property float x
property float y
property float z
element face 3
property list uchar int vertex_indices
property int texnumber
property list uchar float texcoord
end_header
0 0 0
1 0 0
1 1 0
0 1 0
4 0 1 2 3 1 8 0 0 .5 0 .5 .5 0 .5
3 0 1 2 0 6 .75 0 1 0 1 .25
3 0 2 3 7 0
"""


@pytest.fixture
def text(tmp_path):
    (tmp_path / "a.ply").write_text(TEXT)
    (tmp_path / "red one.png").write_bytes(image((9, 1, 1)))
    return tmp_path / "a.ply"


def test_polygons_of_a_text_with_several_images(text):
    """Fans as the faces are; a face without coordinates has no place, an image that is not among
    the named ones is none; one that is missing is told when it is wanted.
    """
    mesh = read_mesh_file(text)
    layout = mesh.layout
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3]])
    assert layout.placed.tolist() == [True, True, True, False]
    assert layout.material_of_face.tolist() == [1, 1, 0, -1]
    wanted = [[[0, 0], [0.5, 0], [0.5, 0.5]], [[0, 0], [0.5, 0.5], [0, 0.5]]]
    np.testing.assert_array_equal(layout.uv_up[layout.faces[:2]], wanted)
    assert [m.name for m in layout.materials] == ["red one", "blue"]
    assert read_picture(layout.materials[0], 1001)[0, 0].tolist() == [9, 1, 1]
    with pytest.raises(InputError, match=r"material 'blue': there is no blue\.png"):
        read_picture(layout.materials[1], 1001)
    assert list(companions(text)) == ["red one.png"]


@pytest.mark.parametrize("names", [("s", "t"), ("texture_u", "texture_v")])
@pytest.mark.parametrize("binary", [True, False])
def test_coordinates_at_vertices(names, binary, tmp_path):
    """As Blender and others write them."""
    ball, _ = wedges()
    uv = np.random.default_rng(1).random((len(ball.vertices), 2)).astype("f4")
    kinds = [*((axis, "f4") for axis in "xyz"), *((name, "f4") for name in names)]
    rows = np.array(list(map(tuple, np.hstack([ball.vertices, uv]).tolist())), kinds)
    faces = np.array([(f,) for f in ball.faces.tolist()], [("vertex_indices", "i4", (3,))])
    elements = [PlyElement.describe(rows, "vertex"), PlyElement.describe(faces, "face")]
    PlyData(elements, text=not binary).write(tmp_path / "v.ply")
    layout = read_mesh_file(tmp_path / "v.ply").layout
    found = np.float32(layout.uv_up[layout.faces])
    np.testing.assert_array_equal(found, uv[ball.faces])


def test_polygons_of_a_binary_file_say_what_to_do(tmp_path):
    """Their triangles come from another reader, which tells no coordinates of them."""
    corners = np.array([((0, 1, 2, 3), (0, 0, 1, 0, 1, 1, 0, 1))],
                       [("vertex_indices", "i4", (4,)), ("texcoord", "f4", (8,))])  # fmt: skip
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(a, "f4") for a in "xyz"])
    parts = [PlyElement.describe(square, "vertex"), PlyElement.describe(corners, "face")]
    PlyData(parts).write(tmp_path / "q.ply")
    mesh = read_mesh_file(tmp_path / "q.ply")
    assert len(mesh.faces) == 2 and mesh.layout is None
    assert "cannot be used" in mesh.notes[0]


def test_a_ply_without_coordinates_has_no_layout(tmp_path):
    """Whatever its comments name."""
    lines = [line for line in TEXT.splitlines() if "texcoord" not in line]
    lines[-3:] = ["4 0 1 2 3 0", "3 0 1 2 0", "3 0 2 3 0"]
    (tmp_path / "a.ply").write_text("\n".join(lines))
    mesh = read_mesh_file(tmp_path / "a.ply")
    assert mesh.layout is None and mesh.notes == ()


def test_the_layout_of_a_ply_is_kept_bit_for_bit(renderer, tmp_path):
    """From the scan's ply through colors into the glb: material, name and coordinates."""
    from color_scenes import plane

    square = plane(cells=8)
    uv = np.float32(square.vertices[:, :2] * 0.45 + 0.5)
    rows = np.array(
        list(map(tuple, np.hstack([square.vertices, uv]).tolist())),
        [(name, "f4") for name in ("x", "y", "z", "s", "t")],
    )
    faces = np.array([(f,) for f in square.faces.tolist()], [("vertex_indices", "i4", (3,))])
    elements = [PlyElement.describe(rows, "vertex"), PlyElement.describe(faces, "face")]
    PlyData(elements, comments=["TextureFile skin.png"]).write(tmp_path / "relief.ply")
    mesh = loaded(tmp_path / "relief.ply")
    assert kept_pages(mesh, UnwrapOptions())[0].names == ("skin",)
    write(tmp_path / "out", mesh, colored(mesh, renderer))
    ((material, (_, found)),) = Read(tmp_path / "out/model.glb").corners("relief").items()
    assert material == "skin"
    wanted = np.float32(uv[square.faces].astype(np.float64) * (1, -1) + (0, 1))
    order = np.lexsort(wanted.reshape(len(wanted), -1).T)
    again = np.lexsort(found.reshape(len(found), -1).T)
    assert found[again].tobytes() == wanted[order].tobytes()
