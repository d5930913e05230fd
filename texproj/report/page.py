"""The report as one HTML page that needs no other file."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.formats.jpeg import jpeg_bytes
from texproj.report.words import details, light_of, shared_notes

JPEG_QUALITY = 82


@dataclass(frozen=True, eq=False)
class Pictures:
    """What a report shows, as data URLs. overlays: by photo name; models: the model as the photo's
    camera sees it, by photo name; views: of the model; model: `packed_model`, or None.
    """

    overlays: Mapping[str, str]
    models: Mapping[str, str]
    views: Sequence[str]
    model: Mapping[str, Any] | None


def page(facts: Mapping[str, Any], shown: Pictures) -> str:
    """The HTML of a report."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415 - slow to load
    from markupsafe import Markup  # noqa: PLC0415 - comes with it

    environment = Environment(
        loader=PackageLoader("texproj.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"light_of": light_of, "digits": "{:.2g}".format}
    photos = sorted(facts["photos"], key=_worst_first)
    template = environment.get_template("report.html")
    viewer = _viewer()
    return template.render(
        facts=facts,
        photos=photos,
        shown=shown,
        colors=_colors(facts),
        details=details((facts["color"] or {}).get("quality", {})),
        shared_notes=shared_notes(facts["photos"]),
        viewer=Markup(viewer),
        packed=json.dumps(shown.model).replace("<", "\\u003c") if viewer and shown.model else "",
    )


def _viewer() -> str:
    """The program that turns the model; empty where the page was not built."""
    path = files("texproj") / "preview" / "static" / "bundle" / "report.js"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


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
