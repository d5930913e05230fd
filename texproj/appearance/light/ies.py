"""Photometric files of lamps: IES LM-63, the versions of 1986, 1991, 1995, 2002 and 2019.

The layout is that of ANSI/IES LM-63-02, type C (and B by the same table). Own code: no kept library
reads these files.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import InputError

TYPE_C = 1
MOST_ANGLES = 10_000


@dataclass(frozen=True, eq=False)
class Profile:
    """Luminous intensity by direction.

    vertical: (v,) degrees from straight down (0) to straight up (180), rising; horizontal: (h,)
    degrees around, rising, a full turn or the part that symmetry leaves; candela: (h, v); lumens:
    of the lamp, None where the file states absolute photometry; keywords: what the file says.
    """

    vertical: Doubles
    horizontal: Doubles
    candela: Doubles
    lumens: float | None
    keywords: dict[str, str]

    def intensity(self, directions: Doubles) -> Doubles:
        """(n,) candela towards (n, 3) unit directions from the lamp: -z is straight down, x at 0
        degrees around. 0 outside of the angles that the file holds; bilinear between them.
        """
        d = np.asarray(directions, np.float64)
        down = np.degrees(np.arccos(np.clip(-d[:, 2], -1, 1)))
        around = self._folded(np.degrees(np.arctan2(d[:, 1], d[:, 0])) % 360)
        i, s = _between(self.horizontal, around)
        j, t = _between(self.vertical, down)
        c = self.candela
        low = (1 - s) * c[i, j] + s * c[np.minimum(i + 1, len(c) - 1), j]
        j1 = np.minimum(j + 1, c.shape[1] - 1)
        high = (1 - s) * c[i, j1] + s * c[np.minimum(i + 1, len(c) - 1), j1]
        held = (down >= self.vertical[0] - 1e-9) & (down <= self.vertical[-1] + 1e-9)
        return np.where(held, (1 - t) * low + t * high, 0)

    def _folded(self, around: Doubles) -> Doubles:
        """Degrees around brought into what the file holds, by its symmetry."""
        first, last = float(self.horizontal[0]), float(self.horizontal[-1])
        if len(self.horizontal) == 1:
            return np.full_like(around, first)
        if (first, last) == (0, 90):
            around = np.minimum(around, 360 - around)
            return np.minimum(around, 180 - around)
        if (first, last) == (0, 180):
            return np.minimum(around, 360 - around)
        if (first, last) == (90, 270):
            return np.where((around < 90) | (around > 270), (180 - around) % 360, around)
        return around

    @property
    def total_lumens(self) -> float:
        """Luminous flux: the integral of the intensity over the sphere, by 1 degree."""
        v, h = np.arange(0.5, 180), np.arange(0.5, 360)
        theta, phi = np.radians(np.meshgrid(v, h, indexing="ij"))
        z, across = -np.cos(theta), np.sin(theta)
        d = np.stack([across * np.cos(phi), across * np.sin(phi), z], axis=-1).reshape(-1, 3)
        solid = np.sin(theta).ravel() * np.radians(1) ** 2
        return float((self.intensity(d) * solid).sum())


def _between(knots: Doubles, at: Doubles) -> tuple[np.ndarray, Doubles]:
    """(n,) the knot below, and (n,) how far on to the next one, 0..1."""
    if len(knots) == 1:
        return np.zeros(len(at), np.intp), np.zeros(len(at))
    below = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    return below, np.clip((at - knots[below]) / (knots[below + 1] - knots[below]), 0, 1)


def ies_of_text(text: str, where: str = "the IES file") -> Profile:
    """The profile of the text of a file, which has no letters but those of Latin 1. Raises
    InputError that names `where`.
    """
    head, found, rest = text.partition("TILT=")
    if not found:
        raise InputError(f"{where}: no line TILT=; it is no IES file (LM-63)")
    tilt, _, rest = rest.partition("\n")
    numbers = _numbers(rest, where)
    if tilt.strip().upper() == "INCLUDE":
        count = _whole(numbers, 1, where)
        numbers = numbers[2 + 2 * count :]
    elif tilt.strip().upper() != "NONE":
        raise InputError(f"{where}: TILT={tilt.strip()[:40]} names another file; put NONE there")
    if len(numbers) < 13:
        raise InputError(f"{where}: the line of ten numbers after TILT= is cut short")
    lumens, factor = numbers[1], numbers[2]
    v, h = _whole(numbers, 3, where), _whole(numbers, 4, where)
    if numbers[5] != TYPE_C:
        raise InputError(f"{where}: photometric type {numbers[5]:g}; only type C (1) is read")
    factor *= numbers[10] * numbers[11]
    table = numbers[13:]
    if len(table) < v + h + v * h:
        raise InputError(
            f"{where}: {v + h + v * h} angles and values are stated, {len(table)} follow"
        )
    vertical, horizontal = np.array(table[:v]), np.array(table[v : v + h])
    candela = np.array(table[v + h : v + h + v * h]).reshape(h, v) * factor
    for name, angles in (("vertical", vertical), ("horizontal", horizontal)):
        if (np.diff(angles) <= 0).any():
            raise InputError(f"{where}: the {name} angles do not rise")
    if (candela < 0).any():
        raise InputError(f"{where}: an intensity is negative")
    words = dict(re.findall(r"^\[(\w+)\][ \t]*(.*?)\s*$", head, re.MULTILINE))
    return Profile(vertical, horizontal, candela, None if lumens < 0 else lumens, words)


def _numbers(text: str, where: str) -> list[float]:
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise InputError(f"{where}: {error}") from None
    if not np.isfinite(numbers).all():
        raise InputError(f"{where}: a number is not finite")
    return numbers


def _whole(numbers: list[float], at: int, where: str) -> int:
    value = numbers[at] if at < len(numbers) else 0.0
    if not 1 <= value <= MOST_ANGLES or value != int(value):
        raise InputError(f"{where}: {value:g} is no number of angles")
    return int(value)
