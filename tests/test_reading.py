"""What a project does with photos and cameras beyond bounds: one is refused, the rest goes on."""

import json
from dataclasses import replace

import pytest
import trimesh
from PIL import Image

from texproj.errors import InputError
from texproj.project import Project
from texproj.stages.coloring import usable_cameras

ENTRY = {
    "width": 64, "height": 48, "K": [[60, 0, 32], [0, 60, 24], [0, 0, 1]], "status": "registered",
    "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 5],
}  # fmt: skip


@pytest.fixture
def project(tmp_path):
    """Three photos of 64 x 48 and their cameras."""
    for folder in ("mesh", "photos"):
        (tmp_path / folder).mkdir()
    trimesh.creation.icosphere(1).export(tmp_path / "mesh" / "a.ply")
    for name in "abc":
        Image.new("RGB", (64, 48), (9, 99, 199)).save(tmp_path / "photos" / f"{name}.png")
    return Project.open(tmp_path)


def write_cameras(project, **changes):
    entries = [ENTRY | {"file": f"{n}.png"} | changes.get(n, {}) for n in "abc"]
    content = {"format": "texproj-cameras", "version": 1, "photos": entries}
    project.cameras_path.write_text(json.dumps(content))


def test_a_camera_of_another_shape_than_its_photo_is_not_used(project):
    """Width and height swapped; a camera of the reduced photo is as good as one of the photo."""
    half = {"width": 32, "height": 24, "K": [[30, 0, 16], [0, 30, 12], [0, 0, 1]]}
    write_cameras(project, b={"width": 48, "height": 64}, c=half)
    cameras, failed = usable_cameras(project)
    assert set(cameras) == {"a.png", "c.png"}
    assert set(failed) == {"b.png"}
    assert "b.png has 48 x 64 pixels, and upright it has 64 x 48" in failed["b.png"]


def test_a_photo_whose_header_is_damaged_does_not_stop_the_others(project):
    write_cameras(project)
    (project.root / "photos" / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    cameras, failed = usable_cameras(project)
    assert set(cameras) == {"b.png", "c.png"}
    assert "damaged" in failed["a.png"]


def test_the_limit_of_photos_is_a_setting(project):
    """It holds for headers, photos and masks, and the sentence names it."""
    name = "a.png"
    (project.root / "masks").mkdir()
    Image.new("L", (128, 96), 255).save(project.root / "masks" / name)
    assert project.load_photo(name).width == 64
    small = project.with_settings(replace(project.settings, largest_photo_mp=0.01))
    assert small.photo_info(name).width == 64
    with pytest.raises(InputError, match=r"masks.a\.png: 128 x 96 .*largest_photo_mp"):
        small.load_photo(name)
    smaller = project.with_settings(replace(project.settings, largest_photo_mp=0.003))
    for read in (smaller.photo_info, smaller.load_photo):
        with pytest.raises(InputError, match=r"photos.a\.png: 64 x 48 .*largest_photo_mp"):
            read(name)


def test_what_a_mesh_file_brings_is_told_with_its_path(project):
    path = project.root / "mesh" / "a.ply"
    path.unlink()
    path.with_suffix(".obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt x 0\nf 1/1 2/1 3/1\n")
    (note,) = Project.open(project.root).load_mesh().notes
    assert note.startswith(str(path.with_suffix(".obj")))
    assert "texture coordinates" in note
