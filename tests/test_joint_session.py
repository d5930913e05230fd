"""What refinement keeps on disk."""

import numpy as np

from texproj.register.joint.gray import GrayPhoto
from texproj.register.joint.session import OnDisk


def picture(number: int, masked: bool) -> GrayPhoto:
    rng = np.random.default_rng(number)
    mask = rng.integers(0, 2, (30, 40), np.uint8) if masked else None
    return GrayPhoto(rng.integers(0, 65536, (30, 40), np.uint16), mask)


def test_values_are_made_once_and_come_back_from_disk_as_they_were():
    made: list[int] = []

    def make(number: int) -> GrayPhoto:
        made.append(number)
        return picture(number, number % 2 == 1)

    kept: OnDisk[int, GrayPhoto] = OnDisk(2)
    for number in (*range(6), *range(6), 3):
        found, true = kept.fetch(number, lambda n=number: make(n)), picture(number, number % 2 == 1)
        assert np.array_equal(found.pixels, true.pixels)
        assert (found.mask is None) == (true.mask is None)
        assert true.mask is None or np.array_equal(found.mask, true.mask)

    assert made == [0, 1, 2, 3, 4, 5]
    assert kept.fetch(3, lambda: make(3)) is kept.fetch(3, lambda: make(3))


def test_the_disk_is_given_back_with_what_kept_it():
    kept: OnDisk[int, bytes] = OnDisk(1)
    kept.fetch(0, lambda: b"x" * 10_000)
    scratch = kept._scratch

    del kept

    assert scratch._file.closed
