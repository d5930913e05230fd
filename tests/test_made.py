"""A record in work/ that is not of its stage's shape is as none: the stage runs again."""

import json

import pytest

from texproj.project import Project
from texproj.stages.partners import companions, content_key, load_graph

WHOLE = {"inputs": {}, "outputs": {}, "used": [], "failed": {}, "quality": {}, "occluders": {}}


def project_of(root, stage, record):
    (root / "photos").mkdir()
    (root / "photos" / "a.jpg").write_bytes(b"x")
    (root / "photos" / "b.jpg").write_bytes(b"y")
    path = root / "work" / f"{stage}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record))
    return Project.open(root)


@pytest.mark.parametrize(
    "change", [{}, {"outputs": 5}, {"used": {}}, {"quality": None}, {"inputs": []}, {"failed": "x"}]
)
def test_what_is_not_of_the_shape_is_as_none(tmp_path, change):
    """A whole record is read; with one key of another kind it is not, nor without it."""
    found = project_of(tmp_path, "color", WHOLE | change).load_record("color")

    assert found == (None if change else WHOLE)
    for key in change:
        less = {name: value for name, value in WHOLE.items() if name != key}
        (tmp_path / "work" / "color.json").write_text(json.dumps(less))
        assert Project.open(tmp_path).load_record("color") is None


@pytest.mark.parametrize(
    "told", [3, "ab", [3], [["a.jpg"]], [["a.jpg", "b.jpg", "x"]], [[[], 1, 2]]]
)
def test_of_pairs_only_what_can_be_is_read(tmp_path, told):
    """What was matched between photos, and how alike they look."""
    project = project_of(tmp_path, "block/graph", {})
    keys = {name: content_key(project, name) for name in ("a.jpg", "b.jpg")}
    for name, key in (("graph", "pairs"), ("alike", "alike")):
        value = told if key == "pairs" else {"a.jpg": told}
        path = tmp_path / "work" / "block" / f"{name}.json"
        path.write_text(json.dumps({"inputs": keys, key: value}))

    assert load_graph(Project.open(tmp_path)).matches == {}
    assert companions(Project.open(tmp_path)) == {}
