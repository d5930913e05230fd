"""Which files a model becomes, and what happens to those of an earlier run."""

import zipfile
from dataclasses import replace

import imagecodecs
import numpy as np
import pytest
import tifffile
import trimesh
from color_scenes import plane

from texproj.cli import main
from texproj.color.result import Texture, VertexColors, textured_mesh
from texproj.errors import UsageError
from texproj.formats.models import (
    read_model,
    write_colored_glb,
    write_glb,
    write_pages,
    write_ply,
)
from texproj.mesh import ColoredMesh, Mesh, MeshSource
from texproj.options import ColorOptions, OutputOptions
from texproj.photo import linear_from_srgb
from texproj.preview.colors import texture_colors
from texproj.preview.session import shown_stamp
from texproj.preview.surface import Surface
from texproj.project import Project
from texproj.stages.coloring import SECTIONS
from texproj.stages.freshness import options_inputs
from texproj.stages.writing import output_plan, padded, write_texture, write_vertices
from texproj.unwrap.atlas import Atlas, AtlasStats

SIZE = (30, 22)  # width, height: no multiples of 4


def textured(dtype=np.uint8):
    """A square with a texture of two pages, half of the faces on each, laid out from above."""
    mesh = plane(cells=4)
    uv = (mesh.vertices[:, :2] * (0.4, -0.4) + 0.5) * SIZE
    count = len(mesh.faces)
    page = (np.arange(count) < count // 2).astype(np.int32)
    corners = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    stats = AtlasStats(2, 1.0, 1.0, 0.5, 1.0)
    vertex = mesh.faces.ravel()
    atlas = Atlas(uv[vertex], corners, vertex, page, page, (SIZE, SIZE), 4, stats)
    values = np.random.default_rng(0).random((2, SIZE[1], SIZE[0], 3))
    pages = tuple(np.round(values * np.iinfo(dtype).max).astype(dtype))
    return mesh, Texture(atlas, pages, ())


def written(folder, color=None, dtype=np.uint8, **options):
    mesh, texture = textured(dtype)
    plan = output_plan(ColorOptions(**(color or {})), OutputOptions(**options))
    names = write_texture(folder, mesh, texture, plan)
    assert sorted(names) == sorted(p.name for p in folder.iterdir())
    return names, texture.pages


# --- what is asked for


def test_by_default_a_texture_is_written_as_glb_and_obj_with_png(tmp_path):
    names, pages = written(tmp_path)
    assert names == ("model.glb", "model.obj", "model.mtl", "model_0.png", "model_1.png")
    for number, page in enumerate(pages):
        png = (tmp_path / f"model_{number}.png").read_bytes()
        np.testing.assert_array_equal(imagecodecs.png_decode(png), page)
        assert png in (tmp_path / "model.glb").read_bytes()


@pytest.mark.parametrize(
    ("models", "expected"),
    [
        (("glb",), {"model.glb"}),
        (("obj",), {"model.obj", "model.mtl", "model_0.jpg", "model_1.jpg"}),
    ],
)
def test_one_kind_alone_leaves_no_other_file(tmp_path, models, expected):
    names, _ = written(tmp_path, models=models, image="jpeg")
    assert set(names) == expected


def test_the_images_of_tiff_are_for_the_obj_and_the_glb_has_png(tmp_path):
    names, pages = written(tmp_path, image="tiff")
    assert {"model_0.tif", "model_1.tif"} < set(names)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "model_1.tif"), pages[1])
    found = {page.tobytes() for page in read_model(tmp_path / "model.glb").pages}
    assert found == {page.tobytes() for page in pages}


def test_16_bits_reach_the_obj_and_the_glb_holds_8(tmp_path):
    """The glTF standard has 8-bit values for colors."""
    _, pages = written(tmp_path, {"bits": 16}, np.uint16)
    png = imagecodecs.png_decode((tmp_path / "model_0.png").read_bytes())
    assert png.dtype == np.uint16
    np.testing.assert_array_equal(png, pages[0])
    eight = {np.round(page / 257).astype(np.uint8).tobytes() for page in pages}
    assert {page.tobytes() for page in read_model(tmp_path / "model.glb").pages} == eight


def test_normals_and_unlit_can_be_left_out(tmp_path):
    written(tmp_path, normals=False, unlit=False)
    glb = (tmp_path / "model.glb").read_bytes()
    assert b"NORMAL" not in glb and b"unlit" not in glb
    assert "\nvn " not in (tmp_path / "model.obj").read_text()


