"""Texture coordinates that a mesh brings: kept bit for bit, or left with a sentence."""

import json
import struct

import numpy as np
import pytest
from color_scenes import camera, moved, pattern, picture, plane
from layout_files import Read, glb, image
from photo_sets import photo_set
from PIL import Image

from texproj.cli import main
from texproj.color.filling.old_texture import with_old_texture
from texproj.color.texture import color_texture
from texproj.errors import InputError
from texproj.formats.meshes import read_mesh_file, read_picture
from texproj.formats.meshes.companions import companions
from texproj.formats.models import read_model
from texproj.options import ColorOptions, OutputOptions, RenderOptions, UnwrapOptions
from texproj.photo import linear_from_srgb, srgb_from_linear
from texproj.project import Project
from texproj.records import CameraRecord
from texproj.render import open_renderer
from texproj.repair import repair
from texproj.stages.writing import output_plan, write_texture
from texproj.unwrap.kept import kept_pages

VIEWS = ((0.3, 0.2, 3.0), (-0.9, 0.4, 2.8), (0.8, -0.7, 2.6))
ODD = 1.2345678e-11
"""A coordinate that 1 - (1 - v) in double precision is not."""


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        yield renderer


def loaded(path):
    file = read_mesh_file(path)
    return repair(file.vertices, file.faces, file.layout).mesh


def two_parts():
    """The square -1..1 of z = 0 in two nodes, the right one mirrored and moved, two materials; each
    has its own page, laid out with gaps and odd numbers.
    """
    square = plane(cells=8)
    xyz = square.vertices
    left = xyz[square.faces].mean(axis=1)[:, 0] < 0
    uv = xyz[:, :2] * (0.45, -0.45) + 0.5
    uv[np.argmin(xyz.sum(axis=1))] = 0.05, 0.95
    uv[np.argmax(uv[:, 1] < 0.06)] = (uv[np.argmax(uv[:, 1] < 0.06)][0], ODD)
    mirrored = (xyz - (0, 0.5, 0)) * (-1, 1, 1)  # world = (-x, y + .5, z)
    nodes = [
        {"name": "root", "children": [1, 2]},
        {"name": "left wing", "mesh": 0},
        {"name": "right wing", "mesh": 1, "translation": [0, 0.5, 0], "scale": [-1, 1, 1]},
    ]
    meshes = [
        ("left mesh", [(xyz, uv, square.faces[left], 1)]),
        ("right mesh", [(mirrored, uv, square.faces[~left][:, ::-1], 0)]),
    ]
    materials = [("Stone, rough", 0), ("gold", 1)]
    return glb(nodes, meshes, materials, [image((200, 30, 30)), image((20, 20, 220))])


def colored(mesh, renderer, unwrap=None, **options):
    cameras = [camera(c) for c in VIEWS]
    photos = photo_set(cameras, [picture(c) for c in cameras])
    return color_texture(mesh, photos, renderer, ColorOptions(**options), unwrap)


def write(folder, mesh, texture, models=("glb", "obj")):
    folder.mkdir()
    plan = output_plan(ColorOptions(), OutputOptions(models=models))
    return write_texture(folder, mesh, texture, plan)


@pytest.fixture(scope="module")
def kept(renderer, tmp_path_factory):
    """A folder with the artist's glb and what color makes of it."""
    folder = tmp_path_factory.mktemp("kept")
    (folder / "a.glb").write_bytes(two_parts())
    mesh = loaded(folder / "a.glb")
    texture = colored(mesh, renderer)
    write(folder / "out", mesh, texture)
    return folder, mesh, texture


def test_texture_coordinates_nodes_and_names_are_those_of_the_file(kept):
    """Bit for bit, corner by corner, in each node's own frame; with the names of all."""
    folder, _, _ = kept
    before, after = Read(folder / "a.glb"), Read(folder / "out/model.glb")
    for name, material in (("left wing", "gold"), ("right wing", "Stone, rough")):
        (was,), (now,) = (read.corners(name).items() for read in (before, after))
        assert was[0] == now[0] == material
        assert was[1][1].tobytes() == now[1][1].tobytes()
        np.testing.assert_array_equal(was[1][0], now[1][0])
        kept_keys = ("children", "translation", "scale")
        for key in kept_keys:
            assert before.node(name).get(key) == after.node(name).get(key)
    assert after.node("root")["children"] == [1, 2]
    assert [m["name"] for m in after.content["meshes"]] == ["left mesh", "right mesh"]
    corners = after.corners("left wing")["gold"][1]
    assert np.float32(ODD) in corners


