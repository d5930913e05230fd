"""Picks as CSV: `u,v,x,y,z[,name]`, pixels from the image's corner, mesh units."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import InputError, excerpt, nearest_name
from texproj.formats.camera_bounds import MOST_TRANSLATION
from texproj.formats.documents import finite_number, read_lines
from texproj.photo import Correspondences

COLUMNS = ("u", "v", "x", "y", "z")
SEPARATORS = (",", ";", "\t")

MOST_BYTES = 64 << 20
MOST_PIXELS = 1e7
"""Distance of a pick from the image corner: fifty times the longest side of a photo."""


def read_correspondences(path: Path) -> Correspondences:
    """The picks of one photo.

    Columns in any order, `name` optional, others ignored; empty lines and lines that start with
    `#` are skipped. Columns are separated by commas, or by semicolons or tabs as spreadsheets of
    many languages do, where decimal commas count, too. Raises InputError with file and line for
    whatever is not a number of possible size.
    """
    values, names = _table(path, COLUMNS)
    return Correspondences(values[:, :2], values[:, 2:], names)


def read_pixels(path: Path) -> tuple[Doubles, Doubles, tuple[str, ...]]:
    """(n, 2) pixels, (n, 3) points and names of a file whose points may be missing: NaN. Raises
    InputError; see `read_correspondences`.
    """
    values, names = _table(path, COLUMNS[:2])
    return values[:, :2], values[:, 2:], names


def _table(path: Path, needed: Sequence[str]) -> tuple[Doubles, tuple[str, ...]]:
    """(n, 5) numbers, NaN for columns that are not there and not needed, and names of the rows."""
    lines = [(i, line) for i, line in enumerate(read_lines(path, MOST_BYTES), 1) if _content(line)]
    if not lines:
        raise InputError(f"{path}: empty; its first line must be {','.join(COLUMNS)}[,name]")
    separator = max(SEPARATORS, key=lines[0][1].count)
    rows = [_cells(f"{path}, line {i}", line, separator) for i, line in lines]
    position = _positions(path, rows[0], needed)
    values = np.full((len(lines) - 1, len(COLUMNS)), np.nan)
    told = [n for n, column in enumerate(COLUMNS) if column in position]
    for n, ((i, _), row) in enumerate(zip(lines[1:], rows[1:], strict=True)):
        where = f"{path}, line {i}"
        values[n, told] = _numbers(where, position, row, separator != ",")
    return values, _names(position, rows[1:])


def correspondences_csv(picks: Correspondences) -> str:
    """The text of a file of picks; reading it gives back every bit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*COLUMNS, "name"])
    for uv, xyz, name in zip(picks.xy_px, picks.xyz_in_world, picks.names, strict=True):
        writer.writerow([*(repr(float(value)) for value in (*uv, *xyz)), _one_line(name)])
    return text.getvalue()


def _one_line(name: str) -> str:
    return name.replace("\r", " ").replace("\n", " ")


def _cells(where: str, line: str, separator: str) -> list[str]:
    """The values of one line; a quote that is not closed ends with the line."""
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"{where}: {error}") from None


def _content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _positions(path: Path, header: list[str], needed: Sequence[str]) -> dict[str, int]:
    """Where each known column stands."""
    names = [cell.strip().lower() for cell in header]
    for column in needed:
        if column not in names:
            hint = nearest_name(column, names) if finite_number(names[0]) is None else ""
            raise InputError(
                f"{path}: column {column!r} is missing{hint};"
                f" the first line must be {','.join(COLUMNS)}[,name]"
            )
    return {name: names.index(name) for name in (*COLUMNS, "name") if name in names}


def _numbers(
    where: str, position: dict[str, int], row: list[str], decimal_commas: bool
) -> list[float]:
    values = []
    for column in (column for column in COLUMNS if column in position):
        if position[column] >= len(row):
            raise InputError(f"{where}: {column} is missing (the line has {len(row)} values)")
        cell = row[position[column]].strip()
        value = finite_number(cell.replace(",", ".") if decimal_commas else cell)
        if value is None:
            raise InputError(f"{where}: {column} = {excerpt(cell)!r} is not a finite number")
        most = MOST_PIXELS if column in "uv" else MOST_TRANSLATION
        if abs(value) > most:
            raise InputError(f"{where}: {column} = {value:g} is out of bounds (at most {most:g})")
        values.append(value)
    return values


def _names(position: dict[str, int], rows: list[list[str]]) -> tuple[str, ...]:
    """Labels of the rows; a row without one is called by its number."""
    at = position.get("name")
    cells = [row[at].strip() if at is not None and at < len(row) else "" for row in rows]
    return tuple(cell or str(i) for i, cell in enumerate(cells, 1))
