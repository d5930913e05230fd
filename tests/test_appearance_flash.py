"""A flash beside the camera. Truth is a lump photographed by other rays, with other highlights than
those that are fitted, each flash of an output of its own.
"""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flash_caster import INTENSITY, LAMP, METALLIC, ROUGHNESS, SIZE, colors, lump
from photo_sets import photo_set
from PIL import Image
from plyfile import PlyData
from skimage.color import deltaE_ciede2000

from texproj.appearance.flash.closed_form import fit_lambert, fit_material
from texproj.appearance.flash.lamp import Lamp
from texproj.appearance.flash.materials import base_materials
from texproj.appearance.flash.observations import Observations
from texproj.appearance.flash.recover import Blend, flash_appearance
from texproj.appearance.flash.reflection import Angles, Material, linear_terms
from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli import main
from texproj.color.checker.fit import lab_of_srgb
from texproj.formats.cameras import cameras_json
from texproj.formats.models import read_model, write_ply
from texproj.options import RenderOptions
from texproj.photo import Photo, PhotoInfo
from texproj.records import CameraRecord
from texproj.render import open_renderer

METAL = np.array(METALLIC) > 0.5
lumps = cache(lambda: lump(30, subdivisions=4))


def seen_by(made, photos):
    """What the photos show under the flash, with a gray blend."""
    shots = [Photo(PhotoInfo(str(k), *SIZE), pixels) for k, pixels in enumerate(photos)]
    count = len(made.mesh.vertices)
    blend = Blend(np.full((count, 3), 0.3, np.float32), np.ones(count, bool))
    with open_renderer(RenderOptions(renderer="cpu")) as renderer:
        given = made.mesh, photo_set(made.cameras[: len(photos)], shots), renderer
        return lambda lamp: flash_appearance(*given, lamp, blend, lambda *_: None)


@cache
def found(intensity):
    made = lumps()
    return made, seen_by(made, made.photos)(Lamp(LAMP, intensity=intensity))


def off(base, made):
    """(n,) CIEDE2000 against the truth."""
    truth = lab_of_srgb(colors(made.mesh.vertices, made.kind))
    return deltaE_ciede2000(lab_of_srgb(np.clip(base, 0, 1)), truth)


def test_materials_and_colors_come_out():
    """Stone, paint and gold are told from each other, and each color without the light."""
    made, surface = found(INTENSITY)

    assert surface.accepted, surface.reason
    kinds = surface.light.found.kinds
    assert sorted(kind.metal for kind in kinds) == [False, False, True]
    seen = surface.confidence > 0
    metal = METAL[made.kind]
    assert ((surface.metallic > 0.5) == metal)[seen].mean() > 0.96
    sure = surface.confidence > np.median(surface.confidence)
    assert ((surface.metallic > 0.5) == metal)[sure].mean() > 0.98
    error = off(surface.base, made)
    for number, most in enumerate((2.5, 2.5, 8.0)):
        assert np.median(error[seen & (made.kind == number)]) < most
    roughness = np.array(ROUGHNESS)[made.kind]
    paint = seen & (made.kind == 1)
    assert np.median(np.abs(surface.roughness - roughness)[paint]) < 0.1
    stone = seen & (made.kind == 0)
    assert np.median(surface.roughness[stone]) > 0.6
    assert np.median(np.abs(surface.roughness - roughness)[seen & metal]) < 0.15


def test_each_flash_has_an_output_of_its_own():
    """They were 15 % apart, and are known to 2."""
    made, surface = found(INTENSITY)

    gain = surface.light.found.flashes.gain / made.output
    assert np.std(made.output) > 0.05
    assert np.std(gain / gain.mean()) < 0.02
    assert list(surface.light.output) == [str(k) for k in range(len(made.photos))]


def test_photos_held_out_are_predicted():
    """By far better than by matte colors, and than by plain ones."""
    verdict = found(INTENSITY)[1].verdict

    assert verdict.photos == 4
    assert verdict.lit_db > verdict.matte_db + 4 > verdict.plain_db + 4
    assert 0.5 < verdict.highlights < 1