def test_pages_have_the_colors_of_the_photos(kept):
    """Texels of both materials, found by the file's own coordinates, show the pattern of the place
    that they lie on; nothing of the old texture is left.
    """
    folder, _, texture = kept
    read = Read(folder / "out/model.glb")
    assert texture.quality["seen"] == 1
    for name in ("left wing", "right wing"):
        ((material, (xyz, uv)),) = read.corners(name).items()
        page = read.picture(material)
        middle, at = xyz.mean(axis=1), uv.mean(axis=1) * page.shape[1::-1]
        x = middle[:, 0] if name == "left wing" else -middle[:, 0]
        y = middle[:, 1] + (0 if name == "left wing" else 0.5)
        column, row = at.astype(int).T
        found = linear_from_srgb(page[row, column] / 255)
        assert np.abs(found - pattern(x, y)).max() < 0.04
    assert all(w == h and w & (w - 1) == 0 for w, h in texture.atlas.page_sizes)


def test_the_obj_keeps_parts_materials_and_every_digit(kept):
    """What goes into an obj and comes back as a mesh has the same coordinates, names and images."""
    folder, mesh, texture = kept
    again = loaded(folder / "out/model.obj")
    names = [material.name for material in again.layout.materials]
    assert sorted(names) == ["Stone, rough", "gold"]
    assert [node.name for node in again.layout.nodes] == ["left wing", "right wing"]
    assert {m.image.name for m in again.layout.materials} == {
        "model_Stone_rough.png", "model_gold.png",
    }  # fmt: skip
    was = mesh.layout.uv_up[mesh.layout.faces]
    np.testing.assert_array_equal(again.layout.uv_up[again.layout.faces], was)
    pages = kept_pages(again, UnwrapOptions())[0]
    assert set(pages.names) == set(texture.kept.names)


def test_the_model_can_be_read_back_in_the_frame_of_the_scan(kept):
    folder, mesh, _ = kept
    model = read_model(folder / "out/model.glb")
    corners = np.sort(model.vertices[model.faces].mean(axis=1).round(5), axis=0)
    wanted = np.sort(mesh.vertices[mesh.faces].mean(axis=1).round(5), axis=0)
    np.testing.assert_allclose(corners, wanted, atol=2e-5)


# --- what is no color


def with_maps(data, **material):
    """A glb whose second material says more; its images serve as any map."""
    length = struct.unpack("<I", data[12:16])[0]
    content = json.loads(data[20 : 20 + length])
    entry = content["materials"][1]
    entry["pbrMetallicRoughness"] |= material.pop("pbr", {})
    entry |= material
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest


def test_maps_of_a_kept_material_stay_with_it(renderer, tmp_path):
    """Normals, roughness and occlusion of an artist's material, its factors and strengths, image by
    image as they were; a map at other coordinates is none of these pages'. Colors are new.
    """
    odd = {"KHR_texture_transform": {"scale": [2, 2]}}
    data = with_maps(
        two_parts(), normalTexture={"index": 0, "scale": 0.5},
        occlusionTexture={"index": 0, "extensions": odd},
        pbr={"metallicRoughnessTexture": {"index": 1}, "roughnessFactor": 0.25},
    )  # fmt: skip
    (tmp_path / "a.glb").write_bytes(data)
    mesh = loaded(tmp_path / "a.glb")
    write(tmp_path / "out", mesh, colored(mesh, renderer), ("glb",))
    before, after = Read(tmp_path / "a.glb"), Read(tmp_path / "out/model.glb")
    gold = next(m for m in after.content["materials"] if m["name"] == "gold")
    stone = next(m for m in after.content["materials"] if m["name"] == "Stone, rough")
    surface = gold["pbrMetallicRoughness"]
    assert (surface["roughnessFactor"], surface["metallicFactor"]) == (0.25, 1)
    assert gold["normalTexture"]["scale"] == 0.5
    assert "occlusionTexture" not in gold
    assert after.image(gold["normalTexture"]["index"]) == before.image(0)
    assert after.image(surface["metallicRoughnessTexture"]["index"]) == before.image(1)
    assert after.image(surface["baseColorTexture"]["index"]) not in (
        before.image(0),
        before.image(1),
    )
    assert stone["pbrMetallicRoughness"]["metallicFactor"] == 0 and "normalTexture" not in stone
    assert len(after.content["images"]) == 4


