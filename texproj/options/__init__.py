"""The settings of every stage: the one home of each default, its bounds and its help text.

Command-line flags and project.toml are made from these classes; a flag overrides project.toml,
which overrides the default here.
"""

from texproj.options.base import is_expert, meanings, options_from
from texproj.options.color import ColorOptions, OutputOptions, PatchOptions, UnwrapOptions
from texproj.options.develop import DevelopOptions
from texproj.options.light import LightOptions
from texproj.options.register import (
    MapName,
    MutualInformationOptions,
    PointsOptions,
    RefineOptions,
    RegisterOptions,
    SilhouetteOptions,
    StructureOptions,
)
from texproj.options.tools import DemoLight, DemoOptions, PreviewOptions, RenderOptions

__all__ = [
    "ColorOptions",
    "DemoLight",
    "DemoOptions",
    "DevelopOptions",
    "LightOptions",
    "MapName",
    "MutualInformationOptions",
    "OutputOptions",
    "PatchOptions",
    "PointsOptions",
    "PreviewOptions",
    "RefineOptions",
    "RegisterOptions",
    "RenderOptions",
    "SilhouetteOptions",
    "StructureOptions",
    "UnwrapOptions",
    "is_expert",
    "meanings",
    "options_from",
]
