"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data():
    """`real_data(name)`: the folder of a real scene; skips the test where it is absent."""
    root = Path(os.environ.get("TEXPROJ_DATA") or CHECKOUT / "../shared/data")

    def scene(name: str) -> Path:
        path = root / name
        if not path.is_dir():
            pytest.skip(f"real photographs not found at {path} (set TEXPROJ_DATA)")
        return path

    return scene
