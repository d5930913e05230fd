"""How long work tells how far it is, and how it is stopped."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int, str], None]
"""``progress(stage, done, total, item)``; whoever listens may raise Cancelled to stop the work."""


class Cancelled(Exception):  # noqa: N818 - not an error: somebody asked for it
    """The work was stopped on request; what was finished before is kept."""


def silent(stage: str, done: int, total: int, item: str) -> None:
    """Nobody listens."""
