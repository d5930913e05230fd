"""The command that tells a flash from a lens."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
from cyclopts import Parameter

from texproj.cli import talk
from texproj.cli.exits import DONE
from texproj.cli.runner import run_stage
from texproj.cli.shared import Folder, Json, Verbose, project_at_work
from texproj.errors import OutputError, UsageError


def calibrate_flash(
    folder: Folder,
    /,
    *,
    wall: Annotated[
        Path | None, Parameter(help="Folder of photos of a white wall with the board on it.")
    ] = None,
    square: Annotated[
        float | None, Parameter(help="Edge of the board's squares, in units of the scan.")
    ] = None,
    reflectance: Annotated[
        float | None, Parameter(help="Of the wall, photographed like the piece: absolute colors.")
    ] = None,
    board: Annotated[
        Path | None, Parameter(help="Write the board's picture (png), to print.")
    ] = None,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Tell the flash from the lens by photos of a white wall: writes flash.json.

    Example: texproj calibrate-flash statue --wall wall/ --square 0.03
    """
    from texproj.stages.calibrating import board_picture, calibrate_flash  # noqa: PLC0415

    if board is not None:
        if board.suffix.lower() != ".png":
            raise UsageError(f"--board {board}: it is written as png")
        if not cv2.imwrite(str(board), board_picture()):
            raise OutputError(f"{board} cannot be written")
        talk.say(f"wrote {board}: print it, put it flat on a white wall, measure a square")
        if wall is None:
            return DONE
    if wall is None or square is None:
        raise UsageError("give --wall, the folder of photos, and --square, the edge of a square")
    if not 0 < square < float("inf"):
        raise UsageError(f"--square {square} is no length")
    if reflectance is not None and not 0 < reflectance <= 1:
        raise UsageError(f"--reflectance {reflectance} is not between 0 and 1")
    with project_at_work(folder, None, verbose, "calibrate-flash") as project:
        return run_stage(
            project, json,
            lambda bench, _: calibrate_flash(bench.project, wall, square, reflectance),
        )  # fmt: skip
