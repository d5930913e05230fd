"""The command that shows the recovered surface in another light."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from texproj.cli.runner import run_stage
from texproj.cli.shared import Folder, Json, Verbose, project_at_work
from texproj.errors import UsageError

if TYPE_CHECKING:
    from texproj.stages.relighting import Place

AGAIN = "May be given again."


@dataclass(frozen=True)
class RelightFlags:
    """Flags of `relight`."""

    sun: Annotated[
        tuple[str, ...],
        Parameter(
            help="HEADING,HEIGHT of a sun in degrees: 0,45 comes from behind the viewer, 90,8"
            f" rakes from the right. {AGAIN}",
            negative="", show_default=False, allow_leading_hyphen=True,
        ),
    ] = ()  # fmt: skip
    lamp: Annotated[
        tuple[str, ...],
        Parameter(
            help="HEADING,HEIGHT,DISTANCE of a lamp; the distance in diagonals of the piece's box."
            f" {AGAIN}",
            negative="", show_default=False, allow_leading_hyphen=True,
        ),
    ] = ()  # fmt: skip
    sky: Annotated[
        str | None,
        Parameter(
            help="overcast, none, photographed (the light that `appearance` found), or a picture"
            " of all directions: .hdr, .exr. [default: overcast, none with lamps alone]"
        ),
    ] = None
    kelvin: Annotated[
        float | None,
        Parameter(help="Color of suns and lamps: 2700 is a bulb, 5500 the sun. [default: white]"),
    ] = None
    ev: Annotated[
        float | None,
        Parameter(
            help="Exposure at ISO 100. [default: as a camera meters; as the photos were, in their"
            " light alone]"
        ),
    ] = None
    tone: Annotated[
        Literal["none", "reinhard", "filmic", "aces"] | None,
        Parameter(
            help="The curve from light to what a screen shows. [default: filmic; none in the"
            " photos' light alone]"
        ),
    ] = None
    photo: Annotated[
        str | None, Parameter(help="Look from where this photo was taken. [default: the front]")
    ] = None
    film: Annotated[
        Literal["webp", "gif", "png"] | None,
        Parameter(help="A turntable in that light. [default: one picture]"),
    ] = None
    lens: Annotated[
        float | None,
        Parameter(
            help="f-number of a full-frame lens, 2.8 say: what is nearer or farther is blurred,"
            " corners are darker; the scan's unit is [output] `unit`. [default: all is sharp]"
        ),
    ] = None
    traced: Annotated[
        bool,
        Parameter(
            help="Draw by the path tracer Mitsuba (pip install mitsuba), which takes minutes.",
            negative="",
        ),
    ] = False
    size: Annotated[int, Parameter(help="Longer side, pixels.")] = 1024


NOTHING_ASKED = RelightFlags()


def relight(
    folder: Folder,
    /,
    *,
    flags: Annotated[RelightFlags, Parameter(name="*")] = NOTHING_ASKED,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Show the recovered surface in another light: out/relit.png, or a film.

    Example: texproj relight statue --sun 85,10 --sky none
    """
    from texproj.stages.relighting import RelightOptions, relight_project  # noqa: PLC0415
    from texproj.stages.turning import TurntableOptions  # noqa: PLC0415

    options = RelightOptions(
        tuple(_place(text, "--sun", 2) for text in flags.sun),
        tuple(_place(text, "--lamp", 3) for text in flags.lamp),
        flags.sky, flags.kelvin, flags.ev, flags.tone, flags.photo, flags.film, flags.lens,
        flags.traced, TurntableOptions(size=flags.size),
    )  # fmt: skip
    with project_at_work(folder, None, verbose, "relight") as project:
        return run_stage(project, json, lambda bench, tell: relight_project(bench, options, tell))


def _place(text: str, flag: str, count: int) -> Place:
    """Where a light is, from the numbers of a flag. Raises UsageError."""
    from texproj.stages.relighting import Place  # noqa: PLC0415

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        wanted = "HEADING,HEIGHT" + (",DISTANCE" if count == 3 else "")
        raise UsageError(f"{flag} {text} is not {wanted}, numbers with a comma between")
    return Place(*numbers)
