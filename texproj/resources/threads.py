"""Ways to use more than one processor: numpy and OpenCV leave the interpreter's lock alone."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
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


def ahead(make: Callable[[int], T], count: int, most: int = 1) -> Iterator[T]:
    """make(0), make(1), ...; made in a thread, at most so many before they are used, the first
    from now on.
    """
    pool = ThreadPoolExecutor(1)
    coming = deque(pool.submit(make, number) for number in range(min(most, count)))

    def each() -> Iterator[T]:
        following = iter(range(len(coming), count))
        try:
            while coming:
                made = coming.popleft().result()
                coming.extend(pool.submit(make, number) for number in islice(following, 1))
                yield made
                del made
        finally:
            pool.shutdown(cancel_futures=True)

    return each()