def test_a_flash_of_unknown_strength_tells_colors_up_to_a_factor():
    """So they are not called reflectances; the materials are the same, or fewer."""
    made, surface = found(None)

    assert surface.accepted, surface.reason
    assert not surface.absolute
    assert 0.5 < surface.light.found.lamp.intensity / INTENSITY < 2
    seen = surface.confidence > 0
    assert ((surface.metallic > 0.5) == METAL[made.kind])[seen].mean() > 0.94


def test_photos_without_a_flash_are_refused():
    """In even light: the colors stay those of the blend, to the bit."""
    made = lumps()
    even = [np.where(photo.max(axis=2, keepdims=True) > 12, 140, 0) for photo in made.photos]
    rng = np.random.default_rng(0)
    even = [np.clip(e + rng.normal(0, 3, made.photos[0].shape), 0, 255) for e in even]

    surface = seen_by(made, [e.astype(np.uint8) for e in even])(Lamp(LAMP))

    assert not surface.accepted
    assert "dark room" in surface.reason
    assert (surface.base == np.float32(0.3)).all()
    assert surface.light is None
    assert surface.metallic.max() == 0


def test_a_few_photos_are_refused():
    made = lumps()
    surface = seen_by(made, made.photos[:4])(Lamp(LAMP))

    assert not surface.accepted
    assert "too few photos" in surface.reason


@pytest.mark.parametrize(
    ("orientation", "expected"),
    [(1, (1, 2, 3)), (3, (-1, -2, 3)), (6, (-2, 1, 3)), (8, (2, -1, 3))],
)
def test_the_lamp_turns_with_the_camera(orientation, expected):
    """EXIF 6 is a camera turned so that its right points down in the upright photo."""
    camera = Camera(Intrinsics(40, 30, 40, 40, 20, 15), Pose.identity())

    place, axis = Lamp(np.array([1.0, 2, 3])).in_world(camera, orientation)

    assert place == pytest.approx(expected)
    assert axis == pytest.approx([0, 0, 1])


def one_point(material, color, count=12, seed=0, nearest=1.0):
    """Observations of one point of a material, from all around, without noise. nearest: to its
    highlight, as a cosine.
    """
    rng = np.random.default_rng(seed)
    nl, nv, nh = (
        rng.uniform(low, high, count).astype(np.float32)
        for low, high in ((0.4, 1), (0.4, 1), (nearest - 0.2, nearest))
    )
    angles = Angles(nl, nv, nh, np.full(count, 0.999, np.float32))
    light = rng.uniform(0.5, 1.5, count).astype(np.float32)
    slope, offset = linear_terms(material.values, angles)
    rgb = (light * slope)[:, None] * np.float32(color) + (light * offset)[:, None]
    none = np.zeros((count, 3), np.float32)
    return Observations(
        1, np.zeros(count, int), np.arange(count), rgb, light, angles, np.ones(count, np.float32),
        none, none > 0,
    )  # fmt: skip


@pytest.mark.parametrize("metal", [True, False])
def test_the_color_of_a_material_is_exact(metal):
    """In closed form, by the true material; by another one it is off, and the cost says so."""
    material, color = Material(0.4, metal), (0.8, 0.5, 0.2)
    seen = one_point(material, color)

    fit = fit_material(seen, material)

    assert fit.color[0] == pytest.approx(color, rel=1e-3)
    assert fit.cost[0] < 0.06
    assert fit_material(seen, replace(material, metal=not metal)).cost[0] > 0.5
    assert fit_lambert(seen).cost[0] > 0.1


def test_what_was_cut_at_white_is_only_a_lower_bound():
    """A highlight that the photo could not hold does not darken the metal."""
    material, color = Material(0.4, True), (0.8, 0.5, 0.2)
    seen = one_point(material, color)
    cut = seen.rgb > 0.9 * seen.rgb.max()
    dark = replace(seen, rgb=np.where(cut, 0.5 * seen.rgb, seen.rgb), cut=cut)

    assert fit_material(dark, material).color[0] == pytest.approx(color, rel=1e-2)


