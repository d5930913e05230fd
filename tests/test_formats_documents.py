"""Text, JSON and XML: what is read, and which sentence refuses the rest."""

import math
import os

import pytest

from texproj.errors import InputError, excerpt
from texproj.formats.documents import (
    MOST_NESTED,
    finite_number,
    json_of,
    read_bytes,
    read_lines,
    text_of,
    xml_of,
)
from texproj.formats.foreign import Broken, foreign_parser


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "cp1252"])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_text_of_every_encoding_and_line_end(tmp_path, encoding, ends):
    """The same lines come out."""
    (tmp_path / "a.txt").write_bytes(ends.join(["Höhe 1", "", "x"]).encode(encoding))
    assert read_lines(tmp_path / "a.txt") == ["Höhe 1", "", "x"]


@pytest.mark.parametrize("data", [b"a\0b", "a".encode("utf-16-le"), b"\x81\x8d", b"\xff\xfea"])
def test_what_is_no_text_is_refused(data):
    """Zero bytes, UTF-16 without its mark, undefined characters, half a character."""
    with pytest.raises(InputError, match=r"a\.txt: not a text file in UTF-8"):
        text_of(data, "a.txt")


def test_only_files_of_bounded_size_are_read(tmp_path):
    """A folder, a pipe (which would wait for ever), a missing and a large file are named."""
    (tmp_path / "large").write_bytes(b"12345")
    assert read_bytes(tmp_path / "large", most=5) == b"12345"
    os.mkfifo(tmp_path / "pipe")
    for name, says in {
        "large": "larger than", ".": "not a file", "pipe": "not a file", "x": "cannot be read",
        "a\0b": "cannot be read",
    }.items():  # fmt: skip
        with pytest.raises(InputError, match=says):
            read_bytes(tmp_path / name, most=4)


NUMBERS = {
    "1": 1.0, " -2.5 ": -2.5, "+.5": 0.5, "1e3": 1000.0, "7.": 7.0, "1E-3": 0.001,
    "1e999": None, "nan": None, "inf": None, "1_0": None, "²": None, "١": None, "0x1": None,
    "": None, "1,5": None, "1 2": None, "--1": None, "e5": None,
}  # fmt: skip


@pytest.mark.parametrize("word", NUMBERS)
def test_numbers_are_what_every_program_takes_for_one(word):
    """No digits of other scripts, no underscores, nothing that is not finite."""
    assert finite_number(word) == NUMBERS[word]


def test_json_keeps_values_and_bounds_integers():
    """Twenty digits stay an integer, 5000 become a float; NaN is left to who reads a number."""
    assert json_of('{"a": [1, 2.5, null, "\\ud83d\\ude00"]}', "x") == {"a": [1, 2.5, None, "😀"]}
    assert json_of("18446744073709551616", "x") == 2**64
    assert json_of("9" * 5000, "x") == math.inf
    assert math.isnan(json_of("NaN", "x"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"a":\n 1,}', "a.json, line 2: not JSON"),
        ("[" * 200_000, "nested more than 100"),
        ("[" * 200_000 + "]" * 200_000, "nested more than 100"),
        ("[" * (MOST_NESTED + 1) + "]" * (MOST_NESTED + 1), "nested more than 100"),
        ('["\\ud800"]', "half of a character"),
        (b"\xe4", "UTF-8"),
        (b"", "not JSON"),
    ],
)
def test_json_that_cannot_be_is_one_sentence(text, says):
    with pytest.raises(InputError, match=says) as error:
        json_of(text, "a.json")
    assert "\n" not in str(error.value)


def test_the_deepest_json_that_is_read():
    value = json_of("[" * MOST_NESTED + "]" * MOST_NESTED, "x")
    for _ in range(MOST_NESTED - 1):
        (value,) = value
    assert value == []


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"<a>", "not XML"),
        (b"", "not XML"),
        (b'<?xml version="1.0" encoding="foo"?><a/>', "encoding cannot be read"),
        (b'<?xml version="1.0" encoding="shift_jis"?><a/>', "encoding cannot be read"),
        (b"<a>" * 5000 + b"</a>" * 5000, "nested more than 100"),
        (b'<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]><a>&x;</a>', "not XML"),
        (
            b'<!DOCTYPE a [<!ENTITY b "bbbbbbbbbb">'
            + b"".join(b'<!ENTITY %c "%s">' % (99 + i, b"&%c;" % (98 + i) * 30) for i in range(8))
            + b"]><a>&j;</a>",
            "not XML",
        ),
    ],
)
def test_xml_that_cannot_be_is_one_sentence(data, says):
    """Entities neither open files nor multiply."""
    with pytest.raises(InputError, match=says):
        xml_of(data, "a.xml")


def test_xml_in_utf_16_is_read():
    assert xml_of("<?xml version='1.0'?><a b='é'/>".encode("utf-16"), "x").get("b") == "é"


def test_what_a_foreign_parser_throws_is_broken_but_for_lack_of_memory():
    """A file is never called damaged where memory ran out, nor by an error that has no words."""
    with pytest.raises(Broken, match=r"^a b$"), foreign_parser():
        raise ValueError("a\n b")
    with pytest.raises(Broken, match="structure"), foreign_parser():
        raise KeyError(7)
    with pytest.raises(MemoryError), foreign_parser():
        raise MemoryError
    with pytest.raises(InputError, match="own"), foreign_parser():
        raise InputError("own")


def test_excerpts_are_one_short_line():
    """Whatever a file holds where a name should be."""
    assert excerpt("abc") == "abc"
    assert excerpt("a\nb\ud800") == "a\\nb\\ud800"
    assert len(excerpt(["x" * 1000] * 1000)) == 60
