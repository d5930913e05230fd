"""A block of photos of which none is registered: sought all over the mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from texproj.register.block.place import Beforehand, place_block
from texproj.register.block.reconstruction import Reconstruction
from texproj.stages.bench import Workbench
from texproj.stages.block_fits import STAGE, STEPS, Told, fit_of, load_reduced, rendered
from texproj.stages.methods import REGISTRATION_LONGEST
from texproj.stages.progress import Progress


def searched(bench: Workbench, part: Reconstruction, known: Beforehand, progress: Progress) -> Told:
    """The photos of a part where its shape fits the mesh."""

    def listen(what: str, share: float) -> None:
        progress(STAGE, round(share * STEPS), STEPS, what)

    load = partial(load_reduced, bench, longest=REGISTRATION_LONGEST)
    block = place_block(part, bench.mesh, partial(rendered, bench), load, listen, known)
    quality = {
        "block_photos": len(part.names),
        "support": round(block.support, 3),
        "rival": round(block.rival, 3),
        "mirror_t": round(block.mirror_t, 2),
    }
    told: Told = {}
    for k, name in enumerate(part.names):
        camera = block.cameras[name]
        fit = fit_of(camera, part, k, block.expected_error_px[name], quality)
        told[name] = replace(fit, accepted=fit.accepted and block.accepted, reason=block.reason)
    return told
