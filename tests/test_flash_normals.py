"""Normals from a flash, finer than the mesh. The truth is a lump whose relief only its photos show,
cast by other code, with other highlights than those that are fitted.
"""

import json
from contextlib import closing
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flash_caster import INTENSITY, LAMP, SIZE, lump, relief_normals
from photo_sets import photo_set
from test_appearance_flash import one_point

from texproj.appearance.flash.closed_form import model_terms
from texproj.appearance.flash.flash_pages import Given, Specular, flash_pages
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.recover import Blend, flash_appearance
from texproj.appearance.flash.reflection import Material
from texproj.appearance.flash.sampled import FlashTexels
from texproj.appearance.flash.tilt import Turning, tilts
from texproj.color.points.texels import TexelPoints
from texproj.color.result import Texture
from texproj.options import ColorOptions, OutputOptions, RenderOptions, UnwrapOptions
from texproj.photo import Photo, PhotoInfo
from texproj.render import open_renderer
from texproj.resources.scratch import Scratch
from texproj.stages.appearance_files import write_textured
from texproj.stages.lighting import Pages
from texproj.stages.writing import output_plan
from texproj.tangent_frames import colors_as_directions
from texproj.unwrap.unwrap import unwrap

SLOPE = 0.25
DENSITY = 170.0
"""Texels per metre: 6 mm each, three pixels of the photos."""


@cache
def pages(slope):
    """The lump, its atlas and its pages."""
    made = lump(20, subdivisions=4, slope=slope)
    mesh, count = made.mesh, len(made.mesh.vertices)
    shots = [Photo(PhotoInfo(str(k), *SIZE), pixels) for k, pixels in enumerate(made.photos)]
    photos = photo_set(made.cameras, shots)
    atlas = unwrap(mesh, np.full(len(mesh.faces), DENSITY), UnwrapOptions())
    blank = [np.zeros((h, w, 3), np.uint8) for w, h in atlas.page_sizes]
    texture = Texture(atlas, tuple(blank), tuple(page[..., 0] for page in blank))
    blend = Blend(np.full((count, 3), 0.3, np.float32), np.ones(count, bool))
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        given = mesh, photos, renderer
        surface = flash_appearance(*given, Lamp(LAMP, intensity=INTENSITY), blend, lambda *_: None)
        given = Given(mesh, texture, np.ones(count, np.float32))
        return made, atlas, flash_pages(given, photos, renderer, surface)


def normals(made, atlas, found):
    """(n, 3) of texels: those of the mesh, the true ones, those of the normal map, and (n,) whether
    6 photos and more see them.
    """
    with closing(Scratch()) as scratch:
        texels = FlashTexels(TexelPoints.of(made.mesh, atlas, scratch), made.mesh)
        own, wanted, shown, seen = [], [], [], []
        for number, tile in enumerate(texels.texels.tiles):
            chunk, mask = texels.chunk(number), texels.texels.mask(number)
            normal = texels.surfel(number).normal
            corners = found.normal_map.tangents[atlas.faces[chunk.owner]]
            frame = np.einsum("nk,nkc->nc", texels.parts(chunk), corners)
            page = found.normal_map.pages[tile.page][tile.rows, tile.columns][mask]
            count = found.base.photo_count[tile.page][tile.rows, tile.columns][mask]
            own.append(normal)
            wanted.append(relief_normals(chunk.xyz + made.mesh.center, normal, SLOPE))
            shown.append(colors_as_directions(page / np.float32(255), normal, frame))
            seen.append(count >= 6)
    return tuple(np.concatenate(some) for some in (own, wanted, shown, seen))


def degrees(one, other):
    return np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", one, other), -1, 1)))