# --- tiles, overlaps, what cannot be kept


def tiled(offset):
    """The square whose right half lies in another tile."""
    square = plane(cells=8)
    left = square.vertices[square.faces].mean(axis=1)[:, 0] < 0
    uv = square.vertices[:, :2] * (0.45, -0.45) + 0.5
    xyz = np.concatenate([square.vertices, square.vertices])
    uv = np.concatenate([uv, uv + offset])
    count = len(square.vertices)
    faces = np.where(left[:, None], square.faces, square.faces + count)
    return glb([{"name": "n", "mesh": 0}], [("m", [(xyz, uv, faces, 0)])], [("skin", None)])


def test_each_tile_gets_a_page_of_its_number(renderer, tmp_path):
    """UDIM: v counts up, so a glTF's v of -1 is one row up: 1012. Coordinates stay."""
    (tmp_path / "t.glb").write_bytes(tiled((1, -1)))
    mesh = loaded(tmp_path / "t.glb")
    texture = colored(mesh, renderer)
    assert texture.kept.names == ("skin_1001", "skin_1012")
    names = write(tmp_path / "out", mesh, texture)
    assert {"model_skin_1001.png", "model_skin_1012.png"} < set(names)
    read = Read(tmp_path / "out/model.glb")
    assert read.content["samplers"][0]["wrapS"] == 10497
    uv = read.corners("n")["skin_1012"][1]
    assert uv[..., 0].min() >= 1
    assert uv[..., 1].max() <= 0
    model = read_model(tmp_path / "out/model.glb")
    assert model.uv.min() >= 0
    assert model.uv.max() <= 1


def stacked(mirror):
    """The square, both halves of which lie at the same place."""
    square = plane(cells=8)
    left = square.vertices[square.faces].mean(axis=1)[:, 0] < 0
    x, y, _ = square.vertices.T
    uv = np.stack([np.abs(x) if mirror else x % 1.0001, 0.5 - 0.45 * y], axis=1) * (0.9, 1)
    return glb(
        [{"name": "n", "mesh": 0}],
        [("m", [(square.vertices, uv, square.faces[left], 0),
                (square.vertices, uv, square.faces[~left], 0)])],
        [("skin", None)],
    )  # fmt: skip


def test_shared_places_are_found_and_said(renderer, tmp_path):
    """Mirrored halves on each other: own layout and why; kept all the same if that is asked for."""
    (tmp_path / "s.glb").write_bytes(stacked(mirror=True))
    mesh = loaded(tmp_path / "s.glb")
    pages, why = kept_pages(mesh, UnwrapOptions())
    assert pages is None
    assert "100.0 % of its texture is shared by several faces, some of them mirrored" in why
    texture = colored(mesh, renderer, UnwrapOptions(keep="on"))
    assert texture.kept.names == ("skin",)
    (note,) = texture.notes
    assert "100.0 % of the texture is shared" in note
    assert "50.0 % of the surface lies mirrored" in note
    assert kept_pages(mesh, UnwrapOptions(keep="off"))[0] is None


def test_faces_over_several_tiles_have_no_place(tmp_path):
    square = plane(cells=2)
    uv = square.vertices[:, :2] * 3
    data = glb([{"mesh": 0}], [("m", [(square.vertices, uv, square.faces, None)])], [])
    (tmp_path / "r.glb").write_bytes(data)
    pages, why = kept_pages(loaded(tmp_path / "r.glb"), UnwrapOptions())
    assert pages is None
    assert "no face" in why
    with pytest.raises(InputError, match="no face of the mesh has a place in its texture"):
        kept_pages(loaded(tmp_path / "r.glb"), UnwrapOptions(keep="on"))


def test_a_mesh_without_coordinates_cannot_keep_them():
    with pytest.raises(InputError, match="brings no texture coordinates"):
        kept_pages(plane(), UnwrapOptions(keep="on"))
    assert kept_pages(plane(), UnwrapOptions()) == (None, "")


# --- the old texture


