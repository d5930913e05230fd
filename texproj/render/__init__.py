"""Images of the mesh from any camera, by OpenGL or by ray casting."""

from texproj.render.context import open_renderer
from texproj.render.gbuffer import CHANNELS, GBuffer

__all__ = ["CHANNELS", "GBuffer", "open_renderer"]
