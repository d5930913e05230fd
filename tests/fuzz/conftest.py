"""How many broken inputs each test tries: 40 in the suite, many by

TEXPROJ_FUZZ_INPUTS=1000 python -m pytest tests/fuzz --hypothesis-profile=long
"""

import os

import pytest
from fuzzing import INPUTS
from hypothesis import HealthCheck, settings

COMMON = {
    "deadline": None,  # `fuzzing.bounded` has its own
    "database": None,
    "suppress_health_check": list(HealthCheck),
    "print_blob": True,
}
LONG = int(os.environ.get("TEXPROJ_FUZZ_INPUTS", "1000"))
settings.register_profile("suite", max_examples=40, derandomize=True, **COMMON)
settings.register_profile("long", max_examples=LONG, **COMMON)
settings.load_profile("suite")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder for the broken files of a module."""
    return tmp_path_factory.mktemp("fuzz")


def pytest_terminal_summary(terminalreporter):
    """Say how many inputs each reader took."""
    if INPUTS:
        told = ", ".join(f"{name} {count}" for name, count in sorted(INPUTS.items()))
        terminalreporter.write_line(f"broken inputs: {sum(INPUTS.values())} ({told})")
