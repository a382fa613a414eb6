"""The C++ core and the Teensy's layer, tried on this host under the sanitizers."""

import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.integration

FIRMWARE = Path(__file__).parents[2] / "firmware"
PROBE = "#include <doctest/doctest.h>\n"


def has_doctest() -> bool:
    """Whether a compiler here finds the one header the tests need."""
    if shutil.which("g++") is None or shutil.which("make") is None:
        return False
    words = ["g++", "-x", "c++", "-fsyntax-only", "-E", "-o", "/dev/null", "-"]
    done = subprocess.run(words, input=PROBE, text=True, capture_output=True, check=False)
    return done.returncode == 0


@pytest.mark.skipif(not has_doctest(), reason="needs g++, make and doctest (apt: doctest-dev)")
def test_the_core_passes_its_own_tests_under_the_sanitizers():
    done = subprocess.run(
        ["make", "-C", str(FIRMWARE), "test"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 failed" in done.stdout
