"""Text, JSON and XML of any hand end in a value or in one sentence."""

from fuzzing import broken_bytes, broken_json, broken_text, refused_or_read
from hypothesis import given

from texproj.formats.documents import read_json, read_text, read_xml

TEXTS = ("u,v,x,y,z\n1,2,3,4,5\n", "a\u00e9\u4e2d 1 2\r\n", "")
VALUES = ({"a": [1, 2.5, {"b": "c"}], "d": None}, [[], [[]]])
XML = (
    b'<?xml version="1.0" encoding="UTF-8"?><a b="1"><c>2 3</c><!-- d --></a>',
    b'<!DOCTYPE a [<!ENTITY e "1">]><a>&e;</a>',
)


@given(broken_text(TEXTS))
def test_text(place, data):
    """Whatever its encoding and line ends."""
    text = refused_or_read(read_text, place / "a.txt", data)
    assert text is None or not {"\r", "\0"} & set(text)


@given(broken_json(VALUES))
def test_json(place, data):
    """Whatever is nested how deeply, with numbers of any length."""
    refused_or_read(read_json, place / "a.json", data)


@given(broken_bytes(XML))
def test_xml(place, data):
    """Whatever its encoding and entities."""
    refused_or_read(read_xml, place / "a.xml", data)
