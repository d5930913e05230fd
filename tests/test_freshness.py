"""What is told of inputs that differ from those of a result."""

from texproj.stages.freshness import changed_inputs

BEFORE = {"mesh": "1", "a.jpg": "2", "mask of a.jpg": "3", "b.jpg": "4", "camera of b.jpg": "5"}


def test_what_belongs_to_a_photo_is_told_with_it():
    """One that is left out is called so, once; one that is gone otherwise is gone."""
    record = {"inputs": BEFORE}

    assert changed_inputs(record, BEFORE) == ""
    assert changed_inputs(record, {"mesh": "1"}, ["b.jpg"]) == "a.jpg is gone; left out: b.jpg"
    assert changed_inputs({"inputs": {"mesh": "0"}}, BEFORE) == (
        "mesh changed; a.jpg is new; b.jpg is new"
    )
    assert changed_inputs(record, {**BEFORE, "mask of a.jpg": "none"}) == "mask of a.jpg changed"
    without = {name: told for name, told in BEFORE.items() if name != "mask of a.jpg"}
    assert changed_inputs(record, without, ["c.jpg"]) == "mask of a.jpg is gone"
