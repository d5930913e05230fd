"""Picks as CSV: exact, forgiving in layout, strict in content."""

import numpy as np
import pytest

from texproj.errors import InputError
from texproj.formats.correspondences import correspondences_csv, read_correspondences
from texproj.photo import Correspondences


def read(tmp_path, text):
    path = tmp_path / "0001.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_correspondences(path)


def test_columns_are_pixels_points_and_names(tmp_path):
    picks = read(tmp_path, "u,v,x,y,z,name\n10.5,20.25,1,2,3,nose\n30,40,-4,5e2,6,\n")
    np.testing.assert_array_equal(picks.xy_px, [[10.5, 20.25], [30, 40]])
    np.testing.assert_array_equal(picks.xyz_in_world, [[1, 2, 3], [-4, 500, 6]])
    assert picks.names == ("nose", "2")


def test_writing_and_reading_gives_back_every_bit(tmp_path):
    rng = np.random.default_rng(5)
    names = ("plain", 'with "quotes"', "comma, inside", "Ümläut", "", "# number", "a\tb\u2028c")
    xyz = rng.normal(size=(7, 3)) * 10.0 ** rng.integers(-9, 9, (7, 3))
    picks = Correspondences(rng.random((7, 2)) * 4000 / 3, xyz, names)
    again = read(tmp_path, correspondences_csv(picks))
    np.testing.assert_array_equal(again.xy_px, picks.xy_px)
    np.testing.assert_array_equal(again.xyz_in_world, picks.xyz_in_world)
    assert again.names == (*names[:4], "5", *names[5:])


def test_order_spaces_comments_other_columns_and_byte_order_marks_do_not_matter(tmp_path):
    text = "\ufeff# picked by hand\n Z, y ,x,weight,V,U\r\n\r\n3, 2, 1, 9, 20, 10\r\n  # end\n"
    picks = read(tmp_path, text)
    np.testing.assert_array_equal(picks.xy_px, [[10, 20]])
    np.testing.assert_array_equal(picks.xyz_in_world, [[1, 2, 3]])
    assert picks.names == ("1",)


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
def test_spreadsheets_of_any_language_are_read(tmp_path, separator, ends, encoding):
    """Semicolons and tabs with decimal commas, any line ends, Unicode with a mark."""
    lines = ["u;v;x;y;z;name", "1,5;2.25;3;4;-5,5e2;Nase, links", ""]
    picks = read(tmp_path, ends.join(lines).replace(";", separator).encode(encoding))
    np.testing.assert_array_equal(picks.xy_px, [[1.5, 2.25]])
    np.testing.assert_array_equal(picks.xyz_in_world, [[3, 4, -550]])
    assert picks.names == ("Nase, links",)


def test_names_in_the_western_code_page_are_read(tmp_path):
    assert read(tmp_path, "u,v,x,y,z,name\n1,2,3,4,5,H\u00f6he\n".encode("cp1252")).names == (
        "H\u00f6he",
    )


def test_a_header_alone_is_no_picks(tmp_path):
    assert len(read(tmp_path, "u,v,x,y,z\n")) == 0


BAD = {
    "missing column": ("u,v,x,y\n1,2,3,4\n", "column 'z' is missing"),
    "no header": ("1,2,3,4,5\n", "column 'u' is missing.*first line"),
    "text": ("u,v,x,y,z\n1,2,3,4,5\n1,2,three,4,5\n", "line 3: x = 'three' is not a finite"),
    "nan": ("u,v,x,y,z\n1,nan,3,4,5\n", "line 2: v = 'nan' is not a finite"),
    "infinite": ("u,v,x,y,z\n\n# c\n1,2,3,4,inf\n", "line 4: z = 'inf'"),
    "empty cell": ("u,v,x,y,z\n1,2,,4,5\n", "line 2: x = ''"),
    "short line": ("u,v,x,y,z\n1,2,3,4\n", r"line 2: z is missing \(the line has 4 values\)"),
    "empty": ("", "empty"),
    "only comments": ("# nothing\n", "empty"),
    "far pixel": ("u,v,x,y,z\n1,-1e8,3,4,5\n", r"line 2: v = -1e\+08 is out of bounds"),
    "far point": ("u,v,x,y,z\n1,2,3,4,1e200\n", r"line 2: z = 1e\+200 is out of bounds"),
    "other digits": ("u,v,x,y,z\n1,2,3,4,\u00b2\n", "line 2: z = '\u00b2'"),
    "underscore": ("u,v,x,y,z\n1,2,3,4,1_0\n", "line 2: z = '1_0'"),
    "thousands": ("u;v;x;y;z\n1;2;3;4;1.234,5\n", "line 2: z = '1.234,5'"),
    "long field": ("u,v,x,y,z\n1,2,3,4," + "5" * 200_000, "line 2: field larger"),
    "binary": (b"\xff\xd8\xff\xe0\x00\x10JFIF", "UTF-8"),
}


@pytest.mark.parametrize(("text", "says"), BAD.values(), ids=BAD.keys())
def test_a_bad_file_is_named_with_its_line(tmp_path, text, says):
    with pytest.raises(InputError, match=says) as error:
        read(tmp_path, text)
    assert "0001.csv" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_correspondences(tmp_path / "none.csv")


def test_the_picks_of_the_real_scenes_are_read(real_data):
    for path in (real_data("fountain-P11") / "correspondences").glob("*.csv"):
        picks = read_correspondences(path)
        assert 12 <= len(picks) <= 20
        assert picks.names[0] == "p01"
