"""What is believed of a lens before a photo is registered, and how strongly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from texproj.camera import Intrinsics
from texproj.options import PointsOptions
from texproj.photo import PhotoInfo
from texproj.solve.reprojection import Prior, intrinsic_value

Trust = Literal["known", "approximate", "unknown"]

FOCAL_SIGMA: dict[Trust, float] = {"known": 0.2, "approximate": 0.05, "unknown": 0.6}
"""Standard deviation of log f where it is solved. approximate: EXIF rounds to whole millimeters,
and focusing close lengthens the lens by a few percent; unknown: 24 to 200 mm equivalent lie
within 1.5 of them; known: solved only because it was asked for or contradicted, as by a crop or
a zoom that nobody wrote down."""

CENTER_SIGMA = 0.015
"""Standard deviation of an uncalibrated principal point, as a part of the longer side."""

K_SIGMA = {"k1": 0.1, "k2": 0.1}
"""Standard deviations of uncalibrated distortion, which reaches +-0.2 for zooms at their wide end
and is next to nothing for telephoto lenses and telephones."""

DEFAULT_FOCAL = 1.1
"""Focal length over the longer side where nothing is known: 40 mm equivalent."""

FOCAL_RANGE = (0.35, 10.0)
"""Focal lengths over the longer side that a search covers: 13 to 360 mm equivalent."""

FOCAL_RATIO = 1.25
"""Step of that search."""

GROUPS = {
    "pose": (),
    "focal": ("focal",),
    "principal-point": ("cx", "cy"),
    "k1": ("k1",),
    "k2": ("k1", "k2"),
}


@dataclass(frozen=True)
class Lens:
    """What is taken for known of a photo's lens, and what is solved.

    intrinsics: to start from; free: what is solved; priors: of what is or might be solved;
    trust: in the focal length; checked: whether picks may overrule it.
    """

    intrinsics: Intrinsics
    free: tuple[str, ...]
    priors: tuple[Prior, ...]
    trust: Trust
    checked: bool = False

    def freed(self, *names: str) -> Lens:
        """The same with these intrinsics solved too."""
        return replace(self, free=tuple(dict.fromkeys((*self.free, *names))))

    def looser(self) -> list[Lens]:
        """Models to try when picks contradict this one: the focal length unknown; distortion and
        principal point too."""
        sigma = FOCAL_SIGMA["known" if self.trust == "known" else "unknown"]
        priors = tuple(replace(p, sigma=sigma) if p.name == "focal" else p for p in self.priors)
        open_focal = replace(self, priors=priors, trust="unknown").freed("focal")
        bent = open_focal.freed("k1")
        models = [open_focal, bent, bent.freed("cx", "cy")]
        return [m for i, m in enumerate(models) if m.free not in [n.free for n in models[:i]]]

    def focal_candidates(self) -> list[Intrinsics]:
        """Lenses from which to search: one if the focal length is not solved."""
        k = self.intrinsics
        if "focal" not in self.free:
            return [k]
        if self.trust == "approximate":
            steps = np.array([0.0, -1.5, 1.5]) * FOCAL_SIGMA["approximate"]
            return [scaled_focal(k, float(np.exp(s))) for s in steps]
        side = max(k.width, k.height)
        count = int(np.ceil(np.log(FOCAL_RANGE[1] / FOCAL_RANGE[0]) / np.log(FOCAL_RATIO)))
        lengths = side * np.geomspace(*FOCAL_RANGE, count + 1)
        return [k, *(scaled_focal(k, f / k.fx) for f in lengths)]


def scaled_focal(k: Intrinsics, factor: float) -> Intrinsics:
    """`k` with both focal lengths multiplied."""
    return replace(k, fx=k.fx * factor, fy=k.fy * factor)


def lens_guess(info: PhotoInfo, prior: Intrinsics | None, options: PointsOptions) -> Lens:
    """The lens that the prior, else EXIF, else a usual field of view suggests."""
    side = max(info.width, info.height)
    if prior is not None:
        k = prior.resized(info.width, info.height)
        trust: Trust = "known"
    else:
        f = info.focal_px or DEFAULT_FOCAL * side
        middle = info.width / 2, info.height / 2
        k = Intrinsics(info.width, info.height, f, f, *middle, info.distortion or (0.0,) * 5)
        trust = "approximate" if info.focal_px else "unknown"
    checked = options.focal == "auto" and trust != "unknown" and options.solve == ("auto",)
    if options.focal != "auto":
        trust = options.focal
    return Lens(
        k, _free(options, trust, prior is not None), _priors(k, trust, side), trust, checked
    )


def _free(options: PointsOptions, trust: Trust, calibrated: bool) -> tuple[str, ...]:
    wanted = [name for name in options.solve if name != "auto"]
    if "auto" in options.solve:
        wanted += [] if trust == "known" else ["focal"]
        wanted += [] if calibrated else ["principal-point", "k1"]
    return tuple(dict.fromkeys(part for name in wanted for part in GROUPS[name]))


def _priors(k: Intrinsics, trust: Trust, side: int) -> tuple[Prior, ...]:
    sigmas = {
        "focal": FOCAL_SIGMA[trust], "cx": CENTER_SIGMA * side, "cy": CENTER_SIGMA * side,
        **K_SIGMA,
    }  # fmt: skip
    return tuple(Prior(name, intrinsic_value(k, name), s) for name, s in sigmas.items())
