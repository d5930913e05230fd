"""The one place where a photo is attended: whatever nobody foresaw in one is its failure alone."""

from __future__ import annotations

import errno
import logging
from collections.abc import Callable
from typing import TypeVar

from texproj.errors import InputError, TexprojError
from texproj.stages.progress import Cancelled

LOG = logging.getLogger("texproj")
LOG.addHandler(logging.NullHandler())  # a traceback is for the log, whether there is one or not

INTERNAL = "internal fault, please report; details in work/log/texproj.log"
NO_MEMORY = "not enough memory for this photo; close other programs, or use a smaller copy of it"

NO_PLACE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""There is no room to write, which is no photo's fault."""
CV2_NO_MEMORY = -4
"""cv2.Error.StsNoMem; OpenCV has its own exception for it."""

T = TypeVar("T")


class PhotoFaultError(InputError):
    """A photo that failed in a way nobody foresaw; the log has the traceback."""


def attended(name: str, work: Callable[[], T]) -> T:
    """What `work` makes of photo `name`.

    Raises PhotoFaultError, with a sentence for people, for whatever nobody foresaw. What was
    foreseen (TexprojError), what concerns the whole run, and the wish to stop pass through.
    """
    try:
        return work()
    except (TexprojError, Cancelled):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno in NO_PLACE:
            raise
        scarce = isinstance(error, MemoryError) or getattr(error, "code", None) == CV2_NO_MEMORY
        LOG.exception("%s: %s", name, "out of memory" if scarce else "internal fault")
        raise PhotoFaultError(NO_MEMORY if scarce else INTERNAL) from error
