"""What each photo's light needs so that all agree."""

from __future__ import annotations

from dataclasses import dataclass

from texproj.color.corrections import Correction
from texproj.color.gains import Gains, no_gains, solve_gains
from texproj.color.survey import Survey
from texproj.options import ColorOptions


@dataclass(frozen=True, eq=False)
class Photometry:
    """The corrections of all photos, and what the report says of them."""

    corrections: tuple[Correction, ...]
    gains: Gains


def solve_photometry(survey: Survey, options: ColorOptions) -> Photometry:
    """Corrections of light from what the photos say about the same points."""
    gains = solve_gains(survey) if options.gains else no_gains(len(survey.shots))
    return Photometry(tuple(Correction(gain) for gain in gains.factor), gains)
