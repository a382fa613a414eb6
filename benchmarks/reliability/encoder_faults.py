"""Encoders and the current read-back that fail while the rig moves, held by the firmware core.

The plant is small and stiff: every torque of the motor turns the shaft, so what the limits allow is
what the shaft does.
"""

import ctypes
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.errors import CommandRefusedError
from drivers.teensy.core import TICK, FirmwareBench, FirmwareBoard
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import Trip
from drivers.transport.simulated import SimulatedTransport
from rig.configuration.config import load_config
from rig.machines.choose import machine_of

MOTOR, SPINDLE, JAW, PROXIMAL, DISTAL, CURRENT = range(6)
PER_RAD = 4096 * 35 / math.tau, -8192 / math.tau, 4000 * 0.913 / math.tau
AT_ZERO = 0.0, 0.0, 1.272 * 4000 / math.tau
FAULT_TICK = 300
BLOCK = 50

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
        """Run ticks; see `drivers.teensy.core.FirmwareBench.advance_with_board`."""
        tick = TICK(tick_address)
        outputs = (ctypes.c_int32 * 2)()
        for k in range(ticks):
            counts = [
                math.floor(self.angle_rad * per_rad + zero)
                for per_rad, zero in zip(PER_RAD, AT_ZERO, strict=True)
            ]
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


def frozen(*columns: int, since: int = FAULT_TICK, counted_tenths: int = 0) -> Fault:
    """Return the fault of encoders that count no further, or only some tenths of what moves."""
    kept: dict[int, int] = {}

    def fault(tick: int, counts: list[int]) -> list[int]:
        for column in columns:
            if tick < since:
                kept[column] = counts[column]
            counts[column] = kept[column] + (counts[column] - kept[column]) * counted_tenths // 10
        return counts

    return fault


def losing(*columns: int) -> Fault:
    """Return the fault of encoders that lose every tenth count."""
    return frozen(*columns, counted_tenths=9)


def reversed_encoder(column: int) -> Fault:
    """Return the fault of an encoder whose lines A and B are swapped."""

    def fault(_tick: int, counts: list[int]) -> list[int]:
        counts[column] = -counts[column]
        return counts

    return fault


def swapped(one: int, other: int) -> Fault:
    """Return the fault of two encoders at one another's plugs."""

    def fault(_tick: int, counts: list[int]) -> list[int]:
        counts[one], counts[other] = counts[other], counts[one]
        return counts

    return fault


def dead_read_back(tick: int, counts: list[int]) -> list[int]:
    """Show a current about 0, whatever flows."""
    counts[CURRENT] = tick % 3
    return counts


def lost_edges(tick: int, counts: list[int]) -> list[int]:
    """Let the spindle's count jump once."""
    counts[SPINDLE] += 500 if tick > 2 * FAULT_TICK else 0
    return counts


def sound(_tick: int, counts: list[int]) -> list[int]:
    """Change nothing."""
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
    "motor and spindle swapped": (
        swapped(MOTOR, SPINDLE),
        {Trip.ENCODERS_DISAGREE, Trip.ENCODER_FROZEN},
    ),
    "jaw and spindle swapped": (
        swapped(JAW, SPINDLE),
        {Trip.ENCODERS_DISAGREE, Trip.JAW_TRAVEL, Trip.FOLLOWING_ERROR},
    ),
    "spindle jumps": (lost_edges, {Trip.ENCODER_JUMP}),
}


def armed(bench: FirmwareBench, library: Path | None) -> TeensyLogger:
    """Return the logger of a board under the gains and limits of the reference rig."""
    config = load_config(Path("reference"))
    machine = machine_of(config)
    board = FirmwareBoard(bench, library=library)
    logger = TeensyLogger(SimulatedTransport(board, step_s=BLOCK * 1e-3))
    logger.start()
    logger.arm(machine.gains(config), machine.board_limits(config, config.calibration_set()))
    return logger


def ride(
    fault: Fault,
    ticks: int = 4000,
    start_rad: float = 0.0,
    stop_rad: float = 0.5,
    library: Path | None = None,
) -> tuple[SmallRig, NDArray[np.void], Trip]:
    """Turn the spindle at 0.2 rad/s under the shipped limits.

    Returns:
        The rig, the samples, and what the board tripped over.
    """
    rig = SmallRig(fault, start_rad)
    moved = np.arange(ticks) * 1e-3 * math.copysign(0.2, stop_rad - start_rad)
    target_rad = start_rad + np.clip(moved, *sorted((0.0, stop_rad - start_rad)))
    targets = np.round(target_rad * PER_RAD[SPINDLE]).astype(np.int32)
    samples = []
    logger = armed(rig, library)
    for first in range(0, ticks, BLOCK):
        block = targets[first : first + BLOCK]
        try:
            logger.queue(block, np.zeros(block.size, np.int32))
        except CommandRefusedError:
            break
        samples.append(logger.read(BLOCK * 1e-3).samples)
    return rig, np.concatenate(samples), logger.trip().code
