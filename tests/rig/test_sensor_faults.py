"""Encoders and the current read-back that fail while the rig moves, held by the firmware core.

The plant is small and stiff: every torque of the motor turns the shaft, so what the limits allow is
what the shaft does.
"""

import ctypes
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.teensy.core import FirmwareBoard
from drivers.teensy.protocol import STATUS_LIMIT_TRIPPED, TRIP_SHIFT, Kind, Result, Trip
from rig.configuration.config import load_config
from rig.machines.choose import machine_of
from tests.drivers.raw_host import RawHost

pytestmark = pytest.mark.integration

TICK_FUNCTION = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p, ctypes.c_void_p
)
MOTOR, SPINDLE, JAW, PROXIMAL, DISTAL, CURRENT = range(6)
PER_RAD = 4096 * 35 / math.tau, -8192 / math.tau, 4000 * 0.913 / math.tau
FAULT_TICK = 300
BEYOND_RAD = math.radians(5.0)

Fault = Callable[[int, list[int]], list[int]]
"""The counts a tick of the board gets, of those the sensors have."""


class SmallRig:
    """Motor and spindle as one inertia with friction, and sensors that a fault changes."""

    def __init__(self, fault: Fault, angle_rad: float = 0.0) -> None:
        self.angle_rad, self.speed_rad_s, self.current_a = angle_rad, 0.0, -0.019
        self.angles: list[float] = []
        self._fault = fault
        self._noise = np.random.default_rng(0)
        self._tick = 0

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        tick = TICK_FUNCTION(tick_address)
        outputs = (ctypes.c_int32 * 2)()
        for k in range(ticks):
            counts = [math.floor(self.angle_rad * per_rad) for per_rad in PER_RAD]
            noise = self._noise.integers(-4, 5, 3)
            counts += [*noise[:2].tolist(), int(1000 * self.current_a) + int(noise[2]), 0]
            given = (ctypes.c_int32 * 7)(*self._fault(self._tick, counts))
            tick(board_address, (tick_us + 1000 * k) % 2**32, given, outputs)
            self._move(outputs[0])
            self._tick += 1

    def _move(self, command_e4: int) -> None:
        self.current_a = -2.06e-4 * command_e4 - 0.019
        for _ in range(20):
            friction = 0.03 * math.tanh(self.speed_rad_s / 0.02) + 0.01 * self.speed_rad_s
            acceleration = (0.467 * self.current_a - friction) / 3.3e-4
            self.speed_rad_s += acceleration * 1e-3 / 20
            self.angle_rad += self.speed_rad_s * 1e-3 / 20
        self.angles.append(self.angle_rad)


def frozen(*columns: int) -> Fault:
    kept: dict[int, int] = {}

    def fault(tick: int, counts: list[int]) -> list[int]:
        for column in columns:
            if tick < FAULT_TICK:
                kept[column] = counts[column]
            counts[column] = kept[column]
        return counts

    return fault


def reversed_encoder(column: int) -> Fault:
    def fault(_tick: int, counts: list[int]) -> list[int]:
        counts[column] = -counts[column]
        return counts

    return fault


def dead_read_back(tick: int, counts: list[int]) -> list[int]:
    counts[CURRENT] = tick % 3
    return counts


def lost_edges(tick: int, counts: list[int]) -> list[int]:
    counts[SPINDLE] += 500 if tick > 2 * FAULT_TICK else 0
    return counts


def sound(_tick: int, counts: list[int]) -> list[int]:
    return counts


FAULTS: dict[str, tuple[Fault, set[Trip]]] = {
    "spindle frozen": (frozen(SPINDLE), {Trip.ENCODERS_DISAGREE}),
    "spindle and jaw frozen": (frozen(SPINDLE, JAW), {Trip.ENCODERS_DISAGREE}),
    "all encoders frozen": (frozen(MOTOR, SPINDLE, JAW), {Trip.ENCODER_FROZEN}),
    "spindle reversed": (reversed_encoder(SPINDLE), {Trip.ENCODERS_DISAGREE}),
    "motor frozen": (frozen(MOTOR), {Trip.ENCODERS_DISAGREE}),
    "motor reversed": (reversed_encoder(MOTOR), {Trip.ENCODERS_DISAGREE}),
    "jaw frozen": (frozen(JAW), {Trip.ENCODERS_DISAGREE}),
    "current read-back dead": (dead_read_back, {Trip.CURRENT_MISMATCH}),
    "spindle jumps": (lost_edges, {Trip.ENCODER_JUMP}),
}


def ride(
    library: Path, fault: Fault, ticks: int = 4000, start_rad: float = 0.0, stop_rad: float = 0.5
) -> tuple[SmallRig, NDArray[np.void]]:
    """Turn the spindle at 0.2 rad/s under the shipped limits."""
    config = load_config(Path("reference"))
    machine = machine_of(config)
    limits = machine.board_limits(config, config.calibration_set())
    rig = SmallRig(fault, start_rad)
    board = FirmwareBoard(rig, library=library)
    host = RawHost(board, gains=machine.gains(config))
    host.command(Kind.START)
    board.advance(1)
    assert host.arm(limits) is Result.OK
    moved = np.arange(ticks) * 1e-3 * math.copysign(0.2, stop_rad - start_rad)
    target_rad = start_rad + np.clip(moved, *sorted((0.0, stop_rad - start_rad)))
    targets = np.round(target_rad * PER_RAD[SPINDLE]).astype(np.int32)
    for first in range(0, ticks, 50):
        host.setpoints(targets[first : first + 50], [0] * 50)
        host.run(50)
    return rig, host.samples()


def test_a_sound_rig_trips_over_nothing(library: Path) -> None:
    _, samples = ride(library, sound)
    assert not (samples["status"] & STATUS_LIMIT_TRIPPED).any()


@pytest.mark.parametrize("name", list(FAULTS))
def test_a_sensor_that_fails_ends_the_motion(library: Path, name: str) -> None:
    fault, codes = FAULTS[name]
    rig, samples = ride(library, fault)
    tripped = (samples["status"] & STATUS_LIMIT_TRIPPED) != 0
    assert tripped.any()
    assert Trip(int(samples["status"][-1]) >> TRIP_SHIFT) in codes
    assert (samples["command_e4"][tripped] == 0).all()
    assert np.abs(rig.angles).max() < 3.0


@pytest.mark.parametrize("fault_tick", [100, 300])
@pytest.mark.parametrize("columns", [(SPINDLE,), (SPINDLE, JAW), (MOTOR, SPINDLE, JAW)])
def test_a_dead_encoder_near_the_end_of_travel_lets_the_spindle_hardly_beyond(
    library: Path, columns: tuple[int, ...], fault_tick: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), "FAULT_TICK", fault_tick)
    rig, samples = ride(library, frozen(*columns), start_rad=2.9, stop_rad=2.99)
    assert (samples["status"] & STATUS_LIMIT_TRIPPED).any()
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
