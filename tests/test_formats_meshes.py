"""Reading meshes of every format, as scanners and modelers write them."""

import base64
import json
import struct
import time

import numpy as np
import pytest
import trimesh

from texproj.errors import InputError
from texproj.formats.meshes import MESH_SUFFIXES, read_mesh, read_mesh_file
from texproj.repair import repair

TETRA = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
TETRA_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def same_surface(vertices, faces, expected_vertices, expected_faces, atol=0.0):
    """Whether two meshes have the same triangles in the same order."""
    np.testing.assert_allclose(
        vertices[faces], expected_vertices[expected_faces], rtol=0, atol=atol
    )


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off", ".glb", ".gltf"])
def test_every_format_gives_the_triangles_of_the_file(tmp_path, suffix):
    path = tmp_path / f"scan{suffix}"
    exported = trimesh.Trimesh(TETRA, TETRA_FACES, process=False).export(file_type=suffix[1:])
    if isinstance(exported, dict):
        for name, data in exported.items():
            (tmp_path / name).write_bytes(data)
        path = tmp_path / "model.gltf"
    else:
        path.write_bytes(exported.encode() if isinstance(exported, str) else exported)
    vertices, faces = read_mesh(path)
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int32)
    same_surface(vertices, faces, TETRA, TETRA_FACES, atol=1e-7)
    assert suffix in MESH_SUFFIXES


def ply(header_lines, body, kind="binary_little_endian"):
    header = "\n".join(["ply", f"format {kind} 1.0", *header_lines, "end_header", ""])
    return header.encode() + body


def test_double_coordinates_of_a_ply_keep_every_bit(tmp_path):
    vertices = TETRA * 0.1 + (691_607.123456789, 5_334_760.987654321, 512.3)
    body = vertices.astype("<f8").tobytes()
    body += b"".join(struct.pack("<B3i", 3, *face) for face in TETRA_FACES.tolist())
    lines = ["element vertex 4", *(f"property double {c}" for c in "xyz")]
    lines += ["element face 4", "property list uchar int vertex_indices"]
    (tmp_path / "utm.ply").write_bytes(ply(lines, body))
    read, faces = read_mesh(tmp_path / "utm.ply")
    np.testing.assert_array_equal(read, vertices)
    np.testing.assert_array_equal(faces, TETRA_FACES)


def test_a_scanner_ply_with_colors_quality_and_face_flags(tmp_path):
    """Big-endian, properties between and after the coordinates, two properties per face."""
    dtype = [(c, ">f4") for c in "xyz"] + [(c, "u1") for c in ("red", "green", "blue", "quality")]
    rows = np.zeros(4, dtype)
    for k, c in enumerate("xyz"):
        rows[c] = TETRA[:, k]
    body = rows.tobytes()
    body += b"".join(struct.pack(">BB3i", 7, 3, *face) for face in TETRA_FACES.tolist())
    lines = ["comment scanner", "obj_info num_cols 4", "element vertex 4"]
    lines += [f"property float {c}" for c in "xyz"]
    lines += [f"property uchar {c}" for c in ("red", "green", "blue", "quality")]
    lines += ["element face 4", "property uchar flags", "property list uchar int vertex_indices"]
    (tmp_path / "scan.ply").write_bytes(ply(lines, body, "binary_big_endian"))
    vertices, faces = read_mesh(tmp_path / "scan.ply")
    np.testing.assert_array_equal(vertices, TETRA)
    np.testing.assert_array_equal(faces, TETRA_FACES)


