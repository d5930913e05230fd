"""The commands by name; the module of each is loaded when it is called, so that all start fast."""

from cyclopts import App

from texproj.version import __version__

app = App(
    name="texproj",
    version=__version__,
    version_format="plaintext",
    help="Color a 3D mesh from loose photographs: register each photo to the mesh, "
    "project its color, write the model.",
    suppress_keyboard_interrupt=False,
)

MODULES = {
    "creating": ("new", "demo"),
    "making": ("register", "refine", "color", "appearance", "run", "report", "place"),
    "telling": ("status", "preview"),
    "machine": ("doctor",),
    "inspecting": ("factors", "turntable"),
    "calibrating": ("calibrate_flash",),
    "relighting": ("relight",),
    "exchange": ("import_", "export"),
}
"""Modules of this package, and the commands that each holds."""

for module, names in MODULES.items():
    for name in names:
        app.command(f"texproj.cli.{module}:{name}", name=name.strip("_").replace("_", "-"))
