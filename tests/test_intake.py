"""What a person puts into a folder is found under any usual name, or named as ignored."""

import os
import unicodedata

import pytest

from texproj.errors import InputError
from texproj.intake import (
    find_masks,
    find_photos,
    find_picks,
    folders_of_photos,
    one_of,
    unusable_name,
)
from texproj.project import Project

PHOTOS = ("IMG_1.JPG", "café.jpg", "b.png")


def put(folder, *names):
    for name in names:
        (folder / name).write_bytes(b"x")
    return folder


@pytest.mark.parametrize(
    ("name", "photo"),
    [
        ("IMG_1.png", "IMG_1.JPG"),
        ("img_1.PNG", "IMG_1.JPG"),
        ("IMG_1.JPG.png", "IMG_1.JPG"),
        ("IMG_1_mask.png", "IMG_1.JPG"),
        ("IMG_1.mask.png", "IMG_1.JPG"),
        ("img_1.jpg.mask.tif", "IMG_1.JPG"),
        ("b.jpg", "b.png"),
        (unicodedata.normalize("NFD", "café") + ".png", "café.jpg"),
        (unicodedata.normalize("NFC", "CAFÉ") + "_MASK.jpeg", "café.jpg"),
    ],
)
def test_a_mask_is_found_under_every_usual_name(tmp_path, name, photo):
    """Case, composed accents, and what programs append do not matter."""
    found = find_masks(put(tmp_path, name), PHOTOS)

    assert {key: path.name for key, path in found.paths.items()} == {photo: name}
    assert found.notes == ()


def test_a_file_that_belongs_to_no_photo_is_named_with_the_nearest(tmp_path):
    """A misspelled mask is never ignored in silence; what the system hides is."""
    found = find_masks(put(tmp_path, "IMG_11.png", "notes.txt", ".DS_Store", "Thumbs.db"), PHOTOS)

    assert found.paths == {}
    near, other = found.notes
    assert "IMG_11.png is ignored: it belongs to no photo (did you mean 'IMG_1'?)" in near
    assert "notes.txt is ignored: it is not an image" in other


def test_two_masks_of_one_photo_are_a_question_for_the_person(tmp_path):
    """Which of them is meant cannot be known."""
    found = find_masks(put(tmp_path, "b.png", "b_mask.png"), PHOTOS)

    with pytest.raises(InputError, match=r"b\.png and .*b_mask\.png both belong to b\.png"):
        one_of(found, "b.png")
    assert one_of(found, "IMG_1.JPG") is None


def test_picks_are_found_by_stem_or_whole_name(tmp_path):
    """A csv of another name is told."""
    found = find_picks(put(tmp_path, "IMG_1.csv", "B.PNG.CSV", "c.csv"), PHOTOS)

    assert set(found.paths) == {"IMG_1.JPG", "b.png"}
    assert "c.csv is ignored" in found.notes[0]


def test_pictures_that_are_not_read_are_counted(tmp_path):
    """Videos and other images beside photos: one sentence."""
    names = [f"{k}.MOV" for k in range(7)]
    found = find_photos(put(tmp_path, "a.jpg", "m.webp", *names), (".jpg",))

    assert list(found.paths) == ["a.jpg"]
    (note,) = found.notes
    assert note.startswith("8 files skipped in ")
    assert "and 3 more" in note
    assert "other image, video" in note


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_a_name_that_cannot_be_written_back_is_passed_over(tmp_path):
    """cameras.json is text: a name of other bytes, or of two lines, could not be read back."""
    try:
        (tmp_path / os.fsdecode(b"bad\xff.jpg")).write_bytes(b"x")
    except OSError:
        pytest.skip("this file system takes no such name")
    put(tmp_path, "two\nlines.jpg", "good.jpg")

    found = find_photos(tmp_path, (".jpg",))

    assert list(found.paths) == ["good.jpg"]
    assert len(found.notes) == 2
    assert all(note.isprintable() for note in found.notes)


@pytest.mark.parametrize(
    ("name", "good"), [("é.jpg", True), ("a\x07.jpg", False), ("\udcff", False)]
)
def test_usable_names(name, good):
    """Letters of any script are; control characters and stray bytes are not."""
    assert (unusable_name(name) == "") == good


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
def test_a_mesh_of_such_a_name_is_refused(tmp_path):
    """Reports and camera files, which are text, would have to name it."""
    (tmp_path / "mesh").mkdir()
    try:
        (tmp_path / "mesh" / os.fsdecode(b"scan\xff.ply")).write_bytes(b"x")
    except OSError:
        pytest.skip("this file system takes no such name")
    with pytest.raises(InputError, match="its name is not UTF-8; rename it"):
        _ = Project.open(tmp_path).mesh_path


def test_a_link_to_what_is_gone_is_told(tmp_path):
    """A disk that is not connected takes photos and masks away, which nobody asked for."""
    (tmp_path / "a.jpg").symlink_to(tmp_path / "disk" / "a.jpg")
    (tmp_path / "masks").symlink_to(tmp_path / "disk")

    found = find_photos(put(tmp_path, "b.jpg"), (".jpg",))
    assert list(found.paths) == ["b.jpg"]
    assert "a.jpg is passed over: it is a link to" in found.notes[0]
    with pytest.raises(InputError, match=r"masks: it is a link to .*disk, which is not there"):
        find_masks(tmp_path / "masks", PHOTOS)


def test_a_file_in_place_of_a_folder_is_told(tmp_path):
    """Its picks, masks, photos would be none, in silence."""
    with pytest.raises(InputError, match="masks is a file where a folder should be"):
        find_masks(put(tmp_path, "masks") / "masks", PHOTOS)


def test_photos_in_a_folder_inside_are_told(tmp_path):
    """A card that was copied as a whole into photos/ is not used."""
    (tmp_path / "photos/100CANON").mkdir(parents=True)
    put(tmp_path / "photos", "a.jpg")
    put(tmp_path / "photos/100CANON", "b.jpg")
    (note,) = Project.open(tmp_path).notes
    assert "photos in" in note and "100CANON are not used; move them to" in note


def test_a_folder_that_cannot_be_read_is_told(tmp_path, monkeypatch):
    """Of masks that is an end, in a word; beside photos, as a disk's lost+found, it is a note."""
    (tmp_path / "photos/lost+found").mkdir(parents=True)
    put(tmp_path / "photos", "a.jpg")
    (tmp_path / "masks").mkdir()
    within = type(tmp_path).iterdir

    def guarded(folder):
        if folder.name in ("lost+found", "masks"):
            raise PermissionError(13, "Permission denied")
        return within(folder)

    monkeypatch.setattr(type(tmp_path), "iterdir", guarded)
    with pytest.raises(InputError, match="masks cannot be read: Permission denied"):
        find_masks(tmp_path / "masks", PHOTOS)
    assert find_photos(tmp_path / "photos", (".jpg",)).paths
    (note,) = folders_of_photos(tmp_path / "photos", (".jpg",)).values()
    assert "lost+found cannot be read" in note.notes[0]
