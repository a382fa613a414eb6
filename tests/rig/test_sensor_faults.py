"""Encoders and the current read-back that fail while the rig moves, held by the firmware core."""

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reliability.encoder_faults import (
    FAULTS,
    JAW,
    MOTOR,
    SPINDLE,
    TICK_FUNCTION,
    frozen,
    ride,
    sound,
)
from drivers.teensy.core import FirmwareBoard
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, Kind, Result, Trip
from rig.configuration.config import load_config
from rig.machines.choose import machine_of
from tests.drivers.raw_host import RawHost

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


class SmallGrasper:
    """Three motors behind gearheads; the first decoder counts the third's phase A as its own."""

    def __init__(self, shares_an_input: bool) -> None:
        self.angle_rad, self._speed, self._current = np.zeros(3), np.zeros(3), np.zeros(3)
        self.farthest_rad = np.zeros(3)
        self._shares = shares_an_input
        self._noise = np.random.default_rng(0)
        self._phases, self._count = 0, 0

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK_FUNCTION(tick_address)
        outputs = (ctypes.c_int32 * 3)()
        for k in range(ticks):
            motor = np.floor(self.angle_rad * 2048 * 66 / math.tau).astype(int)
            if self._shares:
                motor[0] = self._decoded(int(motor[2]), int(motor[0]))
            noise = self._noise.integers(-4, 5, 6)
            counts = [*motor, *(1000 * self._current + noise[:3]).astype(int), *(100 + noise[3:])]
            given = (ctypes.c_int32 * 9)(*map(int, counts))
            tick(board_address, (tick_us + 500 * k) % 2**32, given, outputs)
            self._current = 2e-4 * np.array(outputs[:])
            for _ in range(5):
                friction = 4e-3 * np.tanh(self._speed / 0.02) + 2e-2 * self._speed
                torque = 66 * 14.6e-3 * self._current - friction
                self._speed += torque / (66**2 * 2.7e-7) * 1e-4
                self.angle_rad += self._speed * 1e-4
            self.farthest_rad = np.maximum(self.farthest_rad, np.abs(self.angle_rad))

    def _decoded(self, a_count: int, b_count: int) -> int:
        phases = (a_count >> 1 & 1) << 1 | ((b_count + 1) >> 1 & 1)
        step = (0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0)[self._phases << 2 | phases]
        self._phases, self._count = phases, self._count + step
        return self._count


@pytest.mark.parametrize("shares_an_input", [False, True])
def test_a_grasper_with_a_wrong_decoder_input_stops(library: Path, shares_an_input: bool) -> None:
    config = load_config(Path("grasper"))
    machine = machine_of(config)
    profile = machine.profile
    limits = machine.board_limits(config, config.calibration_set())
    rig = SmallGrasper(shares_an_input)
    board = FirmwareBoard(rig, library=library, profile=profile)
    host = RawHost(board, profile, machine.gains(config))
    host.command(Kind.START)
    board.advance(1)
    assert host.arm(limits) is Result.OK
    for block in range(60):
        move = np.clip((np.arange(50) + 50 * block) / 2000, 0, 1) * 0.2 * 2048 * 66 / math.tau
        host.setpoints(*[move.astype(np.int32)] * 3)
        host.run(50)
    samples = host.samples()
    tripped = (samples["status"] & STATUS_LIMIT_TRIPPED) != 0
    assert tripped.any() == shares_an_input
    assert (rig.farthest_rad < [1.4, 1.0, 1.0]).all()
