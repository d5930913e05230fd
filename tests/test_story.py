"""The sentence that tells what a run made of the photos."""

from texproj.records import CameraRecord
from texproj.stages.outcomes import PhotoOutcome
from texproj.stages.story import story


def photo(name, status, method=None, **quality):
    record = CameraRecord(name, 60, 40, None, None, status, method, quality)
    return PhotoOutcome(name, record, False, quality.get("reason", ""))


PLACED = [
    photo(f"{k}.jpg", "registered", "block", support=0.874, rival=0.03, expected_error_px=0.6 + k)
    for k in range(3)
]


def test_a_block_and_what_it_lacks_in_one_sentence():
    """How many, how sure, how exact; each photo that is left out by name, with why, without what
    to do, which stands in its own line.
    """
    reasons = {"7.jpg": "7.jpg: is too blurred; leave it out", "9.jpg": "shows a sky (pick points)"}
    told = story([*PLACED, photo("7.jpg", "failed"), photo("9.jpg", "failed")], True, reasons)

    assert told == (
        "3 photos overlap; placed as one block on the scan (structure 87%, next best place 3%); "
        "refined to 1.6 px; 2 photos left out: 7.jpg (is too blurred), 9.jpg (shows a sky)"
    )


def test_photos_found_by_other_means_are_counted():
    """By method; nothing is said of a refinement that was not done, or of photos left out if none
    was.
    """
    photos = [photo("a", "registered", "points"), photo("b", "registered", "features")]
    photos.append(photo("c", "registered", "features"))

    assert story(photos, False, {}) == "1 found by points, 2 found by features"


def test_photos_held_by_others_tell_no_rival():
    """There was no other place to compare with."""
    held = [photo("a", "registered", "block", through=["b"])]
    assert story(held, False, {}).endswith("placed as one block on the scan (held by b)")


def test_what_others_do_not_bear_out_is_named():
    """It is registered, so it is in no list of failures."""
    told = story([photo("a", "registered", "import", not_borne_out=True)], False, {})
    assert told == "1 found by import; other photos do not bear out a"


def test_a_thousand_photos_left_out_make_no_endless_line():
    """The first are named, the others counted; nothing at all where there is nothing to tell."""
    told = story([], False, {"x.jpg": "blurred"} | {f"{k}.jpg": "damaged" for k in range(999)})

    assert told.startswith("1000 photos left out: x.jpg (blurred), 0.jpg, 1.jpg, ")
    assert told.endswith("7.jpg and 991 more (damaged)")
    assert story([], False, {}) == ""
