"""Meshes of every kind end in vertices and faces that can be repaired, or in one sentence."""

import json
import struct
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from fuzzing import broken_bytes, broken_json, broken_text, broken_value, refused_or_read
from hypothesis import given
from hypothesis import strategies as st
from layout_files import glb, image

from texproj.errors import InputError
from texproj.formats.meshes import picture_side, read_mesh, read_mesh_file
from texproj.formats.meshes.companions import companions
from texproj.options import UnwrapOptions
from texproj.repair import repair
from texproj.unwrap.kept import kept_pages

SAMPLES = Path(__file__).parent.parent / "meshes"
OBJ = (
    "mtllib a.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nv 0 0 1\nvt 0 1\n"
    "f 1 2 3\nf 1/1/1 2//1 -1\nf 1 2 3 4\n",
)
OFF = (
    "OFF\n# a comment\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3 255 0 0\n4 0 1 2 3\n",
    "COFF 3 1 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n0 1 0 1 1 1 1\n3 0 1 2\n",
)
PLY = (
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nelement face 2\n"
    "property list uchar int vertex_indices\nend_header\n"
    "0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 1 4\n3 0 1 2\n4 0 1 2 3\n",
)
TEXTURED_PLY = (
    "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
    "property int texnumber\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n0 0 1 1 1\n"
    "3 0 1 2 6 0 0 .5 0 .5 .5 0\n4 0 1 2 3 8 0 0 1 0 1 1 0 1 0\n"
)
TEXTURED_OBJ = (
    "mtllib a.mtl\no one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvt 1 1\nvt 0 0\nusemtl a\n"
    "f 1/1 2/2 3/3\n"
)
MTL = "newmtl a\nKd 0.5 1 1\nmap_Kd -s 1 1 1 -bm 2 a.<UDIM>.png\nnewmtl b\nmap_Kd b.png\n"
STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    "endloop\nendfacet\nendsolid a\n"
)


@cache
def sound(kind):
    """A small sound file of a kind, as another library writes it."""
    data = trimesh.creation.box().export(file_type=kind)
    return data.encode() if isinstance(data, str) else data


@cache
def textured_glb():
    uv = np.array([[0, 0], [1, 0], [0, 1]])
    xyz = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    nodes = [{"name": "n", "mesh": 0, "scale": [-1, 1, 1]}]
    return glb(nodes, [("m", [(xyz, uv, [[0, 1, 2]], 0)])], [("a", 0)], [image((1, 2, 3))])


def read_and_repair(path):
    """The mesh, the files that it names, and the pages that its own layout would have."""
    file = read_mesh_file(path)
    assert file.vertices.dtype == np.float64
    assert file.faces.dtype == np.int32
    companions(path)
    source = repair(file.vertices, file.faces, file.layout)
    if file.layout is not None:
        for material in file.layout.materials:
            picture_side(material)
        kept_pages(source.mesh, UnwrapOptions())
    return source


@given(broken_text(OBJ))
def test_obj(place, data):
    """Whatever hangs on the corners and ends the lines."""
    refused_or_read(read_and_repair, place / "a.obj", data, "read_mesh obj")


@given(broken_text(OFF))
def test_off(place, data):
    """Whatever stands in the header."""
    refused_or_read(read_and_repair, place / "a.off", data, "read_mesh off")


@given(broken_text(PLY))
def test_text_ply(place, data):
    """Whatever the header promises."""
    refused_or_read(read_and_repair, place / "a.ply", data, "read_mesh ply")


@given(broken_text((TEXTURED_PLY, TEXTURED_PLY.replace("list uchar float texcoord", "int flags"))))
def test_textured_ply(place, data):
    """Coordinates at the corners and at the vertices."""
    refused_or_read(read_and_repair, place / "t.ply", data, "read_mesh textured ply")


@given(st.deferred(lambda: broken_bytes((sound("stl"), STL.encode()))))
def test_stl(place, data):
    """Both kinds."""
    refused_or_read(read_and_repair, place / "a.stl", data, "read_mesh stl")


