"""`texproj new` looks into what it takes, and finds photos where cameras put them."""

import shutil

import pytest

from texproj.creation import create_project
from texproj.errors import InputError


@pytest.fixture
def given(demo_folder, tmp_path):
    """A folder with a mesh and three photos one folder down, as on a camera's card."""
    card = tmp_path / "DCIM"
    (card / "100CANON").mkdir(parents=True)
    for photo in sorted((demo_folder / "photos").iterdir())[:3]:
        shutil.copy(photo, card / "100CANON")
    shutil.copy(next((demo_folder / "mesh").iterdir()), tmp_path / "scan.ply")
    return tmp_path


def test_photos_one_folder_down_are_taken(given):
    """DCIM itself holds none: those of its folders are meant."""
    said = []
    project = create_project(
        given / "p", given / "scan.ply", [given / "DCIM"], link=False, tell=said.append
    )

    assert len(project.photo_names) == 3
    assert said == [f"photos are taken from {given / 'DCIM' / '100CANON'}"]


def test_photos_beside_a_folder_of_photos_leave_that_out_and_say_so(given):
    """Thumbnails below the photos are not taken for photos."""
    shutil.copy(next((given / "DCIM" / "100CANON").iterdir()), given / "DCIM" / "own.jpg")
    said = []
    project = create_project(
        given / "p", given / "scan.ply", [given / "DCIM"], link=False, tell=said.append
    )

    assert project.photo_names == ["own.jpg"]
    assert "100CANON are not taken" in said[0]


def test_a_damaged_photo_is_named_and_taken(given):
    """It fails by itself later; the others do not wait for it."""
    photo = sorted((given / "DCIM" / "100CANON").iterdir())[1]
    photo.write_bytes(photo.read_bytes()[: photo.stat().st_size // 2])
    said = []
    project = create_project(
        given / "p", given / "scan.ply", [given / "DCIM"], link=False, tell=said.append
    )

    assert photo.name in project.photo_names
    assert any(photo.name in line and "until it is replaced" in line for line in said)


def test_a_point_cloud_is_refused_before_anything_is_made(given):
    """There is no surface to color."""
    (given / "cloud.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    with pytest.raises(InputError, match=r"cloud\.ply"):
        create_project(given / "p", given / "cloud.ply", [given / "DCIM"], link=False)

    assert not (given / "p").exists()


def test_quotes_in_the_name_of_a_mesh_do_not_break_the_settings(given):
    """The name is written so that TOML reads it back."""
    strange = given / 'sc"an\\1.ply'
    shutil.copy(given / "scan.ply", strange)
    project = create_project(given / "p", strange, [given / "DCIM"], link=False)

    assert project.mesh_path.name == strange.name


def test_a_mesh_of_which_nothing_is_left_is_refused_before_anything_is_made(given):
    """Its only face hangs on a vertex that is no number."""
    (given / "nan.obj").write_text("v 0 0 0\nv nan 1 0\nv 1e308 0 1\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"nan\.obj: "):
        create_project(given / "p", given / "nan.obj", [given / "DCIM"], link=False)

    assert not (given / "p").exists()
