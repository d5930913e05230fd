"""The light of the photos told from the surface. Truth is the demo's own sun and sky, whose light
differs from the one that is fitted: a haze with a horizon, an echo instead of bounces, a soft sun.
"""

import json
import shutil
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from plyfile import PlyData
from scipy.spatial import cKDTree
from skimage.color import deltaE_ciede2000

from texproj.appearance.days import of_several_days
from texproj.appearance.harmonics import OPEN_GAINS, basis
from texproj.appearance.light_fit import GLOSS
from texproj.appearance.natural import natural_appearance
from texproj.appearance.palette import clusters, members
from texproj.appearance.sun import angle_deg, spiral
from texproj.appearance.transfer import LightCaster
from texproj.cli import main
from texproj.color.checker.fit import lab_of_srgb
from texproj.demo.light import Lighting
from texproj.demo.make import colors_on
from texproj.demo.noise import noise
from texproj.demo.object import carved, piece, scanned
from texproj.demo.pattern import painted
from texproj.demo.photographer import set_up
from texproj.formats.models import read_model
from texproj.mesh import Mesh, face_areas, vertex_normals
from texproj.photo import LUMINANCE, linear_from_srgb
from texproj.stages.lighting import days_of

SUNNY = Lighting()
CLOUDY = Lighting(sun=(0.0, 0.0, 0.0), sky=(0.80, 0.86, 0.95), bounce=(0.2, 0.19, 0.17))
FOOTPRINT = 0.004
"""Metres over which a pixel averages."""

NOISE = 0.03
"""Relative noise of the colors that are looked at."""


@cache
def lit(lighting: Lighting):
    """A scan, its true albedo and the light that it sends out with a dielectric's gloss."""
    made = piece("stele", 5)
    scene = set_up(carved(made, 30_000), painted(5), lighting, sky_rays=24)
    scan = scanned(made, 15_000, 0.0004, 5)
    normals = vertex_normals(scan).astype(np.float32)
    albedo, light = colors_on(scene, scan.vertices.astype(np.float32), normals, FOOTPRINT)
    rgb = light * (1 + 0.04 / np.maximum(albedo, 0.05))
    noise = np.random.default_rng(1).normal(1, NOISE, rgb.shape)
    return scan, albedo, (rgb * noise).astype(np.float32)


def off(found, truth, tint_known):
    """(n,) CIEDE2000 of linear colors at the scale (or one for each channel) that fits best."""
    ratio = truth / np.maximum(found, 1e-3)
    scale = np.median(ratio, axis=0) if tint_known else np.median(ratio @ LUMINANCE)
    return deltaE_ciede2000(lab_of_srgb(np.clip(found * scale, 0, 1)), lab_of_srgb(truth))


def all_seen(mesh):
    return np.ones(len(mesh.vertices), bool)


def test_harmonics_are_orthonormal():
    """Their products integrate to 1 or 0 over the sphere."""
    values = basis(spiral(20_000))
    products = 4 * np.pi * values.T @ values / len(values)

    assert products == pytest.approx(np.eye(9), abs=2e-3)