@given(broken_text((MTL,)))
def test_materials_of_an_obj(place, data):
    """Whatever stands in its library: the mesh is read all the same."""
    (place / "a.mtl").write_bytes(data)
    (place / "with.obj").write_text(TEXTURED_OBJ)
    assert read_and_repair(place / "with.obj").mesh.layout is not None


@given(st.deferred(lambda: broken_bytes((textured_glb(),))))
def test_textured_glb(place, data):
    """Coordinates, materials and images that are spoiled."""
    refused_or_read(read_and_repair, place / "t.glb", data, "read_mesh textured glb")


@given(st.deferred(lambda: broken_bytes((sound("glb"),))))
def test_glb(place, data):
    """Containers whose lengths and contents are spoiled."""
    refused_or_read(read_and_repair, place / "a.glb", data, "read_mesh glb")


@cache
def compressed():
    """Files by Draco and by meshopt."""
    return tuple(path.read_bytes() for path in sorted(SAMPLES.glob("*.glb")))


@given(st.deferred(lambda: broken_bytes(compressed())))
def test_compressed_glb(place, data):
    """Decoders of other hands with spoiled heads, data and filters."""
    refused_or_read(read_and_repair, place / "c.glb", data, "read_mesh compressed glb")


@given(
    st.deferred(lambda: st.sampled_from(compressed())),
    st.deferred(lambda: broken_value(tuple(content_of(data)[0] for data in compressed()))),
)
def test_compressed_glb_of_sound_lengths(place, data, value):
    """Compressed parts of counts, strides, modes and numbers that are not theirs."""
    whole = container(value, content_of(data)[1])
    refused_or_read(read_and_repair, place / "c.glb", whole, "read_mesh compressed glb")


def content_of(data):
    """The text of a glb, and the chunks after it."""
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[20 + length :]


def container(value, rest):
    """A glb of sound lengths around any text."""
    text = json.dumps(value).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest


@cache
def gltf_content():
    content, rest = content_of(sound("glb"))
    content["nodes"].append({"children": [0], "matrix": np.eye(4).ravel().tolist()})
    return content, rest


@given(st.deferred(lambda: broken_value((gltf_content()[0],))))
def test_glb_of_sound_lengths(place, value):
    """Texts whose numbers, lists and references are not what they should be."""
    data = container(value, gltf_content()[1])
    refused_or_read(read_and_repair, place / "a.glb", data, "read_mesh glb")


@given(st.deferred(lambda: broken_json((gltf_content()[0],))))
def test_gltf(place, data):
    """Texts without their buffer."""
    refused_or_read(read_and_repair, place / "a.gltf", data, "read_mesh gltf")


def nested_glb(depth):
    """A chain of nodes with a triangle at its end."""
    nodes = [{"children": [i + 1], "translation": [1, 0, 0]} for i in range(depth - 1)]
    position = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
    content = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [*nodes, {"mesh": 0}], "accessors": [position],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36}],
    }  # fmt: skip
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    xyz = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(xyz), b"BIN\0") + xyz
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_a_chain_of_thousands_of_nodes_is_read(place):
    """Once it took minutes."""
    source = refused_or_read(read_and_repair, place / "n.glb", nested_glb(3000), "read_mesh glb")
    np.testing.assert_array_equal(source.mesh.vertices[0], [2999, 0, 0])


FOUND = {
    "comments.off": b"OFF " + b"# \n" * 50_000 + b"x",
    "cut.ply": PLY[0][:-12].encode(),
    "short.obj": b"v 0 0 0\nv 1 0\nv 0 1 0 7\nv 0 0 1\nf 1 2 3\n",
    "short.off": b"OFF\n3 1 0\n0 0 0\n1 0\n0 1 0 0\n3 0 1 2\n",
    "digits.off": "OFF\n\u00b2 1 0\n".encode(),
    "bytes.off": b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n\x80nan 0 1 2\n",
    "extensions.glb": nested_glb(1)[:12],
}


@pytest.mark.parametrize("name", FOUND)
def test_what_was_once_read_wrong_or_not_at_all_is_refused(place, name):
    """Seeds of faults that were met."""
    (place / name).write_bytes(FOUND[name])
    with pytest.raises(InputError, match=name):
        read_mesh(place / name)
