"""Fixtures shared by all tests."""

import os
import shutil
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


@pytest.fixture(scope="session")
def demo_folder(tmp_path_factory):
    """A small synthetic project with truth, made once; copy it before you change it."""
    from texproj.demo import write_demo
    from texproj.options import DemoOptions

    folder = tmp_path_factory.mktemp("demo") / "stele"
    options = DemoOptions(
        object="stele",
        photos=4,
        starts=True,
        paint=1,
        long_side=640,
        faces=6000,
        carved_faces=60_000,
    )
    write_demo(folder, options)
    return folder


@pytest.fixture
def project_folder(demo_folder, tmp_path):
    """A copy of the small synthetic project that a test may change."""
    return Path(shutil.copytree(demo_folder, tmp_path / "stele"))


@pytest.fixture(scope="session")
def sample():
    """The sample project as it is in the repository; nothing may be written there."""
    return CHECKOUT / "projects/stele"


@pytest.fixture(scope="session")
def stele(sample, tmp_path_factory):
    """A copy of the sample project that `texproj run` has been through; copy it to change it."""
    from texproj.cli import main

    made = shutil.ignore_patterns("work", "out")
    folder = shutil.copytree(sample, tmp_path_factory.mktemp("sample") / "stele", ignore=made)
    assert main(["run", str(folder)]) == 0
    return folder
