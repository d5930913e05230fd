"""What the numbers of a report come to: a verdict, what they mean, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

GOOD_PERCENT, POOR_PERCENT = 0.1, 0.3
"""Expected error of a camera, percent of the photo's longer side: below the first details of
several photos meet; beyond the second edges are seen double."""

SEEN, HARDLY_SEEN = 0.98, 0.8
"""Part of the surface that photos see from which the model is whole, or full of holes."""

BLURRED = 0.5
"""Contrast of fine detail against the other photos below which a photo is blurred."""

EXPOSURE_OFF = 1.0
"""Stops between a photo and what its EXIF says, from which something is odd."""

MOST_NAMED = 5


def verdict(facts: Mapping[str, Any]) -> dict[str, Any]:
    """level: "good", "fair" or "bad"; text: one sentence; meaning: what the numbers mean; next:
    what to do, the most useful first.

    facts: those of the report.
    """
    summary, color = facts["summary"], facts["color"]
    quality = (color or {}).get("quality", {})
    seen = quality.get("seen")
    steps = list(_next(facts, quality))
    told = f"{summary['registered']} of {summary['photos']} photos are registered"
    if color is None or not summary["registered"]:
        level, text = "bad", f"There is no model yet: {told}."
    else:
        whole = f"{_percent(seen)} of the surface has its color from photos"
        level = "good" if not steps else "fair"
        if (seen is not None and seen < HARDLY_SEEN) or _worst(facts) > POOR_PERCENT:
            level = "bad"
        words = {"good": "All is well", "fair": "Usable, and better is possible", "bad": "Poor"}
        text = f"{words[level]}: {told}, {whole}."
    done = "Nothing: open out/model.glb (any viewer) or out/model.obj." if color else ""
    return {
        "level": level,
        "text": text,
        "meaning": list(_meaning(facts, quality)),
        "next": steps or [done or "Run `texproj run`."],
    }


def _meaning(facts: Mapping[str, Any], quality: Mapping[str, Any]) -> Iterator[str]:
    errors = sorted(_errors(facts).values())
    if errors:
        middle, worst = errors[len(errors) // 2], errors[-1]
        judged = (
            "finer than what can be seen"
            if worst < GOOD_PERCENT
            else "fine detail may be soft where photos meet"
            if worst < POOR_PERCENT
            else "edges may be seen double"
        )
        yield (
            f"Cameras: the surface is expected {middle:.2f} % of a photo's longer side off"
            f" (median; worst {worst:.2f} %): {judged}."
        )
    if "seen" in quality:
        yield (
            f"Surface: {_percent(quality['seen'])} is seen by a photo, on the mean by"
            f" {quality['photos_per_point']:.1f}; what none sees is filled from around it."
        )
        yield (
            f"Of what is seen, {_percent(quality['seen_by_one'])} is seen by one photo alone:"
            " nothing checks the color there."
        )
    rows = quality.get("photos", [])
    if len(rows) > 1:
        apart = sorted(row["disagreement"] for row in rows)[len(rows) // 2]
        yield (
            f"Light: after exposure and white balance are corrected, photos differ by"
            f" {100 * apart:.0f} % on the same surface (median)."
        )
    hidden = (facts["color"] or {}).get("occluders", {})
    if hidden:
        yield (
            f"Something stands in front in {_named(list(hidden))} and was left out (magenta below):"
            " if that is wrong, edit the masks in work/occluders/."
        )


def _next(facts: Mapping[str, Any], quality: Mapping[str, Any]) -> Iterator[str]:
    if facts["outdated"]:
        yield f"The model is older than what it is made from ({facts['outdated']}): `texproj run`."
    failed = [p["file"] for p in facts["photos"] if p["status"] != "registered"]
    if failed:
        yield (
            f"Not registered: {_named(failed)}. Each says below what it needs; 8 points picked in"
            " one (`texproj preview`) often bring the others with it. Leave out with `exclude` what"
            " does not belong here."
        )
    poor = [name for name, percent in _errors(facts).items() if percent > POOR_PERCENT]
    if poor:
        yield (
            f"Uncertain cameras: {_named(poor)}. Look at the edges below; add points, or run"
            " `texproj refine`."
        )
    known = _errors(facts)
    untold = [
        p["file"] for p in facts["photos"] if p["status"] == "registered" and p["file"] not in known
    ]
    if untold:
        yield (
            f"How far off these cameras may be is not known: {_named(untold)}. See below whether"
            " the edges follow the picture; `texproj refine` compares the photos with each other."
        )
    unread = (facts["color"] or {}).get("failed", {})
    if unread:
        yield f"Not used for color: {_named(list(unread))}. The reasons stand with them below."
    if quality.get("seen", 1) < SEEN:
        yield (
            f"{_percent(1 - quality['seen'])} of the surface is in no photo: take photos of it, or"
            " live with colors that are filled in."
        )
    rows = quality.get("photos", [])
    blurred = [r["file"] for r in rows if (r.get("sharpness") or 1) < BLURRED]
    if blurred:
        yield (
            f"Blurred: {_named(blurred)}. They count less in fine detail; leave them out"
            " (`exclude`) where others show the same."
        )
    odd = [r["file"] for r in rows if abs(r.get("exposure_off") or 0) > EXPOSURE_OFF]
    if odd:
        yield (
            f"Light other than their EXIF says: {_named(odd)}. They may be developed differently;"
            " develop all alike."
        )


def _errors(facts: Mapping[str, Any]) -> dict[str, float]:
    """Expected errors of the registered photos that tell one, percent of the longer side."""
    return {
        p["file"]: 100 * p["quality"]["expected_error_px"] / max(p["size"])
        for p in facts["photos"]
        if p["status"] == "registered" and p["size"] and p["quality"].get("expected_error_px")
    }


def _worst(facts: Mapping[str, Any]) -> float:
    return max(_errors(facts).values(), default=0.0)


def _percent(part: float | None) -> str:
    if part is None:
        return "an unknown part"
    return f"{100 * part:.1f} %"


def _named(names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