@pytest.mark.parametrize(
    ("color", "output", "words"),
    [
        ({"to": "vertices"}, {"models": ("obj",)}, "obj .*vertices.*ply, glb"),
        ({}, {"models": ("ply",)}, "ply .*texture.*glb, obj"),
        ({"bits": 16}, {"models": ("glb",)}, "16 bits .*obj with png, tiff or exr"),
        ({"bits": 16}, {"image": "jpeg"}, "16 bits .*obj with png, tiff or exr"),
        ({"to": "vertices", "bits": 16}, {"models": ("ply",)}, "16 bits .*a glb"),
        ({}, {"image": "ktx2", "models": ("obj",)}, "ktx2 is for glb"),
        ({}, {"image": "ktx2"}, "basisu.* on PATH"),
    ],
)
def test_what_cannot_be_written_is_refused_before_any_work(monkeypatch, color, output, words):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UsageError, match=words):
        output_plan(ColorOptions(**color), OutputOptions(**output))


def test_pages_for_graphics_cards_are_padded_and_show_the_same(tmp_path):
    """Sides that are multiples of 4; every texture coordinate stays on its texel."""
    mesh, texture = textured()
    model = textured_mesh(mesh, texture)
    large = padded(model, 4)
    assert [page.shape for page in large.pages] == [(24, 32, 3)] * 2
    for old, new in zip(model.pages, large.pages, strict=True):
        np.testing.assert_array_equal(new[:22, :30], old)
        np.testing.assert_array_equal(new[22:, :30], np.repeat(old[-1:], 2, 0))
    down = (1, -1), (0, 1)
    before = (model.uv * down[0] + down[1]) * SIZE
    after = (large.uv * down[0] + down[1]) * (32, 24)
    np.testing.assert_allclose(after, before, atol=1e-12)


# --- vertices


def source_with_strays():
    """A mesh file with a vertex that the repair dropped, in another order than the mesh."""
    mesh = plane(cells=2)
    count = len(mesh.vertices)
    order = np.random.default_rng(0).permutation(count)
    vertices = np.vstack([mesh.vertices[order], [[7, 7, 7]]])
    place = np.argsort(order).astype(np.int32)
    faces = place[mesh.faces]
    return MeshSource(mesh, vertices, faces, np.append(order, -1).astype(np.int32), {})


def vertex_colors(mesh):
    rgb = np.random.default_rng(1).random((len(mesh.vertices), 3)).astype(np.float32)
    return VertexColors(rgb, np.ones(len(rgb), np.float32), np.ones(len(rgb), np.uint16))


def test_vertices_go_to_a_ply_in_the_order_of_the_file_with_normals(tmp_path):
    source = source_with_strays()
    colors = vertex_colors(source.mesh)
    plan = output_plan(ColorOptions(to="vertices"), OutputOptions())
    assert write_vertices(tmp_path, source, colors, plan) == ("model.ply",)
    read = trimesh.load_mesh(tmp_path / "model.ply", process=False)
    np.testing.assert_allclose(read.vertices, source.source_vertices)
    linear = colors.rgb[source.vertex_of_source[:-1]]
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(read.visual.vertex_colors[:-1, :3] / 255, srgb, atol=0.5001 / 255)
    assert (read.visual.vertex_colors[-1, :3] == 128).all()
    raw = read.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(raw["nz"].ravel(), [1] * 9 + [0])


def test_vertices_go_to_a_glb_without_rounding(tmp_path):
    source = source_with_strays()
    colors = vertex_colors(source.mesh)
    plan = output_plan(ColorOptions(to="vertices", bits=16), OutputOptions())
    assert write_vertices(tmp_path, source, colors, plan) == ("model.ply", "model.glb")
    (part,) = trimesh.load_scene(tmp_path / "model.glb", process=False).geometry.values()
    np.testing.assert_array_equal(part.visual.vertex_attributes["color"], colors.rgb)
    np.testing.assert_allclose(part.vertices, source.mesh.vertices)


# --- what an earlier run left


