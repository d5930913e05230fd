"""Pairs of photos through polarizers. Truth is a lump in the demo's studio, whose paint loses half
of its light in either filter and whose mirrors lose none in the parallel one.
"""

import io
import json
import shutil
from dataclasses import dataclass

import numpy as np
import pytest
from flash_caster import lump_mesh, waves
from PIL import Image
from plyfile import PlyData

from texproj.appearance.polarized.differences import paired
from texproj.camera import Camera, Intrinsics, Pose
from texproj.cli import main
from texproj.demo.sensor import Sensor, developed
from texproj.demo.studio import Lamp, Made, Studio, Stuff
from texproj.formats.cameras import cameras_json
from texproj.formats.models import write_ply
from texproj.photo import linear_from_srgb
from texproj.records import CameraRecord

PHOTOS, SIZE = 14, (160, 120)
LAMP = np.array([0.05, -0.04, 0.01])
COLORS = np.array([[0.5, 0.42, 0.35], [0.1, 0.18, 0.4]], np.float32)
SLOPES = 0.5, 0.15
"""Beckmann's: roughness .7, whose mirror drowns, and .39."""


@dataclass(frozen=True)
class Filtered(Stuff):
    """Seen through a filter."""

    crossed: bool = False

    def reflects(self, base, wi, wo):
        whole = super().reflects(base, wi, wo)
        mirror = super().reflects(np.zeros_like(base), wi, wo)
        return (whole - mirror) / 2 + (0 if self.crossed else mirror)


def made_of(xyz):
    """Stone and glossy paint."""
    kind = (waves(xyz, 0.2, 1) > 0.3).astype(int)
    return Made(COLORS[kind], kind)


@pytest.fixture(scope="module")
def polarized_project(tmp_path_factory):
    """A lump under a flash; one photo has no partner, one file no photo."""
    root, mesh = tmp_path_factory.mktemp("polarized") / "lump", lump_mesh(4)
    (root / "mesh").mkdir(parents=True)
    write_ply(root / "mesh/lump.ply", mesh.vertices, mesh.faces, None)
    records = {}
    for folder in ("photos", "photos-crossed"):
        (root / folder).mkdir()
        crossed = folder == "photos-crossed"
        studio = Studio(mesh, [Filtered(s, crossed=crossed) for s in SLOPES], made_of)
        for number in range(PHOTOS):
            camera = all_over(number)
            place = camera.pose.inverse.apply(LAMP[None])[0]
            lamp = Lamp(place, 0.004, (1.1, 1.1, 1.1))
            light = studio.photographed(camera, [lamp], np.zeros(3), number)
            pixels = developed(light, Sensor(), np.random.default_rng([number, crossed]))
            name = f"{number:02}.png"
            Image.fromarray(pixels).save(root / folder / name)
            records[name] = CameraRecord(
                name, *SIZE, camera.intrinsics, camera.pose, "registered", "import"
            )
    (root / "photos-crossed/03.png").rename(root / "photos-crossed/99.png")
    (root / "cameras.json").write_text(cameras_json(records.values()))
    lamp = ", ".join(str(x) for x in LAMP)
    (root / "project.toml").write_text(f'[light]\nkind = "polarized"\nposition = [{lamp}]\n')
    return root


