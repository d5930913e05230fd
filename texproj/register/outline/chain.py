"""From an outline to an exact camera: views that have the object's outline are told apart, and
made exact, by what is inside of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

from texproj.arrays import Mask
from texproj.camera import Camera, Intrinsics
from texproj.errors import RegistrationError
from texproj.mesh import Mesh
from texproj.options import MutualInformationOptions, SilhouetteOptions, StructureOptions
from texproj.photo import Photo
from texproj.records import Fit
from texproj.register.information.register import register_mutual_information
from texproj.register.information.search import MIDDLE, Outcome, Task, ascend
from texproj.register.motion import motion_px
from texproj.register.outline.register import Hypothesis, hypotheses
from texproj.register.structure.register import register_structure
from texproj.render import Render

CLEAR = 1.08
"""The best view's information over the second's, above which it is the one."""
PLENTY = 0.6
"""Share of structure in place from which on it is more exact than shading: painted objects have
more, uniform ones less."""
SAME = 0.01
"""Image motion, as a share of the width, below which two views are one."""


@dataclass(frozen=True)
class ChainOptions:
    """Options of the steps."""

    silhouette: SilhouetteOptions = field(default_factory=SilhouetteOptions)
    information: MutualInformationOptions = field(default_factory=MutualInformationOptions)
    structure: StructureOptions = field(default_factory=StructureOptions)


def register_from_outline(
    photo: Photo,
    prior: Camera | Intrinsics | None,
    render: Render,
    mesh: Mesh,
    options: ChainOptions | None = None,
    mask: Mask | None = None,
) -> Fit:
    """The exact camera of a photo whose object has a known or findable outline.

    The views that share the outline are compared by what the mesh tells about the photo inside of
    it, and the best is made exact by structure or, where that is not sure, by mutual information.
    Refused if two different views do equally well. Arguments and errors: as of `hypotheses`.
    """
    options = options or ChainOptions()
    found = hypotheses(photo, prior, render, mesh, options.silhouette, mask)
    task = Task(photo, render, options.information)
    ranked = sorted(_informed(task, found), key=lambda o: -o.information)
    fit = _exact(photo, ranked[0].camera, render, options)
    rival = _rival(ranked, mesh)
    quality = {**fit.quality, "outline_xor": round(found[0].xor, 4), "outline_views": len(found)}
    if fit.accepted and rival:
        quality["rival_percent"] = round(100 * rival, 1)
        reason = (
            f"another view of the object with this outline fits {rival:.0%} as well "
            "(give a rough camera, or pick 8 points)"
        )
        fit = replace(fit, accepted=False, reason=reason)
    return replace(fit, quality=quality)


def _informed(task: Task, found: list[Hypothesis]) -> Iterator[Outcome]:
    """Each hypothesis moved uphill, with the information at its end."""
    for hypothesis in found:
        yield ascend(task, hypothesis.camera, MIDDLE)


def _rival(ranked: list[Outcome], mesh: Mesh) -> float:
    """Information of the second best different view over that of the best; 0 = no rival."""
    probes = mesh.vertices[:: max(1, len(mesh.vertices) // 200)]
    best = ranked[0]
    for other in ranked[1:]:
        apart = motion_px(other.camera, best.camera, probes) > SAME * best.camera.width
        if apart and best.information < CLEAR * other.information:
            return other.information / best.information
    return 0.0


def _exact(photo: Photo, start: Camera, render: Render, options: ChainOptions) -> Fit:
    """By structure where there is plenty of it, else by mutual information if that is sure."""
    structure: Fit | None = None
    with suppress(RegistrationError):  # too smooth: shading decides
        structure = register_structure(photo, start, render, options.structure, wider=False)
    if structure and structure.accepted and structure.quality["support"] >= PLENTY:
        return structure
    fit = register_mutual_information(photo, start, render, options.information)
    return structure if structure and structure.accepted and not fit.accepted else fit
