"""Many photos' colors of a point to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from texproj.arrays import Floats
from texproj.color.balance.corrections import Grid, corrected
from texproj.color.blending.bands import exchanged, restored
from texproj.color.blending.highlights import highlight_factor
from texproj.color.points.source import PointSource
from texproj.color.sampling.store import SampleStore, Stack
from texproj.options import ColorOptions
from texproj.photo import LUMINANCE

BLOCK = 1 << 13
"""Points whose samples from several photos fit the processor's cache."""

ROUNDS = 3
"""Rounds of reweighting; more change nothing that can be measured."""

USUAL_PREFERENCE = 0.35
"""Where the photos do not decide: as near to photos left out as any on all scenes tried."""

TINY = np.float32(1e-20)


@dataclass(frozen=True, eq=False)
class Blend:
    """One color per point.

    rgb: (n, 3) float32 linear light, 0 where unseen; weight: (n,) float32 sum of the weights,
    0 = unseen; photo_count: (n,) uint16; share: (p,) sum of each photo's part of the colors.
    """

    rgb: Floats
    weight: Floats
    photo_count: NDArray[np.uint16]
    share: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Views:
    """What p photos say about n points, brought to the same exposure.

    rgb: (p, 3, n) float32 linear light; weight: (p, n) float32, 0 where unseen; around, trust: see
    `Stack`.
    """

    rgb: Floats
    weight: Floats
    around: Floats | None
    trust: Floats | None = None

    @cached_property
    def light(self) -> Floats:
        """(p, n) square root of the luminance: close to how an eye weighs differences."""
        return np.sqrt(np.einsum("c,pcn->pn", LUMINANCE, self.rgb))


def blend(stack: Stack, gain: Floats, options: ColorOptions) -> Blend:
    """One color per point from the photos' colors times their gains, by `options.blend`.

    gain: (photos in all, 3).
    """
    n = stack.weight.shape[1]
    rgb = np.zeros((n, 3), np.float32)
    share = np.zeros(len(stack.photos))
    factor = gain[stack.photos].astype(np.float32)[:, :, None]
    for start in range(0, n if len(stack.photos) else 0, BLOCK):
        part = slice(start, start + BLOCK)
        around = stack.around if stack.around is None else stack.around[:, part]
        color, weight = stack.rgb[:, :, part] * factor, stack.weight[:, part]
        if options.highlight:
            weight = weight * highlight_factor(color, weight, options.highlight)
        sharp = stack.trust if stack.trust is None else stack.trust[:, part]
        views = Views(color, weight, around, sharp)
        trust, rgb[part] = METHODS[options.blend](views, options)
        share += trust.sum(axis=1)
    count = np.count_nonzero(stack.weight, axis=0).astype(np.uint16)
    return Blend(rgb, stack.weight.sum(axis=0), count, share)


def mean(views: Views, options: ColorOptions) -> tuple[Floats, Floats]:
    """The weighted average of Callieri et al. 2008: (p, n) parts and (n, 3) colors."""
    return mixed(views, views.weight)


def robust(views: Views, options: ColorOptions) -> tuple[Floats, Floats]:
    """The average of what agrees."""
    return mixed(views, agreeing(views, views.light, options))


def best(views: Views, options: ColorOptions) -> tuple[Floats, Floats]:
    """The photo of the largest weight among those that agree with the average of what agrees."""
    trust = agreeing(views, views.light, options)
    usual = _preferred(views.weight, options)
    sound = trust >= np.float32(0.5) * usual
    rank = np.where(sound, views.weight + 1, trust / np.maximum(usual, TINY)) * (views.weight > 0)
    chosen = rank.argmax(axis=0) == np.arange(len(rank))[:, None]
    return mixed(views, (chosen & (views.weight > 0)).astype(np.float32))


