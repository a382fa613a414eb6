"""Encoders and the current read-back that fail while the rig moves, held by the firmware core."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reliability.encoder_faults import (
    FAULTS,
    JAW,
    MOTOR,
    SPINDLE,
    frozen,
    ride,
    sound,
)
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, Trip

pytestmark = pytest.mark.integration

BEYOND_RAD = math.radians(5.0)


def test_a_sound_rig_trips_over_nothing(library: Path) -> None:
    assert ride(sound, library=library)[2] is Trip.NONE


@pytest.mark.parametrize("name", list(FAULTS))
def test_a_sensor_that_fails_ends_the_motion(library: Path, name: str) -> None:
    fault, codes = FAULTS[name]
    rig, samples, trip = ride(fault, library=library)
    tripped = (samples["status"] & STATUS_LIMIT_TRIPPED) != 0
    assert tripped.any()
    assert trip in codes
    assert (samples["command_e4"][tripped] == 0).all()
    assert np.abs(rig.angles).max() < 3.0


@pytest.mark.parametrize("fault_tick", [100, 300])
@pytest.mark.parametrize("columns", [(SPINDLE,), (SPINDLE, JAW), (MOTOR, SPINDLE, JAW)])
def test_a_dead_encoder_near_the_end_of_travel_lets_the_spindle_hardly_beyond(
    library: Path, columns: tuple[int, ...], fault_tick: int
) -> None:
    fault = frozen(*columns, since=fault_tick)
    rig, _, trip = ride(fault, start_rad=2.9, stop_rad=2.99, library=library)
    assert trip is not Trip.NONE
    assert np.abs(rig.angles).max() < 3.0 + BEYOND_RAD