def test_relief_that_the_mesh_lacks_is_on_the_normal_map():
    """Tilts of 9 degrees in the mean: less than half of that is left."""
    made, atlas, found = pages(SLOPE)

    assert found.normals.accepted, found.normals.reason
    assert found.normals.own_db > found.normals.mesh_db + 0.5
    own, wanted, shown, seen = normals(made, atlas, found)
    before, after = degrees(own, wanted), degrees(shown, wanted)
    assert 6 < np.median(before[seen]) < 12
    assert np.median(after[seen]) < 0.5 * np.median(before[seen])
    told = seen & (degrees(shown, own) > 1)
    assert np.percentile(after[told], 90) < np.median(before[seen])
    assert told.mean() > 0.3


def test_a_mesh_that_is_right_keeps_its_normals():
    """Photos that were left out are predicted no better by others, and nothing is written."""
    found = pages(0.0)[2]

    assert not found.normals.accepted
    assert "no normals finer than the mesh" in found.normals.reason
    assert found.normal_map is None


def test_normals_and_mirrors_are_in_the_files(tmp_path):
    """The glb has normal textures with tangents, and what paint mirrors where it is known; the mtl
    has the normal map beside roughness and metals.
    """
    made, _, found = pages(SLOPE)
    pages_of = replace(
        found, specular=Specular(tuple(np.zeros_like(p) for p in found.base.pages), 1.5)
    )
    plan = output_plan(ColorOptions(to="texture", bits=8), OutputOptions(models=("glb",)), ())

    files = write_textured(tmp_path, made.mesh, Pages(found.base, pages_of), plan)

    assert {"normal_0.png", "model.mtl"} < set(files)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
    assert "norm normal_0.png" in (tmp_path / "model.mtl").read_text()
    assert "map_Pr roughness_0.png" in (tmp_path / "model.mtl").read_text()
    glb = (tmp_path / "model.glb").read_bytes()
    content = json.loads(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])
    (material,) = content["materials"]
    assert content["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] >= 0
    assert material["normalTexture"] == {"index": 2}
    mirror = material["extensions"]["KHR_materials_specular"]
    assert mirror == {
        "specularColorTexture": {"index": 3}, "specularColorFactor": [1.5, 1.5, 1.5]
    }  # fmt: skip
    assert "KHR_materials_specular" in content["extensionsUsed"]


@pytest.mark.parametrize("metal", [True, False])
def test_a_tilt_is_found_exactly(metal):
    """By the true material, without noise; the color of a metal is known. One that is not tilted
    stays as it is.
    """
    material, color = Material(0.4, metal), np.array([[0.8, 0.5, 0.2]], np.float32)
    values = np.array(material.values, np.float32)[:, None]
    turning = turning_of(material)
    bent = np.array([[0.12, -0.08]], np.float32)
    for tilt in (bent, 0 * bent):
        there = turning.at(tilt)
        slope, offset = model_terms(there, values)
        seen = replace(turning.seen, rgb=slope * color + offset)

        found = tilts(replace(turning, seen=seen), values, np.array([metal]), color)

        assert found.tilt[0] == pytest.approx(tilt[0], abs=0.01)
        assert found.color[0] == pytest.approx(color[0], rel=0.05)
        assert found.believed[0] == tilt.any()


def turning_of(material):
    """One point, seen from twelve places all around, a lamp beside each."""
    seen = one_point(material, (0.8, 0.5, 0.2))
    rng = np.random.default_rng(1)
    to_eye = rng.standard_normal((12, 3)) * (0.4, 0.4, 0) + (0, 0, 1)
    to_lamp = to_eye + rng.standard_normal((12, 3)) * 0.1
    to_eye, to_lamp = (
        (v / np.linalg.norm(v, axis=1, keepdims=True)).astype(np.float32) for v in (to_eye, to_lamp)
    )
    half = to_eye + to_lamp
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    angles = replace(seen.angles, vh=np.einsum("ij,ij->i", to_eye, half))
    axes = np.eye(3, dtype=np.float32)[:, None]
    square = np.ones(12, np.float32)
    made = Turning(replace(seen, angles=angles), axes[2], axes[0], axes[1], to_eye, to_lamp, square)
    return replace(made, seen=made.at(np.zeros((1, 2), np.float32)))
