"""Which renderer this machine has."""

from __future__ import annotations

from texproj.errors import RenderError
from texproj.options import RenderOptions
from texproj.render.gl import GLRenderer

APT_LINE = "apt-get install -y --no-install-recommends libegl1 libgl1 libopengl0"


def open_renderer(options: RenderOptions | None = None) -> GLRenderer:
    """The renderer that `options` ask for; use it as a context manager."""
    import moderngl

    try:
        return GLRenderer(moderngl.create_context(standalone=True, require=330, backend="egl"))
    except Exception as error:
        raise RenderError(
            f"OpenGL is not available ({error}); on Debian or Ubuntu: {APT_LINE}"
        ) from None
