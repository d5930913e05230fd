"""project.toml: every key known, every value within its bounds, defaults from one place."""

import re
from dataclasses import fields

import pytest

from texproj.errors import InputError, UsageError
from texproj.options import RenderOptions, meanings
from texproj.settings import SECTIONS, read_settings


def test_an_empty_file_gives_the_defaults():
    """No key is required."""
    settings = read_settings("", "project.toml")

    assert settings.mesh is None
    assert settings.photos == "photos"
    assert settings.render == RenderOptions()


def test_an_unknown_key_names_the_nearest_known_one():
    """A misspelled key is never ignored."""
    with pytest.raises(UsageError, match=r"p\.toml: unknown key 'foto' \(did you mean 'photos'"):
        read_settings('foto = "x"', "p.toml")


def test_an_unknown_key_in_a_table_names_the_table():
    """The same inside a table."""
    with pytest.raises(UsageError, match=r"\[render\]: unknown key 'renderr' .*'renderer'"):
        read_settings('[render]\nrenderr = "gl"', "p.toml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[render]\nrenderer = "vulkan"', "renderer = 'vulkan'"),
        ("photos = 3", "photos must be a path"),
        (f'mesh = "{"m" * 300}"', "mesh = 'mmm.* is no path"),
        ("largest_photo_mp = 0", "largest_photo_mp = 0: more than 0 and at most 1000"),
        ("largest_photo_mp = 1e9", "at most 1000"),
        ("largest_photo_mp = nan", "at most 1000"),
        ("largest_photo_mp = true", "must be a number of million pixels"),
        (f"[preview]\nport = {'9' * 400}", r"port = 9{57}\.\.\."),
        ("render = 3", "render must be a table"),
    ],
)
def test_a_value_out_of_bounds_is_named(text, words):
    """Key and value stand in the sentence."""
    with pytest.raises(UsageError, match=words):
        read_settings(text, "p.toml")


def test_broken_toml_is_one_sentence():
    """The parser's own words say where."""
    with pytest.raises(InputError, match=r"p\.toml is not valid TOML: .*document"):
        read_settings("photos = ", "p.toml")


@pytest.mark.parametrize("name", sorted(SECTIONS))
def test_every_option_is_documented(name):
    """Flags take their help from the options."""
    told = meanings(SECTIONS[name])

    assert [field.name for field in fields(SECTIONS[name]) if not told.get(field.name)] == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[output]\nfaces = 1.5", "faces = 1.5: must be a list"),
        ("[color]\npreference = true", "preference = true: true is no value that it can have"),
        ("[output]\nfaces = false", "faces = false: false is no value that it can have"),
        ("[light]\nposition = [0, 0]", "position = [0, 0]: must be a list of 3 numbers"),
        (
            "[light]\nposition = [0, 0, 0, 0]",
            "position = [0, 0, 0, 0]: must be a list of 3 numbers",
        ),
        ('[color]\npreference = "always"', "preference = 'always': input should be a valid number"),
    ],
)
def test_what_is_wrong_is_told_in_words_of_the_file(text, said):
    """Not in those of the program's language."""
    with pytest.raises(
        UsageError, match=re.escape(f"p.toml [{text[1 : text.index(']')]}]: {said}")
    ):
        read_settings(text, "p.toml")


def test_what_is_meant_is_understood():
    """One value of a list that may have any length, and true and false where on and off are words;
    as quoted in docs of other programs.
    """
    text = (
        '[output]\nfaces = 5000\nmodels = "obj"\n[unwrap]\nkeep = true\n[color]\nvignetting = false'
    )
    found = read_settings(text, "p.toml")
    assert found.output.faces == (5000,)
    assert found.output.models == ("obj",)
    assert (found.unwrap.keep, found.color.vignetting) == ("on", "off")