def plain(size=1.0):
    """A square that faces z."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]]) * size
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def test_an_open_surface_gets_the_irradiance_of_the_textbook():
    """Rays give what Ramamoorthi and Hanrahan derive for a surface that nothing shades."""
    mesh = plain()
    found = LightCaster(mesh, np.zeros((4, 3), np.float32)).transfer(np.arange(4), 4096)

    expected = OPEN_GAINS * basis(np.array([[0, 0, 1.0]]))
    assert found.sky == pytest.approx(np.repeat(expected, 4, 0), abs=0.01)
    assert found.openness == pytest.approx(1)
    assert not found.indirect.any()


def test_what_is_closed_in_is_lit_by_what_is_around():
    """Inside of a box of radiance L no sky is seen, and the irradiance is pi L."""
    x, y, z = np.meshgrid([-1.0, 1], [-1.0, 1], [-1.0, 1], indexing="ij")
    corners = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))], np.int32)
    mesh = Mesh(corners, faces)
    radiance = np.tile(np.array([0.2, 0.4, 0.6], np.float32), (8, 1))

    found = LightCaster(mesh, radiance).transfer(np.arange(8))

    assert found.openness == pytest.approx(0)
    assert found.indirect == pytest.approx(np.pi * radiance, rel=1e-3)


def test_a_roof_keeps_the_sun_off():
    """Cosine in the open, 0 in the cast shadow; where its edge crosses what a vertex stands for the
    part that is lit counts, so that the light that falls beside a roof of .5 is that of its area.
    """
    x, y = (part.ravel() for part in np.meshgrid(*[np.linspace(-1, 1, 12)] * 2))
    corner = (np.arange(11)[:, None] * 12 + np.arange(11)).ravel()
    quads = [corner[:, None] + part for part in ([0, 1, 13], [0, 13, 12])]
    ground = Mesh(np.column_stack([x, y, 0 * x]), np.concatenate(quads).astype(np.int32))
    roof = plain(0.5)
    caster = LightCaster(
        Mesh(
            np.concatenate([ground.vertices, roof.vertices + np.array([0, 0, 0.5])]),
            np.concatenate([ground.faces, roof.faces[:, ::-1] + len(x)]),
        ),
        np.zeros((len(x) + 4, 3), np.float32),
    )
    open_, dark = ((np.abs(x) > 0.7) | (np.abs(y) > 0.7)), (np.abs(x) < 0.3) & (np.abs(y) < 0.3)
    spots = caster.cells.spots(np.arange(len(x)), 64)

    found = caster.sun(spots, np.array([0, 0, 1.0]))
    assert found[open_] == pytest.approx(1, abs=1e-3)
    assert not found[dark].any()
    cell = np.bincount(ground.faces.ravel(), np.repeat(face_areas(ground) / 3, 3))
    assert cell @ found == pytest.approx(4 - 1, rel=0.01)
    low = np.array([0, np.sin(np.radians(80)), np.cos(np.radians(80))])
    assert caster.sun(spots, low)[x < -0.7] == pytest.approx(low[2], abs=1e-3)


def test_hues_make_a_palette():
    """Two hues of any brightness are two clusters, and no more are made."""
    rng = np.random.default_rng(0)
    chroma = np.repeat([[0.5, -0.3], [-0.4, 0.6]], 200, axis=0)
    assert len(clusters(chroma)) == 2
    chroma += rng.normal(0, 0.01, chroma.shape)
    label = members(chroma, clusters(chroma, 2))
    assert len(set(label[:200])) == len(set(label[200:])) == 1
    assert label[0] != label[-1]


@cache
def found_in(lighting):
    """The appearance of a lit piece, and (V,) how far off colors were and are, the tint known."""
    mesh, albedo, rgb = lit(lighting)
    found = natural_appearance(mesh, rgb, all_seen(mesh))
    return found, off(rgb, albedo, True), off(found.base, albedo, True)


def test_the_sun_is_found_and_taken_out():
    """Its direction within 2 degrees; what is left is the paint, in the shade too."""
    found, before, after = found_in(SUNNY)

    assert found.accepted, found.reason
    assert angle_deg(found.light.to_sun, SUNNY.to_sun.astype(float)) < 2
    assert np.median(after) < 6.5
    assert np.median(after) < 0.45 * np.median(before)
    assert 0 <= found.confidence.min() < found.confidence.max() <= 1
    sure = found.confidence > np.median(found.confidence)
    assert np.median(after[sure]) < np.median(after)
    assert (found.irradiance > 0).all()


def test_no_sun_is_found_under_clouds():
    """The sky alone is taken out."""
    found, before, after = found_in(CLOUDY)

    assert found.accepted, found.reason
    assert found.light.to_sun is None
    assert found.light.sun is None
    assert np.median(after) < 0.6 * np.median(before)


def test_two_days_make_one_surface():
    """Each with a light of its own, at one scale; it is no worse than the surer one, and a day that
    was refused tells nothing.
    """
    mesh, albedo, rgb = lit(SUNNY)
    (sunny, _, _), (cloudy, _, _) = found_in(SUNNY), found_in(CLOUDY)
    brighter = replace(cloudy, base=np.clip(cloudy.base * np.float32(1.2), 0, 1))
    seen = all_seen(mesh)

    both = of_several_days(mesh, {"17": sunny, "18": brighter}, rgb, seen)

    assert both.accepted
    assert set(both.light.days) == {"17", "18"}
    errors = [np.median(off(a.base, albedo, True)) for a in (both, sunny, cloudy)]
    assert errors[0] < min(errors[1:]) + 0.2
    refused = replace(cloudy, accepted=False, reason="too dark", base=rgb)
    alone = of_several_days(mesh, {"17": sunny, "18": refused}, rgb, seen)
    assert alone.base == pytest.approx(sunny.base, abs=1e-5)
    none = of_several_days(mesh, {"18": refused}, rgb, seen)
    assert not none.accepted
    assert "too dark" in none.reason
    assert (none.base == np.clip(rgb, 0, 1)).all()


@pytest.mark.parametrize(
    ("taken", "days"),
    [
        (["2026-05-17T10:00:00"] * 4 + ["2026-05-19T09:00:00"] * 4, 2),
        (["2026-05-17T10:00:00"] * 8, 0),
        (["2026-05-17T10:00:00"] * 5 + ["2026-05-19T09:00:00"] * 3, 0),
        (["2026-05-17T10:00:00"] * 4 + [""] * 4, 0),
    ],
)
def test_days_are_told_by_exif(taken, days):
    """Where every photo says it, and each day has enough of them."""
    infos = {str(k): SimpleNamespace(taken=one) for k, one in enumerate(taken)}
    project = SimpleNamespace(photo_info=infos.__getitem__)

    assert len(days_of(project, list(infos))) == days


def test_colors_are_base_times_irradiance():
    """What is taken out and what is left give the colors again, but for a dielectric's gloss."""
    _, _, rgb = lit(CLOUDY)
    found, _, _ = found_in(CLOUDY)

    again = (found.base + np.float32(GLOSS)) * found.irradiance
    inside = (found.base < 1).all(axis=1) & (found.base > 0.02).all(axis=1)
    assert inside.mean() > 0.8
    assert np.abs(again - rgb)[inside].max() < 1e-3