def test_the_old_texture_shows_where_no_photo_sees(renderer, tmp_path):
    """The right part turned away: every texel of its page that no photo sees is the old color, the
    others are the photos'.
    """
    square, back = plane(cells=8), plane(cells=8, z=-0.5, up=False)
    uv = square.vertices[:, :2] * (0.45, -0.45) + 0.5
    meshes = [("m", [(square.vertices, uv, square.faces, 0), (back.vertices, uv, back.faces, 1),
                     (moved(back, (0, 0, -1)).vertices, uv, back.faces, 2)])]  # fmt: skip
    images = [image((200, 30, 30)), image((20, 120, 220))]
    data = glb([{"mesh": 0}], meshes, [("front", 0), ("back", 1), ("plain", None)], images)
    (tmp_path / "b.glb").write_bytes(data)
    mesh = loaded(tmp_path / "b.glb")
    pictures = []

    def old(material, tile):
        pictures.append((mesh.layout.materials[material].name, tile))
        return read_picture(mesh.layout.materials[material], tile)

    texture = colored(mesh, renderer)
    filled = with_old_texture(mesh, texture, mesh.layout, old)
    assert set(pictures) == {("back", 1001), ("plain", 1001)}
    pages = dict(zip(texture.kept.names, filled.pages, strict=True))
    assert (pages["back"] == (20, 120, 220)).all()
    assert (pages["plain"] == (0, 0, 255)).all()
    np.testing.assert_array_equal(filled.pages[0], texture.pages[0])


# --- obj


OBJ = """mtllib my materials.mtl
o first
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
vt 0.125 0.25
vt .75 0.25
vt 0.125 0.876543210987654
vn 0 0 1
usemtl red paint
f 1/1 2/2 3/3
o second
usemtl blue
f 2/-2/1 4/3/1 -2/-3
f 1//1 2 3/
f 1/1 2/2 4/3 3/1
"""
MTL = """newmtl red paint
Kd 1 0 0
map_Kd -s 1 1 -clamp on tex/red one.png
newmtl blue
Kd 0 0 0.5
map_Kd b.<UDIM>.png
"""


@pytest.fixture
def obj(tmp_path):
    (tmp_path / "tex").mkdir()
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "my materials.mtl").write_text(MTL)
    (tmp_path / "tex/red one.png").write_bytes(image((9, 9, 9)))
    (tmp_path / "b.1001.png").write_bytes(image((1, 2, 3)))
    (tmp_path / "b.1002.png").write_bytes(image((4, 5, 6)))
    return tmp_path / "a.obj"


def test_an_obj_has_coordinates_materials_and_objects(obj):
    """Indices from the end, corners without coordinates, polygons, names with spaces, options."""
    layout = read_mesh_file(obj).layout
    assert layout.uv[2, 1] == 0.876543210987654
    faces = [[0, 1, 2], [1, 2, 0], [-1, -1, -1], [0, 1, 2], [0, 2, 0]]
    np.testing.assert_array_equal(layout.faces, faces)
    assert [m.name for m in layout.materials] == ["red paint", "blue"]
    assert [n.name for n in layout.nodes] == ["first", "second"]
    assert layout.material_of_face.tolist() == [0, 1, 1, 1, 1]
    assert layout.node_of_face.tolist() == [0, 1, 1, 1, 1]
    assert layout.materials[0].image == obj.parent / "tex/red one.png"
    blue = layout.materials[1]
    assert read_picture(blue, 1001)[0, 0].tolist() == [1, 2, 3]
    assert read_picture(blue, 1002)[0, 0].tolist() == [4, 5, 6]
    assert read_picture(blue, 1003)[0, 0].tolist() == [1, 2, 3]


def test_files_beside_an_obj_are_found(obj):
    names = ["b.1001.png", "b.1002.png", "my materials.mtl", "tex/red one.png"]
    assert sorted(companions(obj)) == names


def test_missing_and_broken_images_are_one_sentence(obj):
    (obj.parent / "tex/red one.png").unlink()
    red = read_mesh_file(obj).layout.materials[0]
    with pytest.raises(InputError, match=r"material 'red paint': there is no tex/red one\.png"):
        read_picture(red, 1001)
    (obj.parent / "b.1001.png").write_bytes(b"no png")
    blue = read_mesh_file(obj).layout.materials[1]
    with pytest.raises(InputError, match="material 'blue'"):
        read_picture(blue, 1001)
    (obj.parent / "b.1001.png").write_bytes(b"")
    with pytest.raises(InputError, match="material 'blue' is empty"):
        read_picture(blue, 1001)


