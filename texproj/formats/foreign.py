"""Parsers of other hands, which throw on broken input whatever their authors did not foresee."""

from __future__ import annotations

import contextlib
import logging
import re
import struct
from collections.abc import Iterator

from texproj.errors import TexprojError

logger = logging.getLogger("texproj")

_PLACE_IN_SOURCE = re.compile(r"^OpenCV\([^)]*\) \S+ error: |> in function .*$", re.DOTALL)
NO_REASON = "its structure is broken"
_OUT_OF_MEMORY = -4
"""Code of OpenCV's errors, StsNoMem."""


GUESSER = "charset_normalizer"
"""What trimesh asks for only where a text is not UTF-8, which glTF and all that we read demand."""


class Broken(Exception):  # noqa: N818 - every caller makes a sentence of it
    """A file that a parser could not read; its text says why, on one line of 100 characters."""


@contextlib.contextmanager
def foreign_parser() -> Iterator[None]:
    """A block that reads by a parser of another package; what that throws is `Broken`.

    Pillow, tifffile, trimesh, plyfile and OpenCV document none of the exceptions of ten kinds
    that they throw on spoiled files, so all are caught, here and nowhere else, and logged with
    their traceback. Out of memory and a package that is not installed are not
    among them: those are no faults of the file's.
    """
    try:
        yield
    except (TexprojError, MemoryError, Broken):
        raise
    except ModuleNotFoundError as error:
        if error.name != GUESSER:
            raise
        raise Broken("its text is not UTF-8") from None
    except Exception as error:
        if getattr(error, "code", None) == _OUT_OF_MEMORY:
            raise MemoryError from None
        logger.debug("a parser failed", exc_info=True)
        reason = " ".join(_PLACE_IN_SOURCE.sub("", str(error)).split())[:100]
        meaningless = isinstance(error, LookupError | TypeError | AttributeError | struct.error)
        raise Broken(NO_REASON if meaningless or not reason else reason) from None
