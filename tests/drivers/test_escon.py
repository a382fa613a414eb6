"""Scaling of an ESCON 24/2 by the firmware: duty 0.1 + 0.4 |I|, I = 4 reading / 4095 - 2 A."""

import ctypes
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st


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
