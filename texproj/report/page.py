"""The report as one HTML page that needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from texproj.formats.jpeg import jpeg_bytes

JPEG_QUALITY = 82


def page(facts: Mapping[str, Any], overlays: Mapping[str, str], views: Sequence[str]) -> str:
    """The HTML of a report. overlays: data URLs by photo name; views: data URLs of the model."""
    environment = Environment(
        loader=PackageLoader("texproj.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    photos = sorted(facts["photos"], key=_worst_first)
    template = environment.get_template("report.html")
    return template.render(
        facts=facts, photos=photos, overlays=overlays, views=views, colors=_colors(facts)
    )


def _colors(facts: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """What the coloring says of each photo, by its name."""
    quality = (facts["color"] or {}).get("quality", {})
    return {row["file"]: row for row in quality.get("photos", [])}


def data_url(picture: NDArray[np.uint8]) -> str:
    """A (h, w, 3) RGB picture as a JPEG inside a URL."""
    data = jpeg_bytes(picture, JPEG_QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(data).decode()


def _worst_first(photo: Mapping[str, Any]) -> tuple[int, float, str]:
    order = {"failed": 0, "prior": 1, "registered": 2}
    error = photo["quality"].get("expected_error_px")
    return order.get(photo["status"], 0), -(error or 0.0), photo["file"]