def test_paint_without_light_is_refused():
    """Colors that no light made stay as they are, to the bit."""
    mesh, albedo, _ = lit(CLOUDY)

    found = natural_appearance(mesh, albedo, all_seen(mesh))

    assert not found.accepted
    assert "cannot be told from the paint" in found.reason
    assert (found.base == np.clip(albedo, 0, 1)).all()
    assert found.light is None
    assert found.confidence.max() == pytest.approx(0.1)


def test_a_stain_is_not_taken_for_light():
    """Paint of one hue that fades over the whole piece looks lit, but not nearby."""
    mesh, _, _ = lit(CLOUDY)
    fading = 0.35 * np.exp(0.35 * noise(mesh.vertices.astype(np.float32), 1.6, 3, 2.0))
    rgb = fading[:, None] * np.array([1, 0.9, 0.8], np.float32)

    found = natural_appearance(mesh, rgb, all_seen(mesh))

    assert not found.accepted
    assert found.verdict.gain_db > 1


def test_a_little_that_is_seen_is_refused():
    """A light has 30 numbers; what is all but black tells none either."""
    mesh, _, rgb = lit(CLOUDY)
    seen = np.arange(len(rgb)) < 100

    found = natural_appearance(mesh, rgb, seen)

    assert not found.accepted
    assert "register more photos" in found.reason

    found = natural_appearance(mesh, rgb * np.float32(0.003), all_seen(mesh))
    assert not found.accepted
    assert "too dark" in found.reason


def test_a_closed_room_has_no_sky():
    """Nothing falls over where no ray leaves; colors that need no light are refused."""
    mesh, albedo, _ = lit(CLOUDY)
    inside = Mesh(mesh.vertices, mesh.faces[:, ::-1])

    found = natural_appearance(inside, albedo, all_seen(mesh))

    assert np.isfinite(found.base).all()


def test_a_chart_fixes_tint_and_scale():
    """Colors in units of what lies open to the sky become reflectances, not only up to a factor."""
    mesh, albedo, rgb = lit(CLOUDY)
    in_chart = rgb / np.asarray(CLOUDY.sky, np.float32)

    found = natural_appearance(mesh, in_chart, all_seen(mesh), "scale")

    assert found.absolute
    ratio = np.median(found.base / np.maximum(albedo, 0.05), axis=0)
    assert ratio == pytest.approx([1, 1, 1], abs=0.15)
    assert ratio.max() / ratio.min() < 1.06