def test_as_many_materials_as_there_are():
    """Candidates that only fit noise better are left out."""
    rng = np.random.default_rng(0)
    kind = rng.integers(0, 3, 600)
    cost = 1 + rng.uniform(0, 0.02, (600, 20)) + 0.5 * rng.uniform(0.5, 1, 20)
    cost[np.arange(600), kind * 7] = 0.5 + rng.uniform(0, 0.02, 600)

    assert sorted(base_materials(cost.astype(np.float32))) == [0, 7, 14]


@pytest.fixture(scope="module")
def flash_project(tmp_path_factory):
    """A project of the lump."""
    root, made = tmp_path_factory.mktemp("flash") / "lump", lumps()
    (root / "photos").mkdir(parents=True)
    write_ply(root / "lump.ply", made.mesh.vertices, made.mesh.faces, None)
    records = {}
    for number, (camera, pixels) in enumerate(zip(made.cameras, made.photos, strict=True)):
        name = f"{number:02}.png"
        Image.fromarray(pixels).save(root / "photos" / name)
        records[name] = CameraRecord(
            name, *SIZE, camera.intrinsics, camera.pose, "registered", "import"
        )
    (root / "cameras.json").write_text(cameras_json(records.values()))
    lamp = ", ".join(str(x) for x in LAMP)
    (root / "project.toml").write_text(
        f'mesh = "lump.ply"\n[light]\nkind = "flash"\nposition = [{lamp}]\n'
        "[color]\noccluders = false\n"
    )
    return root


def test_the_command_writes_gloss_and_metals(flash_project, capsys):
    """Vertices, textures, images, materials and light; a lit glb that names its materials."""
    out = flash_project / "out"

    assert main(["appearance", str(flash_project), "--to", "texture", "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    images = {f"{name}_0.png" for name in ("base_color", "roughness", "metallic", "confidence")}
    assert images | {"model.glb", "model.obj", "model.mtl", "materials.json"} < set(told["files"])
    light = json.loads((out / "light.json").read_text())
    assert light["sun"] is None
    assert light["kind"] == "flash"
    assert light["accepted"]
    assert len(light["output"]) == 30
    materials = json.loads((out / "materials.json").read_text())
    assert sum(material["metallic"] for material in materials) == 1
    assert sum(material["share"] for material in materials) == pytest.approx(1)
    vertex = PlyData.read(out / "appearance.ply")["vertex"]
    assert set(np.unique(vertex["metallic"])) == {0, 1}
    model = read_model(out / "model.glb")
    assert len(model.pages) == 1
    metallic = np.asarray(Image.open(out / "metallic_0.png"))
    assert metallic.ndim == 2
    assert 0.05 < (metallic > 127).mean() < 0.6
    assert b"KHR_materials_specular" not in (out / "model.glb").read_bytes()
    mtl = (out / "model.mtl").read_text()
    assert "map_Pr roughness_0.png" in mtl
    assert "map_Pm metallic_0.png" in mtl
    assert main(["appearance", str(flash_project), "--to", "texture"]) == 0
    said = capsys.readouterr().out
    assert "fresh, kept" in said
    assert "saw its highlight" in said
    assert main(["report", str(flash_project)]) == 0
    assert "saw its highlight" in (out / "report.html").read_text()


@pytest.mark.parametrize(
    ("light", "said"),
    [('kind = "flash"', "[light] `position`"),
     ('kind = "natural"\nposition = [0, 0, 0]', 'are a flash\'s, and `kind` is "natural"'),
     ('kind = "flash"\nposition = [0, 0, 0]\ngray = "lump.ply"', "`gray` is for light"),
     ('kind = "polarized"\nposition = [0, 0, 0]\ngray = "lump.ply"', "`gray` is for light"),
     ('profile = "flash.json"', 'are a flash\'s, and `kind` is "none"'),
     ('kind = "flash"\nprofile = "flash.json"', "no flash calibration at")],
)  # fmt: skip
def test_a_flash_that_is_told_badly_is_refused(flash_project, light, said, capsys):
    """With the key to write or to leave out."""
    settings = flash_project / "project.toml"
    kept = settings.read_text()
    settings.write_text(f'mesh = "lump.ply"\n[light]\n{light}\n')
    try:
        assert main(["appearance", str(flash_project)]) == 2
    finally:
        settings.write_text(kept)
    assert said in capsys.readouterr().err
