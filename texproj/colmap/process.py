"""The process that runs COLMAP: its calls block, signals abort it, and a fault of its ends no more
than this process. Started as a module; messages come on standard input and go to standard output.
"""

from __future__ import annotations

import os
import sys
import threading
import traceback
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import IO, Any

import numpy as np

from texproj.colmap.database import FeatureStore
from texproj.colmap.mapping import mapped
from texproj.colmap.messages import (
    Awaited,
    Failed,
    Features,
    Picture,
    Result,
    Task,
    Told,
    Wanted,
    receive,
    send,
)
from texproj.colmap.work import features_of

BATCH = 24
"""Pairs that are matched between two reports: what is lost when the work is stopped. With half as
many it takes a sixth longer, since descriptors are indexed for each batch."""
WAITING = 2
"""Pictures that may wait; the others stay where they come from."""

Pair = tuple[str, str]


def main() -> None:
    """Serve one task."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever COLMAP prints goes where errors go
    try:
        _serve(_inbox(sys.stdin.buffer), out)
    except MemoryError:
        send(out, Failed("not enough memory to compare the photos; close other programs"))
    except Exception as error:  # noqa: BLE001 - the parent is told, whatever it is
        traceback.print_exc()
        send(out, Failed(f"the photos could not be compared ({type(error).__name__}: {error})"))


def _inbox(stream: IO[bytes]) -> Queue[Any]:
    """What comes in. When it ends nobody waits for the result any more, and neither does this."""
    inbox: Queue[Any] = Queue(WAITING)

    def hear() -> None:
        while (message := receive(stream)) is not None:
            inbox.put(message)
        os._exit(1)

    threading.Thread(target=hear, daemon=True).start()
    return inbox


def _serve(inbox: Queue[Any], out: IO[bytes]) -> None:
    task: Task = inbox.get()
    with FeatureStore(task) as store:
        lacking = tuple(key for key in task.keys if not store.has_features(key))
        send(out, Wanted(lacking))
        _extract(store, _pictures(inbox), len(lacking), task.threads, out)
        pairs = store.chosen_pairs()
        calibrated = store.calibrated_cameras()
        fresh = [pair for pair in pairs if not store.was_matched(*pair)]
    if task.ahead:
        _match_elsewhere(task, fresh, inbox, out)
    else:
        _match(store, fresh, Path(task.scratch) / "pairs.txt", out)

    def told(placed: int) -> None:
        send(out, Told("placing", placed, len(task.keys)))

    told(0)
    models = mapped(task, calibrated, told)
    with FeatureStore(task) as store:
        send(out, Result(models, *store.verified(pairs)))


def _match(store: FeatureStore, pairs: Sequence[Pair], file: Path, out: IO[bytes]) -> None:
    for start in range(0, len(pairs), BATCH):
        send(out, Told("matching", start, len(pairs)))
        store.match(pairs[start : start + BATCH], file)


def _match_elsewhere(task: Task, pairs: Sequence[Pair], inbox: Queue[Any], out: IO[bytes]) -> None:
    """Have pairs matched by whoever listens, as many batches at once as the task allows."""
    starts = range(0, len(pairs), BATCH)
    sent = 0
    with FeatureStore(task) as store:
        for done, at in enumerate(starts):
            for start in starts[sent : done + task.ahead]:
                send(out, store.batch(pairs[start : start + BATCH]))
                sent += 1
            send(out, Told("matching", at, len(pairs)))
            send(out, Awaited())
            for match in inbox.get().matches:
                store.save_match(match)


def _pictures(inbox: Queue[Any]) -> Iterator[Picture | Features]:
    while isinstance(message := inbox.get(), Picture | Features):
        yield message


def _extract(
    store: FeatureStore,
    coming_in: Iterator[Picture | Features],
    count: int,
    threads: int,
    out: IO[bytes],
) -> None:
    """Find and keep the features of pictures as they come; keep those that were found elsewhere."""
    coming: deque[Future[Features]] = deque()
    done = 0

    def keep(found: Features) -> None:
        nonlocal done
        store.save_features(found)
        done += 1
        send(out, Told("features", done, count))

    with ThreadPoolExecutor(threads) as pool:
        for message in coming_in:
            if isinstance(message, Features):
                keep(message)
                continue
            coming.append(pool.submit(features_of, message))
            if len(coming) > threads:
                keep(coming.popleft().result())
        while coming:
            keep(coming.popleft().result())


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