def test_files_of_an_earlier_kind_go_unless_somebody_changed_them(project_folder):
    """The glb and the page go; the obj that was edited, and what is not ours, stay."""
    folder, out = str(project_folder), project_folder / "out"
    names = {path.stem for path in (project_folder / "correspondences").glob("*.csv")}
    for photo in (project_folder / "photos").iterdir():
        if photo.stem not in names:
            photo.unlink()
    (project_folder / "cameras.json").unlink(missing_ok=True)
    assert main(["register", folder]) == 0
    assert main(["color", folder, "--texels-per-pixel", "0.2"]) == 0
    assert {"model.glb", "model.obj", "model.mtl", "model_0.png"} <= {p.name for p in out.iterdir()}
    (out / "model.obj").write_text("edited")
    (out / "mine.glb").write_text("mine")

    assert main(["color", folder, "--to", "vertices"]) == 0
    left = {path.name for path in out.iterdir() if not path.name.startswith("report")}
    assert left == {"model.ply", "model.obj", "mine.glb"}
    assert (out / "model.obj").read_text() == "edited"


def test_a_change_of_output_alone_makes_the_model_stale(project_folder):
    """And so does nothing when it is the same."""
    project = Project.open(project_folder)
    jpeg = replace(project.settings, output=OutputOptions(image="jpeg"))
    before, after = (
        options_inputs(p, 1, *SECTIONS) for p in (project, project.with_settings(jpeg))
    )
    assert {name for name in before if before[name] != after[name]} == {"[output] settings"}


def test_the_page_offers_no_model_that_it_cannot_show(tmp_path):
    """KTX 2 needs a transcoder that the page does not have; all else is shown."""
    mesh, texture = textured()
    model = textured_mesh(mesh, texture)
    images = write_pages(tmp_path / "page", model.pages, "png")
    for kind, compressed, shown in (
        ("png", False, True), ("webp", False, True), ("ktx2", False, False), ("png", True, True),
    ):  # fmt: skip
        files = [path.rename(path.with_suffix(f".{kind}")) for path in images]
        write_glb(tmp_path / "model.glb", model, files, compressed=compressed)
        images = files
        assert (shown_stamp(tmp_path / "model.glb", tmp_path) is not None) == shown
    assert shown_stamp(tmp_path / "nothing.glb", tmp_path) is None


def test_the_light_mesh_of_the_page_takes_the_vertex_colors_of_a_glb(tmp_path):
    """A ball whose color is its place, at surveyed coordinates; to the size of a light triangle."""
    ball = trimesh.creation.icosphere(4)
    offset = np.array([691_607.25, 5_334_760.5, 512.0])
    mesh = Mesh(ball.vertices + offset, ball.faces.astype(np.int32))
    colors = (ball.vertices / 2 + 0.5).astype(np.float32)
    (tmp_path / "mesh").mkdir()
    (tmp_path / "out").mkdir()
    write_ply(tmp_path / "mesh" / "m.ply", mesh.vertices, mesh.faces, None)
    write_colored_glb(
        tmp_path / "out" / "model.glb", ColoredMesh(mesh.vertices, mesh.faces, colors)
    )
    project = Project.open(tmp_path)
    surface = Surface(project, 1000)
    rgba = texture_colors(project, surface)
    place = (surface.light.mesh.vertices - offset) / 2 + 0.5
    assert (rgba[:, 3] == 255).all()
    assert np.abs(linear_from_srgb(rgba[:, :3] / 255) - place).max() < 0.08


@pytest.mark.parametrize(("image", "bits"), [("png", 8), ("png", 16), ("jpeg", 8), ("webp", 8)])
def test_a_usdz_holds_png_or_jpeg_of_8_bits_whatever_the_others_hold(image, bits, tmp_path):
    """Its images are inside alone: nothing else is left in the folder."""
    kind = np.uint8 if bits == 8 else np.uint16
    color = {"bits": bits}
    names, pages = written(tmp_path, color, kind, models=("obj", "usdz"), image=image)
    with zipfile.ZipFile(tmp_path / "model.usdz") as package:
        inside = [name for name in package.namelist() if not name.endswith(".usda")]
        data = package.read(inside[0])

    assert {"model.usdz", "model.obj"} <= set(names) and len(inside) == len(pages)
    assert data.startswith(b"\xff\xd8" if image == "jpeg" else b"\x89PNG")
    if image != "jpeg":
        assert imagecodecs.png_decode(data).dtype == np.uint8


def test_no_model_at_all_is_a_question():
    """`models = []` was taken for "auto"."""
    with pytest.raises(UsageError, match="models: none is named; choose from glb, obj, usdz"):
        output_plan(ColorOptions(), OutputOptions(models=()))
