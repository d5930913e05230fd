"""Settings and masks changed by a program: what a person wrote stays, every step can be undone."""

import tomllib

import cv2
import numpy as np
import pytest

from texproj.editing.masks import Stroke, draw_on_mask, mask_of, steps_back, stroked, undo_mask
from texproj.editing.toml import TOP, Change, change_settings, edited, leave_out
from texproj.errors import InputError, OutputError, UsageError
from texproj.project import Project

WRITTEN = """# our scan
photos = "photos"   # from the Nikon

[color]  # as agreed
to = "texture" # keep
# the end
"""


@pytest.fixture
def project(tmp_path):
    """Two photos, and settings with comments."""
    for folder in ("photos", "mesh"):
        (tmp_path / folder).mkdir()
    for name in ("a.jpg", "b.b.png"):
        cv2.imwrite(str(tmp_path / "photos" / name), np.full((60, 80, 3), 90, np.uint8))
    (tmp_path / "project.toml").write_text(WRITTEN)
    return Project.open(tmp_path)


def again(project):
    return Project.open(project.root)


def test_a_key_is_set_and_taken_out_and_all_else_stays(project):
    """Comments, order and spelling; taking out what was set gives the first text again."""
    path = project.root / "project.toml"
    change_settings(project, [Change("color", "bits", 16), Change("output", "up", "z")])
    text = path.read_text()

    assert all(line in text for line in WRITTEN.splitlines())
    assert again(project).settings.color.bits == 16
    assert again(project).settings.output.up == "z"
    change_settings(again(project), [Change("color", "bits", None), Change("output", "up", None)])
    assert path.read_text().startswith(WRITTEN)
    assert tomllib.loads(path.read_text())["color"] == {"to": "texture"}


def test_a_photo_is_left_out_and_taken_back(project):
    """`exclude` stands before the tables; the last photo stays in."""
    leave_out(project, ["a.jpg"], True)
    assert again(project).photo_names == ["b.b.png"]
    assert (project.root / "project.toml").read_text().index("exclude") < WRITTEN.index(
        "[color]"
    ) + 30
    with pytest.raises(InputError, match="every photo"):
        leave_out(again(project), ["b.b.png"], True)
    with pytest.raises(UsageError, match="no photo"):
        leave_out(again(project), ["c.jpg"], True)
    leave_out(again(project), ["a.jpg"], False)
    assert again(project).photo_names == ["a.jpg", "b.b.png"]


@pytest.mark.parametrize(
    "text",
    [
        "", "color = {to = 'patches'} # inline\n", "color.to = 'patches' # dotted\n",
        WRITTEN.replace("\n", "\r\n"), "exclude = [\n  'x.jpg', # blurred\n]\n[color]\nbits = 8\n",
    ],
)  # fmt: skip
def test_other_ways_to_write_settings(text):
    """The changed text says what is meant, and nothing else is lost."""
    new = edited(text, [Change("color", "bits", 16), Change(TOP, "exclude", ["a.jpg"])], "here")
    before = tomllib.loads(text.replace("\r\n", "\n"))
    wanted = {**before, "exclude": ["a.jpg"], "color": {**before.get("color", {}), "bits": 16}}

    assert tomllib.loads(new.replace("\r\n", "\n")) == wanted
    assert new.count("\n") == new.count("\r\n") or "\r\n" not in text
    assert [c for c in ("# inline", "# dotted", "# keep") if c in text and c not in new] == []


def test_what_cannot_be_is_not_written(project):
    """A value out of bounds, an unknown table."""
    for table, key, value in (("color", "bits", 9), ("colour", "bits", 8), ("color", "x", 1)):
        with pytest.raises(UsageError):
            change_settings(project, [Change(table, key, value)])
    assert (project.root / "project.toml").read_text() == WRITTEN


def test_strokes_have_the_width_that_is_asked_for():
    """A line of radius 5 covers 10 rows, erase takes them back, growing adds its radius."""
    full = np.full((60, 80), 255, np.uint8)
    line = Stroke("paint", 5, ((20.0, 30.0), (60.0, 30.0)))
    drawn = stroked(full, line)
    rows = np.flatnonzero(drawn[:, 40] == 0)
    grown = stroked(drawn, Stroke("grow", 3))

    assert 9 <= len(rows) <= 11
    assert abs(rows.mean() + 0.5 - 30) <= 0.5
    assert (stroked(drawn, Stroke("erase", 7, line.points_px)) == 255).all()
    assert (grown[:, 40] == 0).sum() == len(rows) + 6
    assert (stroked(grown, Stroke("grow", -3))[:, 40] == 0).sum() == len(rows)
    assert (stroked(drawn, Stroke("clear")) == 255).all()


def test_every_step_on_a_mask_can_be_taken_back(project):
    """From none, over paint and growth, to none again."""
    seen = [mask_of(project, "b.b.png")]
    for stroke in (Stroke("paint", 8, ((30.0, 30.0),)), Stroke("grow", 4)):
        draw_on_mask(again(project), "b.b.png", stroke)
        seen.append(mask_of(again(project), "b.b.png"))
    assert again(project).mask_path("b.b.png").name == "b.b.png"
    assert [(m == 0).sum() for m in seen] == sorted((m == 0).sum() for m in seen)
    for before in seen[1::-1]:
        undo_mask(again(project), "b.b.png")
        assert np.array_equal(mask_of(again(project), "b.b.png"), before)
    assert again(project).mask_path("b.b.png") is None
    assert steps_back(again(project), "b.b.png") == 0
    with pytest.raises(UsageError, match="taken back"):
        undo_mask(again(project), "b.b.png")


def test_a_mask_that_a_person_made_comes_back_byte_by_byte(project):
    """A jpg mask becomes a png of the same meaning when painted on; undo restores the file."""
    (project.root / "masks").mkdir()
    theirs = np.full((60, 80), 255, np.uint8)
    theirs[:, :40] = 0
    path = project.root / "masks/a_mask.jpg"
    cv2.imwrite(str(path), theirs, [cv2.IMWRITE_JPEG_QUALITY, 100])
    data = path.read_bytes()
    draw_on_mask(again(project), "a.jpg", Stroke("paint", 6, ((60.0, 30.0),)))
    painted = mask_of(again(project), "a.jpg")

    assert not path.exists()
    assert (painted[:, :39] == 0).all()
    assert painted[30, 60] == 0
    assert painted[5, 70] > 0
    undo_mask(again(project), "a.jpg")
    assert path.read_bytes() == data
    assert [p.name for p in (project.root / "masks").iterdir()] == ["a_mask.jpg"]


def test_a_stroke_that_cannot_be_written_is_no_step(project):
    """A folder stands where the mask would be; what nobody numbered is no step either."""
    (project.root / "masks" / "a.png").mkdir(parents=True)
    kept = project.work / "masks" / "a.jpg"
    kept.mkdir(parents=True)
    (kept / "1x-a.png").write_text("not ours")
    with pytest.raises(OutputError, match=r"a\.png: there is a folder"):
        draw_on_mask(again(project), "a.jpg", Stroke("clear"))

    assert steps_back(project, "a.jpg") == 0
