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


@pytest.fixture(scope="session", autouse=True)
def small_views():
    """Reports show the model from around in a sixteenth of the pixels: of tiny projects those
    three pictures cost more than all else. What runs as a process of its own shows them whole.
    """
    from texproj.report import pictures

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "VIEW_SIZE", tuple(side // 4 for side in pictures.VIEW_SIZE))
        yield


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """A folder of all processes that run tests together."""
    root = tmp_path_factory.getbasetemp()
    folder = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "once"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def kept_scenes(once):
    """Photos that one process made for its tests are there for the others."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TEXPROJ_TEST_SCENES", str(once))
        yield


@pytest.fixture(scope="session")
def made_once(once):
    """`made_once(name, make)`: a folder that `make(folder)` fills, once for all processes that run
    tests, not once in each.
    """

    def folder_of(name: str, make: Callable[[Path], None]) -> Path:
        place, folder = once / name, once / name / "stele"
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
        faces=12_000,
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
def server_template(made_once):
    """The project of the tests of the page's server; copy it before you change it."""
    from preview_project import make_project

    return made_once("blocks", make_project)


@pytest.fixture(scope="session")
def page_template(made_once, server_template):
    """The project of the page's tests, with one more photo; copy it before you change it."""
    from browsing import add_lens_photo

    def make(folder: Path) -> None:
        shutil.copytree(server_template, folder)
        add_lens_photo(folder)

    return made_once("blocks and lens", make)


@pytest.fixture(scope="module")
def one_page(browser, page_template, tmp_path_factory):
    """A page for tests that only look."""
    from browsing import opened
    from preview_project import running

    root = shutil.copytree(page_template, tmp_path_factory.mktemp("seen") / "blocks")
    with running(root) as home, opened(browser, home) as found:
        yield found


@pytest.fixture
def shown(one_page):
    """The page on which others looked before, out of all photos and back at the bare shape."""
    from browsing import as_at_first

    as_at_first(one_page)
    return one_page
