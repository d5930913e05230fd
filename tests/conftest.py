"""Fixtures shared by all tests."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock

os.environ["LOKY_MAX_CPU_COUNT"] = "1"  # tests themselves run beside each other

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
def made_once(tmp_path_factory):
    """`made_once(name, make)`: a folder that `make(folder)` fills, once for all processes that run
    tests, not once in each.
    """
    root = tmp_path_factory.getbasetemp()
    root = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "once"

    def folder_of(name: str, make: Callable[[Path], None]) -> Path:
        place, folder = root / name, root / name / "stele"
        place.mkdir(parents=True, exist_ok=True)
        with FileLock(place / "lock"):
            if not (place / "done").exists():
                shutil.rmtree(folder, ignore_errors=True)  # of a process whose making failed
                make(folder)
                (place / "done").touch()
        return folder

    return folder_of


@pytest.fixture(scope="session")
def demo_folder(made_once):
    """A small synthetic project with truth, made once; copy it before you change it."""
    from texproj.demo import write_demo
    from texproj.options import DemoOptions

    options = DemoOptions(
        object="stele",
        photos=4,
        starts=True,
        paint=1,
        long_side=640,
        faces=6000,
        carved_faces=60_000,
    )
    return made_once("small", lambda folder: write_demo(folder, options))


@pytest.fixture
def project_folder(demo_folder, tmp_path):
    """A copy of the small synthetic project that a test may change."""
    return Path(shutil.copytree(demo_folder, tmp_path / "stele"))


@pytest.fixture(scope="session")
def sample():
    """The sample project as it is in the repository; nothing may be written there."""
    return CHECKOUT / "projects/stele"


@pytest.fixture(scope="session")
def stele(sample, made_once):
    """A copy of the sample project that `texproj run` has been through; copy it to change it."""
    from texproj.cli import main

    def make(folder: Path) -> None:
        shutil.copytree(sample, folder, ignore=shutil.ignore_patterns("work", "out"))
        assert main(["run", str(folder)]) == 0

    return made_once("sample", make)


@pytest.fixture(scope="module")
def browser():
    """Chromium with software WebGL, on the page as its sources are now."""
    from browsing import chromium

    with chromium() as found:
        yield found


@pytest.fixture(scope="session")
def page_template(made_once):
    """The project of the page's tests; copy it before you change it."""
    from browsing import make_page_project

    return made_once("blocks", make_page_project)
