"""Images of the mesh from any camera, by OpenGL or by ray casting."""

from texproj.render.context import open_renderer
from texproj.render.gbuffer import CHANNELS, GBuffer
from texproj.render.interface import Render, Renderer, Scene
from texproj.render.lens import ideal_grid, pinhole_cover
from texproj.render.model import ModelLook, model_pictures, render_model
from texproj.render.occlusion import ambient_occlusion, occlusion_of

__all__ = [
    "CHANNELS",
    "GBuffer",
    "ModelLook",
    "Render",
    "Renderer",
    "Scene",
    "ambient_occlusion",
    "ideal_grid",
    "model_pictures",
    "occlusion_of",
    "open_renderer",
    "pinhole_cover",
    "render_model",
]