def test_the_command_writes_the_surface_and_its_light(project_folder, capsys):
    """Vertices in the scan's order, lit models, no sun where none is; the same again is kept."""
    shutil.copy(project_folder / "truth/cameras.json", project_folder / "cameras.json")
    out = project_folder / "out"

    assert main(["appearance", str(project_folder), "--to", "texture", "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert {"appearance.ply", "appearance.glb", "model.glb", "base_color_0.png"} < set(
        told["files"]
    )
    light = json.loads((out / "light.json").read_text())
    assert told["light"] == light
    assert light["kind"] == "natural"
    assert light["accepted"], light["reason"]
    assert not light["absolute"]
    sun = light["sun"]
    assert sun is None or angle_deg(np.array(sun), SUNNY.to_sun.astype(float)) < 5
    vertex = PlyData.read(out / "appearance.ply")["vertex"]
    scan = PlyData.read(project_folder / "mesh/scan.ply")["vertex"]
    assert (vertex["x"] == scan["x"]).all()
    for name in ("base_r", "base_g", "base_b", "roughness", "metallic", "confidence"):
        assert vertex[name].dtype == np.float32
    assert len(read_model(out / "appearance.glb").vertices) == len(vertex["x"])
    for name in ("appearance.glb", "model.glb"):
        assert b"KHR_materials_unlit" not in (out / name).read_bytes()
    texels_are_vertices(read_model(out / "model.glb"), vertex)

    assert main(["appearance", str(project_folder), "--to", "texture"]) == 0
    assert "fresh, kept" in capsys.readouterr().out
    assert main(["status", str(project_folder)]) == 0
    assert "appearance appearance.ply           fresh" in capsys.readouterr().out
    assert main(["report", str(project_folder)]) == 0
    page = (out / "report.html").read_text()
    assert "parts of the surface left out of the fit" in page
    raked_light_shows_more_relief(project_folder, capsys)


def raked_light_shows_more_relief(folder, capsys):
    """Than the sky of the day, in a picture and in a film."""
    pictures = []
    for light in (["--sky", "photographed"], ["--sun", "-80,15", "--sky", "none"]):
        assert main(["relight", str(folder), "--size", "96", *light]) == 0
        assert "exposed at EV" in capsys.readouterr().out
        pictures.append(cv2.imread(str(folder / "out/relit.png"), cv2.IMREAD_GRAYSCALE))
    middles = [p[24:72, 24:72].astype(np.float32) for p in pictures]
    day, raked = (cv2.Laplacian(p / p.mean(), cv2.CV_32F).std() for p in middles)
    assert raked > 1.05 * day
    assert main(["relight", str(folder), "--size", "16", "--film", "gif"]) == 0
    assert (folder / "out/relit.gif").is_file()


def texels_are_vertices(model, vertex):
    """The texture says the same of the surface as the ply, which is coarser and does not fade
    beside what is unseen: compared on the mean of neighbors, since texels show finer paint.
    """
    page = linear_from_srgb(np.asarray(model.pages[0])[..., :3] / 255.0)
    size = np.array(page.shape[1::-1])
    at = (model.uv * (1, -1) + (0, 1)) * size - 0.5
    column, row = np.clip(np.round(at).astype(int), 0, size - 1).T
    found = np.zeros((len(model.vertices), 3))
    found[model.faces] = page[row, column][model.uv_faces]
    base = np.stack([vertex[f"base_{c}"] for c in "rgb"], axis=1)
    place = cKDTree(np.stack([vertex[k] for k in "xyz"], axis=1)).query(model.vertices)[1]
    seen = vertex["confidence"][place] > 0
    texels, vertices = found[seen] @ LUMINANCE, base[place][seen] @ LUMINANCE
    assert np.median(texels / vertices) == pytest.approx(1, abs=0.05)
    near = cKDTree(model.vertices[seen]).query(model.vertices[seen], 8)[1]
    assert np.corrcoef(texels[near].mean(axis=1), vertices[near].mean(axis=1))[0, 1] > 0.78


def test_a_chart_that_is_not_there_is_named(project_folder, capsys):
    """With its path and the key that says so; nothing is written."""
    with (project_folder / "project.toml").open("a") as file:
        file.write('[light]\ngray = "chart.jpg"\n')

    assert main(["appearance", str(project_folder)]) == 2

    said = capsys.readouterr().err
    assert "chart.jpg; correct `gray` in [light]" in said
    assert not (project_folder / "out").exists()


def test_status_tells_what_changed(project_folder, capsys):
    """Without a wish for it there is nothing to tell; with one it is not made yet."""
    main(["status", str(project_folder)])
    assert "appearance" not in capsys.readouterr().out
    with (project_folder / "project.toml").open("a") as file:
        file.write('[light]\nkind = "natural"\n')
    main(["status", str(project_folder)])
    assert "stale: not made yet" in capsys.readouterr().out.split("appearance")[2]
