"""Models of fewer faces: the colors and the shape of the full mesh stay on them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from layout_files import Read

from texproj.color.baking.bake import baked
from texproj.color.baking.match import Matcher
from texproj.color.filling.gutters import fill_page
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture, textured_mesh
from texproj.errors import UsageError
from texproj.mesh import Mesh
from texproj.options import ColorOptions, OutputOptions, UnwrapOptions
from texproj.resources.scratch import Scratch
from texproj.stages.lightening import check_levels, lighter, write_levels
from texproj.stages.writing import output_plan
from texproj.unwrap.unwrap import unwrap

RIPPLES, HEIGHT = 9.0, 0.02
CENTER = np.array([50.0, -20.0, 3.0])


def radius(direction):
    return 1 + HEIGHT * np.sin(RIPPLES * direction[:, 0]) * np.cos(RIPPLES * direction[:, 1])


def color(xyz):
    """Encoded colors of points near the ball, 0..1: waves as long as a twentieth of it."""
    d = (xyz - CENTER) / np.linalg.norm(xyz - CENTER, axis=1, keepdims=True)
    return 0.5 + 0.3 * np.sin(12 * d + [0.0, 1.0, 2.0])


@pytest.fixture(scope="module")
def ball():
    """A rippled ball of 20480 faces, its texture, and one of about 1200 faces."""
    sphere = trimesh.creation.icosphere(5)
    direction = np.asarray(sphere.vertices)
    mesh = Mesh(CENTER + direction * radius(direction)[:, None], np.asarray(sphere.faces, np.int32))
    atlas = unwrap(mesh, 120.0, UnwrapOptions())
    pages = [np.zeros((h, w, 3), np.uint8) for w, h in atlas.page_sizes]
    counts = [np.zeros((h, w), np.uint8) for w, h in atlas.page_sizes]
    scratch = Scratch()
    points = TexelPoints.of(mesh, atlas, scratch)
    for number, tile in enumerate(points.tiles):
        chunk = points.chunk(number)
        rgb = np.round(255 * color(chunk.xyz + points.owners.origin)).astype(np.uint8)
        points.place(number, pages[tile.page], rgb)
        points.place(number, counts[tile.page], np.full(len(chunk), 3, np.uint8))
    for number, page in enumerate(pages):
        fill_page(page, points.inside(number, page.shape))
    scratch.close()
    texture = Texture(atlas, tuple(pages), tuple(counts))
    light = lighter(mesh, 1200)
    return mesh, texture, light, baked(Matcher(mesh), texture, light, UnwrapOptions())


def texels(light, atlas):
    scratch = Scratch()
    points = TexelPoints.of(light, atlas, scratch)
    for number, tile in enumerate(points.tiles):
        chunk = points.chunk(number)
        row, column = np.nonzero(points.mask(number))
        row, column = row + tile.rows.start, column + tile.columns.start
        yield tile.page, row, column, chunk.xyz + points.owners.origin, chunk.owner
    scratch.close()


def test_the_lighter_mesh_has_the_faces_that_were_asked_for(ball):
    _, _, light, made = ball
    assert abs(len(light.faces) - 1200) < 30
    assert made.texture.quality["faces"] == len(light.faces)
    away = np.linalg.norm(light.vertices - CENTER, axis=1)
    assert 0.97 < away.min() < away.max() < 1.03


def test_colors_are_those_of_the_surface_below(ball):
    """Every texel has the color of its direction, within three steps of 8 bits at nearly all."""
    _, _, light, made = ball
    off = []
    for page, row, column, xyz, _ in texels(light, made.texture.atlas):
        found = made.texture.pages[page][row, column] / 255
        off.append(np.abs(found - color(xyz)).max(axis=1))
    off = np.concatenate(off)
    assert len(off) > 20_000
    assert np.quantile(off, 0.98) < 0.02
    assert np.median(off) < 0.005


def test_the_normal_map_gives_back_the_full_mesh_s_normals(ball):
    """Decoded in the frames that the model has, as a viewer does: much nearer to the rippled ball
    than the lighter mesh's own normals are.
    """
    _, _, light, made = ball
    atlas, tangents = made.texture.atlas, made.normal_map.tangents
    normals = textured_mesh(light, made.texture).normals
    own, mapped = [], []
    for page, row, column, xyz, owner in texels(light, atlas):
        at = np.stack([column + 0.5, row + 0.5], axis=1)
        a, b, c = (atlas.uv_px[atlas.faces[owner, i]] for i in range(3))
        solved = np.linalg.solve(np.stack([b - a, c - a], axis=2), (at - a)[..., None])[..., 0]
        weight = np.stack([1 - solved.sum(axis=1), *solved.T], axis=1)
        n = unit(np.einsum("nk,nkc->nc", weight, normals[light.faces[owner]]))
        t = np.einsum("nk,nkc->nc", weight, tangents[atlas.faces[owner]])
        right = unit(t[:, :3] - n * (n * t[:, :3]).sum(axis=1, keepdims=True))
        up = np.cross(n, right) * np.sign(t[:, 3:])
        x, y, z = (made.normal_map.pages[page][row, column] / 127.5 - 1).T[..., None]
        told = unit(x * right + y * up + z * n)
        wanted = true_normals(xyz)
        own.append(np.degrees(np.arccos(np.clip((n * wanted).sum(axis=1), -1, 1))))
        mapped.append(np.degrees(np.arccos(np.clip((told * wanted).sum(axis=1), -1, 1))))
    own, mapped = np.concatenate(own), np.concatenate(mapped)
    assert np.median(own) > 1.0
    assert np.quantile(mapped, 0.99) < 1.0


def true_normals(xyz):
    """Of the rippled ball in the directions of points: the gradient of |x| - radius(x / |x|)."""

    def field(x):
        return np.linalg.norm(x, axis=1) - radius(unit(x))

    d, h = unit(xyz - CENTER), 1e-6
    d = d * radius(d)[:, None]
    return unit(np.stack([(field(d + s) - field(d - s)) / (2 * h) for s in np.eye(3) * h], axis=1))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize("unlit", [True, False])
def test_levels_are_files_of_their_own(ball, tmp_path, unlit):
    """The first is the model; a lit glb holds the normal map with tangents, an unlit one none."""
    mesh, texture, light, made = ball
    model = replace(textured_mesh(light, made.texture), normal_map=made.normal_map)
    plan = output_plan(ColorOptions(), OutputOptions(models=("glb", "obj"), unlit=unlit))
    names = write_levels(tmp_path, [model, textured_mesh(mesh, texture)], plan)
    assert sorted(names) == sorted(p.name for p in tmp_path.iterdir())
    assert set(names) == {
        "model.glb", "model.obj", "model.mtl", "model_0.png", "model_normals_0.png",
        "model_lod1.glb", "model_lod1.obj", "model_lod1.mtl", "model_lod1_0.png",
    }  # fmt: skip
    assert "norm model_normals_0.png" in (tmp_path / "model.mtl").read_text()
    assert "norm" not in (tmp_path / "model_lod1.mtl").read_text()
    read = Read(tmp_path / "model.glb")
    assert ("normalTexture" in read.content["materials"][0]) == (not unlit)
    assert len(read.content["images"]) == (1 if unlit else 2)
    attributes = read.content["meshes"][0]["primitives"][0]["attributes"]
    assert ("TANGENT" in attributes) == (not unlit)


def test_vertices_have_no_levels():
    with pytest.raises(UsageError, match="faces: a model of fewer faces has a texture"):
        check_levels(ColorOptions(to="vertices"), OutputOptions(faces=(1000,)))
    check_levels(ColorOptions(to="vertices"), OutputOptions())