# --- the whole command


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """The textured square in a project made by `texproj new`, three photos with known cameras."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "scan").mkdir()
    (folder / "scan/tex").mkdir()
    square = plane(cells=8)
    uv = square.vertices[:, :2] * 0.45 + 0.5
    lines = ["mtllib a.mtl", "o piece", *(f"v {x} {y} {z}" for x, y, z in square.vertices)]
    lines += [f"v {x} {y} -1" for x, y, _ in square.vertices]
    lines += [f"vt {u!r} {v!r}" for u, v in uv.tolist()]
    count = len(square.vertices)
    lines += ["usemtl stone", *(f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in square.faces + 1)]
    lines += ["usemtl back"]
    lines += [f"f {c + count}/{c} {b + count}/{b} {a + count}/{a}" for a, b, c in square.faces + 1]
    (folder / "scan/a.obj").write_text("\n".join(lines) + "\n")
    (folder / "scan/a.mtl").write_text(
        "newmtl stone\nmap_Kd tex/stone.png\nnewmtl back\nmap_Kd tex/back.png\n"
    )
    (folder / "scan/tex/stone.png").write_bytes(image((9, 9, 9), (64, 64)))
    (folder / "scan/tex/back.png").write_bytes(image((20, 120, 220), (64, 64)))
    (folder / "photos").mkdir()
    records = []
    for number, spot in enumerate(VIEWS):
        shot = camera(spot)
        pixels = np.round(srgb_from_linear(picture(shot).pixels) * 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / f"photos/{number}.png")
        record = CameraRecord(
            f"{number}.png", shot.width, shot.height, shot.intrinsics, shot.pose, "registered"
        )
        records.append(record)
    root = folder / "project"
    made = ["new", str(root), "--mesh", str(folder / "scan/a.obj")]
    assert main([*made, "--photos", str(folder / "photos")]) == 0
    Project.open(root).save_cameras(records)
    return root


def settings(root, text):
    (root / "project.toml").write_text(
        f'mesh = "mesh/a.obj"\n[render]\nrenderer = "cpu"\n[color]\noccluders = false\n{text}'
    )


def test_color_keeps_the_layout_and_fills_from_the_old_texture(project, capsys):
    """From the project's own copy of the images; an image that changes makes the model stale."""
    settings(project, 'fill = "texture"\n[output]\nmodels = ["obj"]\n')
    assert main(["color", str(project)]) == 0
    assert "texture coordinates are kept" in capsys.readouterr().out
    again = loaded(project / "out/model.obj")
    pictures = {m.name: read_picture(m, 1001) for m in again.layout.materials}
    assert (pictures["back"][8:-8, 8:-8] == (20, 120, 220)).all()
    assert not (pictures["stone"] == 9).all(axis=2).any()
    assert main(["status", str(project)]) == 0
    assert "color      texture                  fresh" in capsys.readouterr().out
    (project / "mesh/tex/back.png").write_bytes(image((20, 120, 221), (64, 64)))
    assert main(["status", str(project)]) == 0
    assert "tex/back.png changed" in capsys.readouterr().out


def test_a_model_of_fewer_faces_alone_keeps_no_layout(project, capsys):
    settings(project, '[output]\nmodels = ["obj"]\nfaces = [100]\n')
    assert main(["color", str(project)]) == 0
    said = capsys.readouterr().out
    assert "its layout is its own" in said
    assert "are kept" not in said


def test_color_writes_fewer_faces_and_the_whole(project):
    """Levels by the command, each with files of its own."""
    settings(project, '[output]\nmodels = ["obj"]\nfaces = [100, 1000]\n')
    assert main(["color", str(project)]) == 0
    light = loaded(project / "out/model.obj")
    assert len(light.faces) <= 104
    assert len(loaded(project / "out/model_lod1.obj").faces) == 256
    assert (project / "out/model_normals_0.png").is_file()
    assert [node.name for node in loaded(project / "out/model_lod1.obj").layout.nodes] == ["piece"]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('to = "vertices"\nfill = "texture"\n', "fill: colors of vertices"),
        ('to = "patches"\n[unwrap]\nkeep = "on"\n', "keep: patches have a layout"),
        ('to = "vertices"\n[output]\nfaces = [100]\n', "faces: a model of fewer faces"),
    ],
)
def test_settings_that_contradict_are_refused(project, capsys, text, word):
    settings(project, text)
    assert main(["color", str(project)]) == 2
    assert word in capsys.readouterr().err
