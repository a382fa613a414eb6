"""Runs at another zero than the others."""

import numpy as np
import pytest

from estimation.recording import Instrument, Recording
from estimation.zeros import moved_zeros

USUAL = (2.0, 2.1, 1.9, 2.2, 2.05, 2.3, 1.95)


def runs(zeros, serial="1"):
    return [
        Recording(
            f"{serial}-{k}",
            np.arange(2.0),
            {"motor_angle_rad": np.zeros(2)},
            instrument=Instrument("Maryland", serial),
            conditions={"motor_zero_offset_rad": zero, "frequency_hz": 100.0 * k},
        )
        for k, zero in enumerate(zeros)
    ]


@pytest.mark.parametrize("moved", [(3.4, 3.5), (0.2,)])
def test_runs_after_a_slip_are_apart_from_the_others(moved):
    (found,) = moved_zeros(runs([*USUAL, *moved]))
    assert found.runs == tuple(f"1-{len(USUAL) + k}" for k in range(len(moved)))
    assert found.usual == (1.9, 2.3)
    assert (found.lowest, found.highest) == (min(moved), max(moved))
    assert "slip" in found.sentence


def test_zeros_that_scatter_are_not_apart():
    assert not moved_zeros(runs(USUAL))
    assert not moved_zeros(runs([*USUAL, 2.5]))


def test_two_instruments_have_each_a_zero_of_its_own():
    assert not moved_zeros([*runs(USUAL), *runs([z + 25.0 for z in USUAL], "2")])


def test_a_few_runs_show_no_usual_zero():
    assert not moved_zeros(runs([2.0, 2.1, 9.0]))
    assert not moved_zeros(runs([*USUAL, *(z + 9.0 for z in USUAL)]))
