"""Broken inputs from sound ones, and the claim that every reader makes about them.

A test takes a strategy of this module and gives each input to `refused_or_read`:

    @given(broken_text(SEEDS))
    def test_picks(tmp_path_factory, data): refused_or_read(read_correspondences, path, data)
"""

import contextlib
import copy
import faulthandler
import json
import re
import resource
import signal
import time
from collections import Counter

from hypothesis import strategies as st

from texproj.errors import TexprojError

MOST_SECONDS = 30
MOST_BYTES = 2 << 30
INPUTS = Counter()
"""Inputs tried, by the name of what took them; told at the end of a run."""

ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e200", "1e12", "1e-320", "1e-308", "5e-324",
    "0", "-0", "-1", "1", "-", "", '"', "0x10", "1_0", "1,5", "true", "\u00b2", "\u0661",
    "2147483647", "2147483648", "4294967295", "1000000000000", "18446744073709551616",
    "9" * 400, "9" * 5000, "x" * 3000,
)  # fmt: skip
ODD_VALUES = (
    None, True, False, 0, 1, -1, 5, 0.5, 2**31, 2**63, 10**30, 10**400, -1e12,
    1e308, 1e200, 1e-320, float("nan"), float("inf"),
    "", "1", "\u00b2", "x", "a/b", "../a", "x" * 300, "\0", "\ud800",
    [], {}, [[]], [1], [None], [1, 2, 3], ["x"], {"a": 1},
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1e308] * 3] * 3,
)  # fmt: skip
ODD_BYTES = (
    b"", b"\0", b"\xff", b"\r", b"\n", b"\r\n", b"\xef\xbb\xbf", b"\xff\xfe", b"#", b";",
    b"\0" * 64, b"\xff" * 8, b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\x80\0\0\0", b"\x01\0", b"\0\x01",
    b"[" * 3000, b"<a>" * 3000, b"A" * 3000,
)  # fmt: skip
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


@st.composite
def broken_bytes(draw, seeds, most=4):
    """One of the sound files with up to `most` things wrong: cut, removed, doubled, overwritten."""
    data = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(1, most))):
        at = draw(st.integers(0, len(data)))
        kind = draw(st.sampled_from(("cut", "remove", "insert", "overwrite", "double", "bit")))
        size = draw(st.integers(1, max(1, min(64, len(data)))))
        odd = draw(st.sampled_from(ODD_BYTES) | st.binary(max_size=8))
        if kind == "cut":
            data = data[:at]
        elif kind == "remove":
            data = data[:at] + data[at + size :]
        elif kind == "insert":
            data = data[:at] + odd + data[at:]
        elif kind == "overwrite":
            data = data[:at] + odd + data[at + len(odd) :]
        elif kind == "double":
            data = data[: at + size] + data[at:]
        elif at < len(data):
            data = data[:at] + bytes([data[at] ^ (1 << size % 8)]) + data[at + 1 :]
    return data


@st.composite
def broken_text(draw, seeds):
    """One of the sound texts with odd numbers in place of some, then maybe broken as bytes, then
    in one of the encodings that programs write.
    """
    text = draw(st.sampled_from(seeds))
    for _ in range(draw(st.integers(0, 3))):
        spans = [m.span() for m in _NUMBER.finditer(text)]
        if spans:
            start, end = draw(st.sampled_from(spans))
            text = text[:start] + draw(st.sampled_from(ODD_NUMBERS)) + text[end:]
    encoding = draw(st.sampled_from(("utf-8",) * 5 + ("utf-8-sig", "utf-16", "utf-16-le", "utf-7")))
    ends = draw(st.sampled_from(("\n",) * 3 + ("\r\n", "\r", "\n\n")))
    data = text.replace("\n", ends).encode(encoding)
    return draw(broken_bytes([data], most=2)) if draw(st.booleans()) else data


@st.composite
def broken_value(draw, seeds):
    """One of the sound JSON values with odd ones in place of some nodes, some absent or doubled."""
    value = copy.deepcopy(draw(st.sampled_from(seeds)))
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(value))
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        kind = draw(st.sampled_from(("odd", "odd", "odd", "absent", "other", "deep")))
        if kind == "odd":
            holder[key] = copy.deepcopy(draw(st.sampled_from(ODD_VALUES)))
        elif kind == "absent":
            del holder[key]
        elif kind == "other":
            other, place = draw(st.sampled_from(places))
            with contextlib.suppress(KeyError, IndexError):
                holder[key] = copy.deepcopy(other[place])
        else:
            for _ in range(draw(st.sampled_from((3, 90, 400)))):
                holder[key] = [holder[key]]
    return value


@st.composite
def broken_json(draw, seeds):
    """The text of a `broken_value`, maybe broken as bytes, too."""
    data = json.dumps(draw(broken_value(seeds))).encode()
    return draw(broken_bytes([data], most=2)) if draw(st.integers(0, 3)) == 0 else data


def _places(value):
    """Each (holder, key) of a JSON value."""
    stack = [value]
    while stack:
        holder = stack.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            yield holder, key
            if isinstance(holder[key], dict | list):
                stack.append(holder[key])


def refused_or_read(read, path, data, name=None):
    """Write `data` to `path` and read it: what `read(path)` returns, None where it refuses.

    Fails for any exception but texproj's own, for a refusal that is not one sentence on one line
    of readable length, past 30 seconds, and past 2 GB of memory.
    """
    path.write_bytes(data)
    INPUTS[name or read.__name__] += 1
    with bounded():
        try:
            return read(path)
        except TexprojError as error:
            told = str(error)
            assert told.strip(), "a refusal without a word"
            assert "\n" not in told and "\r" not in told, f"a refusal of several lines: {told!r}"
            assert len(told) < 1000, f"a refusal of {len(told)} characters: {told[:300]!r}"
            told.encode()
    return None


@contextlib.contextmanager
def bounded(seconds=MOST_SECONDS, most_bytes=MOST_BYTES):
    """The block within a time and a growth of memory; a hang in foreign code ends the process."""

    def late(*_):
        raise AssertionError(f"longer than {seconds} s")

    before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
    old = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    faulthandler.dump_traceback_later(3 * seconds, exit=True)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, old)
        faulthandler.cancel_dump_traceback_later()
    assert time.monotonic() - start < seconds, f"longer than {seconds} s"
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    assert grown < most_bytes, f"took {grown / 1e9:.1f} GB"
