"""The C++ core and the Teensy's layer, tried on this host; the scaling of an ESCON 24/2."""

import ctypes
import math
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

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


@pytest.fixture(scope="module")
def core(library: Path) -> ctypes.CDLL:
    core = ctypes.CDLL(str(library))
    core.rig_escon_code.argtypes = [ctypes.c_double]
    return core


@given(current_a=st.floats(-3, 3))
def test_a_current_is_commanded_to_half_a_step_and_within_the_limit(core, current_a):
    duty = core.rig_escon_code(current_a) / 4095
    assert (duty - 0.1) / 0.8 * 2 == pytest.approx(min(abs(current_a), 2.0), abs=0.00031)


@pytest.mark.parametrize("current_a", [math.nan, math.inf, -math.inf])
def test_what_is_no_current_commands_none(core, current_a):
    assert core.rig_escon_code(current_a) == core.rig_escon_code(0.0)


def test_a_reading_is_a_current_unless_the_converter_is_at_its_end(core):
    for reading in (1, 2000, 4094):
        expected = 2000 * (2 * reading / 4095 - 1)
        assert core.rig_escon_milliampere(reading) == pytest.approx(expected, abs=0.51)
    assert core.rig_escon_milliampere(0) == -(2**15)
    assert core.rig_escon_milliampere(4095) == 2**15 - 1