def multi_band(views: Views, options: ColorOptions) -> tuple[Floats, Floats]:
    """The average of what agrees in the light around the points, so that details that are a pixel
    apart disagree with nobody; then details get back the strength that they have in the photos.
    What is blurred in a photo is missing in its detail only: the light around is as good as any.
    """
    if views.around is None:
        return robust(views, options)
    light = views.light
    soft = light * views.around
    if views.trust is None:
        trust, rgb = mixed(views, agreeing(views, soft, options))
        return trust, restored(rgb, trust, light - soft)
    anyhow = replace(views, weight=views.weight / views.trust)
    trust, rgb = mixed(anyhow, agreeing(anyhow, soft, options))
    sharp = trust * views.trust
    sharp = sharp / np.maximum(sharp.sum(axis=0), TINY)
    return trust, restored(exchanged(rgb, trust, sharp, light - soft), sharp, light - soft)


METHODS: dict[str, Callable[[Views, ColorOptions], tuple[Floats, Floats]]] = {
    "multi-band": multi_band,
    "robust": robust,
    "mean": mean,
    "best": best,
}


def mixed(views: Views, trust: Floats) -> tuple[Floats, Floats]:
    """(p, n) trust that sums to 1 where seen, and (n, 3) the colors averaged by it."""
    trust = trust / np.maximum(trust.sum(axis=0), TINY)
    return trust, np.einsum("pn,pcn->nc", trust, views.rgb)


def agreeing(views: Views, light: Floats, options: ColorOptions) -> Floats:
    """(p, n) weights of a robust mean by iteratively reweighted least squares, Cauchy loss.

    light: (p, n) square roots of luminance that are to agree. The weights to the power of
    `options.preference` are kept by what agrees, and fall to half at `options.robust_scale` in the
    square roots of linear light. Red and blue are compared against the points' own luminance.
    Starts from the mean by the square roots of the weights, so that no single photo decides where
    the iteration begins.
    """
    base = _preferred(views.weight, options)
    inverse = np.float32(1 / options.robust_scale**2)
    tints = [np.sqrt(views.rgb[:, channel]) - views.light for channel in (0, 2)]
    trust = np.sqrt(views.weight)
    rest = np.empty_like(trust)
    for _ in range(ROUNDS):
        trust /= np.maximum(trust.sum(axis=0), TINY)
        apart = _squared_distance(trust, light, np.empty_like(trust))
        apart *= 3  # all three channels differ by that
        for tint in tints:
            apart += _squared_distance(trust, tint, rest)
        apart *= inverse
        apart += 1
        np.divide(base, apart, out=trust)
    return trust


def _preferred(weight: Floats, options: ColorOptions) -> Floats:
    """(p, n) weights to the power of `options.preference`."""
    power = USUAL_PREFERENCE if isinstance(options.preference, str) else options.preference
    if power == 0:  # what is not seen counts for nothing
        return (weight > 0).astype(np.float32)
    with np.errstate(divide="ignore"):
        raised = np.log(weight)  # a quarter of what OpenCV's power takes; 0 stays 0
    raised *= np.float32(power)
    return np.exp(raised, out=raised)


def _squared_distance(trust: Floats, values: Floats, out: Floats) -> Floats:
    """(p, n) squared differences to the mean by `trust`, which sums to 1, in `out`."""
    np.subtract(values, np.einsum("pn,pn->n", trust, values), out=out)
    out *= out
    return out


def blend_chunk(
    store: SampleStore,
    points: PointSource,
    number: int,
    gains: Floats,
    grids: Sequence[Grid | None],
    options: ColorOptions,
) -> Blend:
    """One color for each point of a chunk.

    gains: (p, 3), grids: (p,) of all photos in all; the share of the blend is (p,) of them too.
    """
    parts, share = [], np.zeros(len(gains))
    for rows in store.pieces(number):
        stack = corrected(store.read(number, rows), points, number, grids, rows)
        parts.append(blend(stack, gains, options))
        share[stack.photos] += parts[-1].share
    return Blend(
        np.concatenate([part.rgb for part in parts]),
        np.concatenate([part.weight for part in parts]),
        np.concatenate([part.photo_count for part in parts]),
        share,
    )