def test_a_ply_of_mixed_polygons_is_triangulated(tmp_path):
    """A pyramid: one square and four triangles."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])
    polygons = [[3, 2, 1, 0], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    body = vertices.astype("<f4").tobytes()
    body += b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) for p in polygons)
    lines = ["element vertex 5", *(f"property float {c}" for c in "xyz")]
    lines += ["element face 5", "property list uchar int vertex_indices"]
    (tmp_path / "pyramid.ply").write_bytes(ply(lines, body))
    read, faces = read_mesh(tmp_path / "pyramid.ply")
    assert len(faces) == 6
    solid = trimesh.Trimesh(read, faces)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(1 / 3)


def test_a_textured_ply_keeps_the_vertices_of_the_file(tmp_path):
    """Texture seams do not split or renumber vertices."""
    body = TETRA.astype("<f4").tobytes()
    rng = np.random.default_rng(0)
    for face in TETRA_FACES.tolist():
        body += struct.pack("<B3iB6f", 3, *face, 6, *rng.random(6))
    lines = ["comment TextureFile none.png", "element vertex 4"]
    lines += [f"property float {c}" for c in "xyz"]
    lines += ["element face 4", "property list uchar int vertex_indices"]
    lines += ["property list uchar float texcoord"]
    (tmp_path / "t.ply").write_bytes(ply(lines, body))
    vertices, faces = read_mesh(tmp_path / "t.ply")
    np.testing.assert_array_equal(vertices, TETRA)
    np.testing.assert_array_equal(faces, TETRA_FACES)


def test_an_ascii_ply(tmp_path):
    lines = ["element vertex 4", *(f"property double {c}" for c in "xyz")]
    lines += ["element face 4", "property list uchar int vertex_index"]
    body = "".join("{:.17g} {:.17g} {:.17g}\n".format(*v) for v in TETRA / 3)
    body += "".join("3 {} {} {}\n".format(*f) for f in TETRA_FACES)
    (tmp_path / "a.ply").write_bytes(ply(lines, body.encode(), "ascii"))
    vertices, faces = read_mesh(tmp_path / "a.ply")
    np.testing.assert_array_equal(vertices, TETRA / 3)
    np.testing.assert_array_equal(faces, TETRA_FACES)


OBJ_VARIANTS = {
    "plain": "f {0} {1} {2}",
    "texture": "f {0}/3 {1}/1 {2}/2",
    "normals": "f {0}//1 {1}//2 {2}//1",
    "both": "f {0}/3/1 {1}/1/2 {2}/2/1",
    "negative": "f {3} {4} {5}",
    "negative with texture": "f {3}/-1/-2 {4}/-2/-2 {5}/-3/-1",
}


@pytest.mark.parametrize("face", OBJ_VARIANTS.values(), ids=OBJ_VARIANTS.keys())
@pytest.mark.parametrize("newline", ["\n", "\r\n"], ids=["unix", "dos"])
def test_an_obj_keeps_its_vertex_order_whatever_hangs_on_the_corners(tmp_path, face, newline):
    lines = ["# comment", "mtllib none.mtl", "o one"]
    lines += ["v {} {} {} 0.5 0.25 1".format(*v) for v in TETRA]
    lines += ["vt 0 0", "vt 1 0", "vt 0 1", "vn 0 0 1", "vn 0 1 0", "s off"]
    for i, f in enumerate(TETRA_FACES):
        lines += [f"usemtl m{i % 2}", f"g part{i}", face.format(*(f + 1), *(f - 4))]
    (tmp_path / "m.obj").write_bytes(newline.join(lines).encode())
    vertices, faces = read_mesh(tmp_path / "m.obj")
    np.testing.assert_array_equal(vertices, TETRA)
    np.testing.assert_array_equal(faces, TETRA_FACES)


def test_negative_indices_count_from_their_own_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf -3 -2 -1\n"
    (tmp_path / "m.obj").write_text(text)
    np.testing.assert_array_equal(read_mesh(tmp_path / "m.obj")[1], [[0, 1, 2], [3, 4, 5]])


def test_obj_polygons_become_fans_and_mixed_lines_of_vertices_are_read(tmp_path):
    text = "v 0 0 0\nv 1 0 0 0.1 0.2 0.3\nv 1 1 0\n v 0 1 0\nv 0.5 2 0\n"
    text += "f 1 2 3 4 5\nf 1 2\nf 1 2 \\\n3\n"
    (tmp_path / "m.obj").write_text(text)
    vertices, faces = read_mesh(tmp_path / "m.obj")
    np.testing.assert_array_equal(faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2]])
    np.testing.assert_array_equal(vertices[1], [1, 0, 0])


def test_obj_faces_out_of_range_are_left_to_the_repair(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\nf 1 2 -9\n")
    source = repair(*read_mesh(tmp_path / "m.obj"))
    assert source.repairs == {"faces out of range": 2}


def test_an_ascii_stl(tmp_path):
    text = "solid Kästchen\n"
    for face in TETRA_FACES:
        text += "facet normal 0 0 0\n outer loop\n"
        text += "".join("  vertex {} {} {}\n".format(*TETRA[v]) for v in face)
        text += " endloop\nendfacet\n"
    (tmp_path / "t.stl").write_text(text + "endsolid Kästchen\n", encoding="latin-1")
    vertices, faces = read_mesh(tmp_path / "t.stl")
    same_surface(vertices, faces, TETRA, TETRA_FACES)
    assert repair(vertices, faces).repairs == {"welded vertices": 8}


def test_a_binary_stl_may_be_called_solid_and_have_a_tail(tmp_path):
    data = bytearray(trimesh.Trimesh(TETRA, TETRA_FACES, process=False).export(file_type="stl"))
    data[:5] = b"solid"
    (tmp_path / "t.stl").write_bytes(data + b"colors follow")
    same_surface(*read_mesh(tmp_path / "t.stl"), TETRA, TETRA_FACES)


def test_the_parts_of_a_scene_are_placed_by_their_transforms(tmp_path):
    """Two nodes share one part; one is turned by a quarter and lies under a moved parent."""
    part = trimesh.Trimesh(TETRA, TETRA_FACES, process=False)
    scene = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
    move = trimesh.transformations.translation_matrix([10, 20, 30])
    scene.add_geometry(part, node_name="a", geom_name="part")
    scene.graph.update(frame_from="world", frame_to="group", matrix=move)
    scene.graph.update(frame_from="group", frame_to="b", matrix=turn, geometry="part")
    (tmp_path / "s.glb").write_bytes(scene.export(file_type="glb"))
    vertices, faces = read_mesh(tmp_path / "s.glb")
    turned = TETRA @ turn[:3, :3].T + (10, 20, 30)
    assert len(faces) == 8
    got = {tuple(map(tuple, t)) for t in np.round(vertices[faces], 5).tolist()}
    expected = np.concatenate([TETRA[TETRA_FACES], turned[TETRA_FACES]])
    assert got == {tuple(map(tuple, t)) for t in np.round(expected, 5).tolist()}


def test_a_mirrored_part_keeps_its_outside_outside(tmp_path):
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1, 1, 1])
    scene.add_geometry(trimesh.Trimesh(TETRA, TETRA_FACES, process=False), transform=mirror)
    (tmp_path / "m.glb").write_bytes(scene.export(file_type="glb"))
    solid = trimesh.Trimesh(*read_mesh(tmp_path / "m.glb"))
    assert solid.volume == pytest.approx(1 / 6)
    assert solid.bounds[0, 0] == -1


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_quads_alone_and_mixed_in_both_kinds_of_ply(tmp_path, kind):
    """A cube of six quads, and one of five quads and two triangles."""
    box = trimesh.creation.box().bounds
    corners = np.array(
        [[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    mixed = [*quads[:5], [1, 5, 7], [1, 7, 3]]
    lines = ["element vertex 8", *(f"property double {c}" for c in "xyz")]
    for polygons in (quads, mixed):
        if kind == "ascii":
            rows = [*corners.tolist(), *([len(p), *p] for p in polygons)]
            body = "\n".join(" ".join(map(str, row)) for row in rows).encode() + b"\n"
        else:
            body = corners.astype("<f8").tobytes()
            body += b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) for p in polygons)
        faces = [f"element face {len(polygons)}", "property list uchar int vertex_indices"]
        (tmp_path / "q.ply").write_bytes(ply(lines + faces, body, kind))
        solid = trimesh.Trimesh(*read_mesh(tmp_path / "q.ply"))
        assert len(solid.faces) == 12
        assert solid.is_watertight
        assert solid.volume == pytest.approx(1)


def cloud_ply():
    lines = ["element vertex 4", *(f"property float {c}" for c in "xyz")]
    return ply(lines, TETRA.astype("<f4").tobytes())


def glb_without_geometry(**content):
    text = json.dumps({"asset": {"version": "2.0"}} | content).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text


def test_a_point_cloud_says_so(tmp_path):
    (tmp_path / "c.ply").write_bytes(cloud_ply())
    with pytest.raises(InputError, match=r"c\.ply.*points but no faces"):
        read_mesh(tmp_path / "c.ply")
    (tmp_path / "c.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(InputError, match=r"c\.obj.*points but no faces"):
        read_mesh(tmp_path / "c.obj")


BROKEN = {
    "text.ply": b"This is not a mesh.\n",
    "text.obj": b"This is not a mesh.\n",
    "text.stl": b"This is not a mesh.\n",
    "text.off": b"This is not a mesh.\n",
    "text.glb": b"This is not a mesh.\n",
    "text.gltf": b"This is not a mesh.\n",
    "noise.ply": np.random.default_rng(1).bytes(5000),
    "noise.obj": np.random.default_rng(2).bytes(5000),
    "noise.stl": np.random.default_rng(3).bytes(5000),
    "noise.off": np.random.default_rng(4).bytes(5000),
    "noise.glb": np.random.default_rng(5).bytes(5000),
    "noise.gltf": np.random.default_rng(6).bytes(5000),
    "words.obj": b"v 0 0 0\nv 1 0 0\nv 0 one 0\nf 1 2 3\n",
    "zero.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "nothing.glb": glb_without_geometry(),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_one_sentence_that_names_it_and_nothing_else(tmp_path, name, capfd):
    (tmp_path / name).write_bytes(BROKEN[name])
    with pytest.raises(InputError) as error:
        read_mesh(tmp_path / name)
    message = str(error.value)
    assert message.startswith(str(tmp_path / name))
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".off", ".glb"])
@pytest.mark.parametrize("kept", [0.3, 0.7, 0.97])
def test_a_truncated_file_is_refused(tmp_path, suffix, kept):
    sphere = trimesh.creation.icosphere(2)
    data = sphere.export(file_type=suffix[1:])
    data = data.encode() if isinstance(data, str) else data
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(InputError, match=f"cut{suffix}"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off", ".glb"])
def test_spoiled_files_are_read_or_refused_but_never_crash(tmp_path, suffix):
    """Bytes replaced, removed and inserted at random, mostly in the header."""
    data = trimesh.creation.icosphere(1).export(file_type=suffix[1:])
    data = data.encode() if isinstance(data, str) else data
    rng = np.random.default_rng(len(suffix))
    path = tmp_path / f"m{suffix}"
    for _ in range(3 if suffix == ".ply" else 40):
        spoiled = bytearray(data)
        for _ in range(3):
            at = int(rng.integers(400 if rng.random() < 0.6 else len(data)))
            spoiled[at : at + int(rng.integers(9))] = rng.bytes(int(rng.integers(9)))
        path.write_bytes(spoiled)
        try:
            repair(*read_mesh(path))
        except InputError as error:
            assert "\n" not in str(error)


XYZ = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [5, 5, 5]], "<f4")
CORNERS = np.array([0, 1, 2, 3], "<u2")


def gltf(primitive, uri=None, **accessors):
    """A glTF of one part; its buffer holds XYZ, CORNERS and one more corner."""
    buffer = XYZ.tobytes() + CORNERS.tobytes() + np.array([4], "<u2").tobytes()
    data = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    position = {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"}
    indices = {"bufferView": 1, "componentType": 5123, "count": 4, "type": "SCALAR"}
    views = [(0, 60), (60, 8), (68, 2), (48, 12)]
    return {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}} | primitive]}],
        "accessors": [position | accessors.get("position", {}),
                      indices | accessors.get("indices", {})],
        "bufferViews": [{"buffer": 0, "byteOffset": a, "byteLength": n} for a, n in views],
        "buffers": [{"byteLength": len(buffer), "uri": uri or data}],
    }  # fmt: skip


SPARSE = {
    "count": 1, "indices": {"bufferView": 2, "componentType": 5123},
    "values": {"bufferView": 3},
}  # fmt: skip
KINDS = {
    "list": ({"indices": 1}, {}, [[0, 1, 2]]),
    "strip": ({"indices": 1, "mode": 5}, {}, [[0, 1, 2], [1, 3, 2]]),
    "fan": ({"indices": 1, "mode": 6}, {}, [[0, 1, 2], [0, 2, 3]]),
    "no indices": ({}, {}, [[0, 1, 2]]),
    "bytes": ({"indices": 1}, {"indices": {"componentType": 5121, "count": 3}}, [[0, 0, 1]]),
    "sparse": ({"indices": 1, "mode": 5}, {"position": {"sparse": SPARSE}}, [[0, 1, 2], [1, 3, 2]]),
}


@pytest.mark.parametrize("name", KINDS)
def test_primitives_of_every_kind(tmp_path, name):
    """Lists, strips and fans turn the way that the standard says; sparse data count."""
    primitive, accessors, expected = KINDS[name]
    (tmp_path / "a.gltf").write_text(json.dumps(gltf(primitive, **accessors)))
    vertices, faces = read_mesh(tmp_path / "a.gltf")
    np.testing.assert_array_equal(vertices, XYZ)
    np.testing.assert_array_equal(faces, expected)


def test_quantized_positions_are_fractions(tmp_path):
    """KHR_mesh_quantization: normalized integers, moved by the node."""
    position = {"componentType": 5122, "normalized": True, "count": 4}
    content = gltf({}, position=position)
    (tmp_path / "q.gltf").write_text(json.dumps(content))
    raw = np.frombuffer(XYZ.tobytes()[:24], "<i2").reshape(4, 3)
    vertices = read_mesh(tmp_path / "q.gltf")[0]
    np.testing.assert_allclose(vertices, np.maximum(raw / 32767, -1))


def test_lines_and_points_are_no_faces(tmp_path):
    (tmp_path / "p.gltf").write_text(json.dumps(gltf({"mode": 0})))
    with pytest.raises(InputError, match="points but no faces"):
        read_mesh(tmp_path / "p.gltf")


@pytest.mark.parametrize(
    "change",
    [
        {"nodes": [{"mesh": 0, "children": [0]}]}, {"nodes": [{"mesh": 1}]}, {"nodes": 5},
        {"nodes": [{"children": [1, 1]}, {"mesh": 0}]}, {"meshes": [5]}, {"accessors": {}},
        {"nodes": [{"mesh": 0, "matrix": [1] * 15}]}, {"nodes": [{"mesh": 0, "scale": "x"}]},
        {"buffers": [{"uri": "../outside.bin"}]}, {"buffers": [{"uri": "/etc/hostname"}]},
        {"buffers": [{"uri": "none.bin"}]}, {"buffers": [{"uri": "data:,%%%"}]},
        {"bufferViews": [{"buffer": 0, "byteLength": 60, "byteOffset": 30}]},
        {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 2**40, "type": "VEC3"}]},
        {"accessors": [{"bufferView": 0, "componentType": 9, "count": 3, "type": "VEC3"}]},
        {"accessors": [{"componentType": 5126, "count": 2**30, "type": "VEC3"}]},
        {"extensionsUsed": ["EXT_mesh_gpu_instancing"]},
    ],
)  # fmt: skip
def test_a_gltf_that_contradicts_itself_is_refused(tmp_path, change):
    """Circles, references to nothing, wrong counts, buffers outside of the folder."""
    (tmp_path / "a.gltf").write_text(json.dumps(gltf({}) | change))
    with pytest.raises(InputError, match=r"\.gltf|none\.bin"):
        read_mesh(tmp_path / "a.gltf")


def test_a_buffer_beside_the_original_of_a_link_is_found(tmp_path):
    """As `texproj new --link` makes it."""
    (tmp_path / "scan").mkdir()
    (tmp_path / "scan" / "b c.bin").write_bytes(XYZ.tobytes())
    (tmp_path / "scan" / "a.gltf").write_text(json.dumps(gltf({}, "b%20c.bin")))
    (tmp_path / "a.gltf").symlink_to(tmp_path / "scan" / "a.gltf")
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.gltf")[0], XYZ)


def test_off_of_every_kind(tmp_path):
    """Comments, colors, polygons, counts on the first line."""
    text = "# a\nSTCNOFF 5 2 0 # counts\n" + "".join(f"{x} {y} {z} 9 9\n" for x, y, z in XYZ)
    (tmp_path / "a.off").write_text(text + "\n4 0 1 3 2 0.5 0.5 0.5\n3 0 1 4\n")
    vertices, faces = read_mesh(tmp_path / "a.off")
    np.testing.assert_array_equal(vertices, XYZ)
    np.testing.assert_array_equal(faces, [[0, 1, 3], [0, 3, 2], [0, 1, 4]])


TEXTURED_FILES = {
    "t.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n",
    "t.gltf": json.dumps(gltf({"attributes": {"POSITION": 0, "TEXCOORD_0": 0}})).encode(),
    "t.ply": b"ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\n"
    b"property float x\nproperty float y\nproperty float z\nelement face 1\n"
    b"property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
    b"end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n",
}


@pytest.mark.parametrize("name", TEXTURED_FILES)
def test_a_mesh_that_brings_texture_coordinates_is_told_of(tmp_path, name):
    """They are read, or it is said that they are not; of a mesh that brings none nothing is."""
    (tmp_path / name).write_bytes(TEXTURED_FILES[name])
    mesh = read_mesh_file(tmp_path / name)
    assert len(mesh.faces) == 1
    told = ["not used" in note or "cannot be used" in note for note in mesh.notes]
    assert told == ([True] if name == "t.gltf" else [])
    assert (mesh.layout is not None) == (name != "t.gltf")
    (tmp_path / "plain.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert read_mesh_file(tmp_path / "plain.obj").notes == ()
    assert read_mesh_file(tmp_path / "plain.obj").layout is None


def test_missing_empty_and_unknown_files(tmp_path):
    with pytest.raises(InputError, match=r"none\.ply: cannot be read"):
        read_mesh(tmp_path / "none.ply")
    (tmp_path / "zero.stl").write_bytes(b"")
    with pytest.raises(InputError, match=r"zero\.stl: the file is empty"):
        read_mesh(tmp_path / "zero.stl")
    (tmp_path / "scan.e57").write_bytes(b"x")
    with pytest.raises(InputError, match="not a mesh file"):
        read_mesh(tmp_path / "scan.e57")


def test_large_files_are_quick(tmp_path):
    """A quarter of a million faces: processor time, bounds generous for busy machines."""
    sphere = trimesh.creation.icosphere(7)
    for suffix, seconds in {".ply": 1.0, ".glb": 1.0, ".stl": 2.0, ".obj": 3.0}.items():
        data = sphere.export(file_type=suffix[1:])
        path = tmp_path / f"s{suffix}"
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        start = time.process_time()
        assert len(read_mesh(path)[1]) == len(sphere.faces) == 327_680
        assert time.process_time() - start < seconds
