"""Ways to use more than one processor: numpy and OpenCV leave the interpreter's lock alone."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import cv2

T = TypeVar("T")


@contextmanager
def opencv_in_one_thread() -> Iterator[None]:
    """OpenCV leaves the processors to the threads here meanwhile: a twentieth less time."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def in_parallel(work: Callable[[int], None], numbers: Iterable[int]) -> None:
    """Call `work` in threads; the first exception is raised."""
    with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
        for _ in pool.map(work, numbers):
            pass


def ahead(make: Callable[[int], T], count: int) -> Iterator[T]:
    """make(0), make(1), ...; one is made in a thread while the one before is used, the first from
    now on.
    """
    pool = ThreadPoolExecutor(1)
    first = pool.submit(make, 0) if count else None

    def each() -> Iterator[T]:
        following = first
        with pool:
            for number in range(count):
                assert following is not None
                made = following.result()
                if number + 1 < count:
                    following = pool.submit(make, number + 1)
                yield made
                del made

    return each()
