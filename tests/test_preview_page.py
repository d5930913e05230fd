"""The page's own sources: types, and unit tests of the parts that need no browser."""

import re

from page_tools import WEB, run, with_packages


def test_the_page_s_types_fit():
    """tsc finds nothing in strict mode, neither in the page nor in its tests."""
    node = with_packages()
    done = run([*node, "node_modules/typescript/bin/tsc", "--noEmit"], node)

    assert done.returncode == 0, done.stdout


def test_the_page_s_units_work():
    """Lens, windows, picks, upright models, words of jobs: all unit tests in web/tests."""
    node = with_packages()
    done = run([*node, "test.mjs"], node)

    assert done.returncode == 0, done.stdout
    written = sum(len(re.findall(r"^test\(", p.read_text(), re.M)) for p in WEB.glob("tests/*.ts"))
    assert int(re.search(r"pass (\d+)", done.stdout)[1]) == written > 20
