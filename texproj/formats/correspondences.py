"""Picks as CSV: `u,v,x,y,z[,name]`, pixels from the image's corner, mesh units."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from texproj.errors import InputError, nearest_name
from texproj.photo import Correspondences

COLUMNS = ("u", "v", "x", "y", "z")


def read_correspondences(path: Path) -> Correspondences:
    """The picks of one photo.

    Columns in any order, `name` optional, others ignored; empty lines and lines that start with
    `#` are skipped. Raises InputError with file and line for whatever is not a finite number.
    """
    try:
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    lines = [(i, line) for i, line in enumerate(text.split("\n"), 1) if _content(line)]
    if not lines:
        raise InputError(f"{path}: empty; its first line must be {','.join(COLUMNS)}[,name]")
    rows = [_cells(f"{path}, line {i}", line) for i, line in lines]
    position = _positions(path, rows[0])
    numbers = [_numbers(f"{path}, line {i}", position, row) for (i, _), row in _body(lines, rows)]
    values = np.array(numbers, np.float64).reshape(-1, 5)
    return Correspondences(values[:, :2], values[:, 2:], _names(position, rows[1:]))


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


def _cells(where: str, line: str) -> list[str]:
    """The values of one line; a quote that is not closed ends with the line."""
    try:
        return next(csv.reader([line], skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"{where}: {error}") from None


def _content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _body(
    lines: list[tuple[int, str]], rows: list[list[str]]
) -> list[tuple[tuple[int, str], list[str]]]:
    return list(zip(lines, rows, strict=True))[1:]


def _positions(path: Path, header: list[str]) -> dict[str, int]:
    """Where each known column stands."""
    names = [cell.strip().lower() for cell in header]
    for column in COLUMNS:
        if column not in names:
            hint = nearest_name(column, names) if not _is_number(names[0]) else ""
            raise InputError(
                f"{path}: column {column!r} is missing{hint};"
                f" the first line must be {','.join(COLUMNS)}[,name]"
            )
    return {name: names.index(name) for name in (*COLUMNS, "name") if name in names}


def _numbers(where: str, position: dict[str, int], row: list[str]) -> list[float]:
    values = []
    for column in COLUMNS:
        if position[column] >= len(row):
            raise InputError(f"{where}: {column} is missing (the line has {len(row)} values)")
        cell = row[position[column]].strip()
        if not _is_number(cell):
            raise InputError(f"{where}: {column} = {cell!r} is not a finite number")
        values.append(float(cell))
    return values


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isfinite(float(cell)))
    except ValueError:
        return False


def _names(position: dict[str, int], rows: list[list[str]]) -> tuple[str, ...]:
    """Labels of the rows; a row without one is called by its number."""
    at = position.get("name")
    cells = [row[at].strip() if at is not None and at < len(row) else "" for row in rows]
    return tuple(cell or str(i) for i, cell in enumerate(cells, 1))
