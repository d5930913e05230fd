"""Which renderer this machine has."""

from __future__ import annotations

from typing import Any

from texproj.errors import RenderError
from texproj.options import RenderOptions
from texproj.render.interface import Renderer
from texproj.render.rays import CPURenderer

APT_LINE = "apt-get install -y --no-install-recommends libegl1 libgl1 libopengl0"


def open_renderer(options: RenderOptions | None = None) -> Renderer:
    """The renderer that `options` ask for (default: OpenGL where it works, else the processor).

    Its `fallback_reason` says why OpenGL was not taken. Raises RenderError if OpenGL is demanded
    and cannot be had.
    """
    wanted = (options or RenderOptions()).renderer
    if wanted == "cpu":
        return CPURenderer()
    ctx, reason = _gl_context()
    if ctx is not None:
        from texproj.render.gl import GLRenderer  # noqa: PLC0415 - slow to load

        return GLRenderer(ctx, remake=_gl_context_again)
    if wanted == "gl":
        raise RenderError(
            f"OpenGL is not available here ({reason}). On Debian or Ubuntu: {APT_LINE}"
        )
    return CPURenderer(reason)


def _gl_context_again() -> Any:
    ctx, reason = _gl_context()
    if ctx is None:
        raise RenderError(f"OpenGL is no longer available ({reason}); try the renderer cpu.")
    return ctx


def _gl_context() -> tuple[Any | None, str]:
    """A context of OpenGL 3.3 or newer, by EGL or else by the platform's own way, or the reason."""
    import moderngl  # noqa: PLC0415 - slow to load

    reasons = []
    ways: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for how in ways:
        try:
            return moderngl.create_context(standalone=True, require=330, **how), ""
        except Exception as error:  # noqa: BLE001 - moderngl raises Exception itself
            reasons.append(str(error))
    return None, "; ".join(dict.fromkeys(reasons))
