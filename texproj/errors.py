"""Everything texproj raises on purpose: one sentence that says what, where, and what to do."""

from collections.abc import Iterable
from difflib import get_close_matches


class TexprojError(Exception):
    """Base of all errors that a user can cause; its text is shown as it is, without a traceback."""


class UsageError(TexprojError):
    """A command, option or setting that cannot be used as given."""


class InputError(TexprojError):
    """A file or folder that cannot be used: missing, broken, empty or of the wrong kind."""


class RegistrationError(TexprojError):
    """A photo whose camera could not be found; the text says what to give so that it can be.

    approximate: a camera that is not certain enough to keep but good enough to start from.
    """

    def __init__(self, message: str, approximate: object = None) -> None:
        super().__init__(message)
        self.approximate = approximate


class RenderError(TexprojError):
    """No renderer, or one that failed."""


class OutputError(TexprojError):
    """A result that could not be written; what was there before is intact."""


MOST_NAMED = 40
"""Known names that one sentence lists."""


def printable(text: str) -> str:
    """Text that a terminal shows as it is, on one line: characters that could command it (escapes,
    line breaks, other controls, marks that turn the direction of writing) and bytes that are no
    UTF-8 are written as Python writes them.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def excerpt(value: object, most: int = 60) -> str:
    """What a file holds, as a sentence can show it: on one line, printable, of bounded length."""
    text = value if isinstance(value, str) else repr(value)[: 4 * most]
    text = text[: 4 * most].encode("unicode_escape").decode() if not text.isprintable() else text
    return text if len(text) <= most else f"{text[: most - 3]}..."


def nearest_name(word: str, known: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known name closest to `word`, or the list of all."""
    names = sorted(known)
    close = get_close_matches(word[:100], names, n=1, cutoff=0.5)
    if close:
        return f" (did you mean {excerpt(close[0])!r}?)"
    told = ", ".join(excerpt(name) for name in names[:MOST_NAMED])
    return f" (known: {told}{', ...' if len(names) > MOST_NAMED else ''})" if names else ""