def all_over(number):
    z = 0.95 - 1.9 * (number + 0.5) / PHOTOS
    angle = number * np.pi * (3 - np.sqrt(5))
    toward = np.array([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    w, h = SIZE
    return Camera(
        Intrinsics(w, h, 2.1 * w, 2.1 * w, w / 2, h / 2), Pose.look_at(0.9 * toward, [0] * 3)
    )


def test_paint_and_mirror_come_apart(polarized_project, capsys):
    """Paint from the crossed photos, to a tenth; the mirror of what is glossy, by the
    difference; what has no partner is named, with what to do.
    """
    out = polarized_project / "out"

    assert main(["appearance", str(polarized_project), "--to", "texture", "--json"]) == 1

    told = json.loads(capsys.readouterr().out)
    assert "photos-crossed; it is left out" in told["failed"]["03.png"]
    assert any("99.png is ignored" in reason for reason in told["failed"].values())
    light = json.loads((out / "light.json").read_text())
    assert light["kind"] == "polarized"
    assert light["accepted"], light["reason"]
    assert light["verdict"]["gain_db"] > 1
    vertex = PlyData.read(out / "appearance.ply")["vertex"]
    base = np.stack([vertex[f"base_{c}"] for c in "rgb"], axis=1)
    made = made_of(np.stack([vertex[k] for k in "xyz"], axis=1).astype(np.float32))
    seen = vertex["confidence"] > 0.5
    ratio = np.log(base[seen] / made.base[seen]).mean(axis=1)
    assert np.median(np.abs(ratio - np.median(ratio))) < 0.1
    scale = np.exp(np.median(ratio))
    glossy = seen & (made.kind == 1)
    assert 0.025 < np.median(vertex["mirrored"][glossy]) / scale < 0.06
    rough = vertex["roughness"][glossy]
    assert np.median(rough) == pytest.approx(0.39, abs=0.1)
    materials = json.loads((out / "materials.json").read_text())
    assert any(one["f0"] for one in materials)
    assert b"KHR_materials_specular" in (out / "appearance.glb").read_bytes()
    page = linear_from_srgb(np.asarray(Image.open(out / "base_color_0.png"))[..., :3] / 255.0)
    shades = page[page.max(axis=2) > 0.01].max(axis=1)
    truth = base[seen].max(axis=1)
    assert np.quantile(shades, [0.2, 0.8]) == pytest.approx(np.quantile(truth, [0.2, 0.8]), rel=0.2)
    f0 = next(one["f0"] for one in materials if one["f0"])
    mirrors = specular_page(out / "model.glb")
    blue = page[..., 2] > 1.5 * page[..., 0]
    stone = (page[..., 0] > page[..., 2]) & (page.max(axis=2) > 0.01)
    assert np.quantile(mirrors[blue], 0.25) == pytest.approx(f0 / 0.04, abs=0.02)
    assert np.median(mirrors[stone]) == pytest.approx(1, abs=0.01)
    rough = np.asarray(Image.open(out / "roughness_0.png")) / 255
    assert np.median(rough[blue]) == pytest.approx(0.39, abs=0.1)
    assert main(["appearance", str(polarized_project), "--to", "texture"]) == 1
    said = capsys.readouterr().out
    assert "fresh, kept" in said
    assert "mirrors from what photos/ show beyond it" in said


def specular_page(path):
    """What a glb mirrors against the usual F0, linear, on its only page."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + length])
    told = document["materials"][0]["extensions"]["KHR_materials_specular"]
    source = document["textures"][told["specularColorTexture"]["index"]]["source"]
    view = document["bufferViews"][document["images"][source]["bufferView"]]
    start = 28 + length + view["byteOffset"]
    picture = Image.open(io.BytesIO(data[start : start + view["byteLength"]]))
    return linear_from_srgb(np.asarray(picture)[..., 0] / 255.0) * told["specularColorFactor"][0]


def test_two_partners_of_one_photo_refuse_it_alone(polarized_project, tmp_path, capsys):
    """With both their names; `status` goes on too, and sees when one is taken away."""
    root = tmp_path / "twice"
    shutil.copytree(polarized_project, root, ignore=shutil.ignore_patterns("out", "work"))
    second = root / "photos-crossed/05.tif"
    shutil.copy(root / "photos-crossed/05.png", second)

    assert main(["status", str(root)]) == 0
    capsys.readouterr()
    assert main(["appearance", str(root), "--json"]) == 1

    told = json.loads(capsys.readouterr().out)
    assert "05.png and" in told["failed"]["05.png"]
    assert "both belong to 05.png; keep one" in told["failed"]["05.png"]
    assert len(told["used"]) == PHOTOS - 2
    second.unlink()
    main(["status", str(root)])
    assert "crossed 05.png changed" in capsys.readouterr().out


def test_swapped_folders_are_refused(polarized_project, tmp_path, capsys):
    """Highlights are then where none may be."""
    root = shutil.copytree(polarized_project, tmp_path / "swapped")
    (root / "photos").rename(root / "other")
    (root / "photos-crossed").rename(root / "photos")
    (root / "other").rename(root / "photos-crossed")
    (root / "photos/99.png").rename(root / "photos/03.png")
    damaged = root / "photos/05.png"
    damaged.write_bytes(damaged.read_bytes()[:2000])

    assert main(["appearance", str(root), "--json"]) == 1

    told = json.loads(capsys.readouterr().out)
    light = told["light"]
    assert "damaged" in told["failed"]["05.png"]
    assert not light["accepted"]
    assert "swap the folders" in light["reason"]


def test_no_partner_at_all_is_an_error(polarized_project, tmp_path, capsys):
    """With the folder that they belong into."""
    root = shutil.copytree(polarized_project, tmp_path / "alone")
    shutil.rmtree(root / "photos-crossed")

    assert main(["appearance", str(root)]) == 2
    assert "photos-crossed" in capsys.readouterr().err


def cut(folder):
    for path in folder.glob("*.png"):
        path.write_bytes(path.read_bytes()[:2000])


def square(folder):
    for path in folder.glob("*.png"):
        Image.new("RGB", (80, 80)).save(path)


def hide(folder):
    (folder.parent / "masks").mkdir()
    for path in (folder.parent / "photos").glob("*.png"):
        Image.new("L", SIZE, 0).save(folder.parent / "masks" / path.name)


@pytest.mark.parametrize(
    ("harm", "reason"),
    [(cut, "damaged"), (square, "80 x 80 pixels"), (hide, "no photo shows any of the mesh")],
)
def test_pairs_of_which_none_can_be_used(polarized_project, tmp_path, capsys, harm, reason):
    """Why, and nothing is written."""
    root = tmp_path / "harmed"
    shutil.copytree(polarized_project, root, ignore=shutil.ignore_patterns("out", "work"))
    harm(root / "photos-crossed")

    assert main(["appearance", str(root)]) == 2

    said = capsys.readouterr().err
    assert reason in said
    assert "internal fault" not in said
    assert not list(root.glob("out/*"))


@pytest.mark.parametrize("unfiltered", [False, True])
def test_the_difference_is_the_mirror(unfiltered):
    """Whether the brighter photos had a filter or none: of paint of white under the same light."""
    rng = np.random.default_rng(0)
    paint = rng.uniform(0.1, 0.3, (900, 3)).astype(np.float32)
    mirror = np.where(rng.random((900, 1)) > 0.5, rng.uniform(0, 0.3, (900, 1)), 0).astype(
        np.float32
    )
    bright = (paint if not unfiltered else 2.5 * paint) + mirror
    point, photo = np.arange(900) // 3, np.arange(900) % 3
    exposure = np.array([1.0, 2.0, 0.5], np.float32)

    found = paired(
        (point, photo, bright), (point, photo, paint * exposure[photo, None]), exposure, each=False
    )

    lost = 2.5 if unfiltered else 2.0
    expected = mirror * exposure[photo, None] / lost
    assert found.mirrored == pytest.approx(np.repeat(expected, 3, 1), abs=2e-3)
    assert not found.refusal
