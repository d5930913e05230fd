"""A photo for which a single registered one vouches: do the mesh's edges bear it out?

Two photos agree with each other through the mesh even where both are far off: of a facade whose
one camera is 5 % of the width off, 70 to 78 % of the patches agree with the photo that was found
through it. So edges are asked; where they do not tell, the other photo must be picked or borne out
by edges itself. Method: ours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texproj.arrays import Doubles
from texproj.errors import RegistrationError
from texproj.options import StructureOptions
from texproj.photo import Photo
from texproj.records import CameraRecord, Fit
from texproj.register.motion import motion_px
from texproj.register.structure.register import register_structure
from texproj.register.structure.verdict import MIN_SUPPORT
from texproj.render import Render
from texproj.stages.outcomes import CONTRADICTED

APART, LEAST_APART_PERCENT = 3.0, 0.3
"""Standard deviations, and percent of the width, beyond which edges and witness disagree."""


def borne_out(
    fit: Fit,
    witness: CameraRecord,
    photo: Photo,
    render: Render,
    options: StructureOptions,
    surface: Doubles,
) -> Fit:
    """The fit of a photo that was found through `witness` alone, if edges bear it out, or cannot
    tell and something else proves the witness; else not accepted, with the reason.

    photo: reduced; render: as for `register_structure`; surface: (n, 3) points of the mesh, world.
    """
    by_edges = _by_edges(fit, photo, render, options)
    if by_edges is None:
        if _proven(witness):
            return fit
        return _refused(
            fit,
            f"only {witness.file} shows the same, and the mesh's edges do not bear it out; "
            "pick 8 points in one of the two",
        )
    shown = surface[fit.camera.inside(fit.camera.project(surface)[0])]
    apart = motion_px(by_edges.camera, fit.camera, shown)
    sigma = np.hypot(fit.expected_error_px, by_edges.expected_error_px)
    if apart <= max(APART * sigma, LEAST_APART_PERCENT / 100 * fit.camera.width):
        return replace(fit, quality={**fit.quality, "support": by_edges.quality["support"]})
    return _refused(
        fit,
        f"the mesh's edges lie {apart:.0f} px beside where {witness.file} puts it; {CONTRADICTED}",
    )


def _by_edges(fit: Fit, photo: Photo, render: Render, options: StructureOptions) -> Fit | None:
    """Where the mesh's edges put the photo, None where they do not tell."""
    try:
        found = register_structure(photo, fit.camera, render, options, wider=False)
    except RegistrationError:
        return None
    return found if found.accepted else None


def _proven(witness: CameraRecord) -> bool:
    """Whether there is more than another photo's word for the witness itself."""
    support = witness.quality.get("support")
    told = isinstance(support, int | float) and support >= MIN_SUPPORT
    return witness.method == "points" or told


def _refused(fit: Fit, reason: str) -> Fit:
    return replace(fit, accepted=False, reason=reason)
