"""The simulated grasper behind its board: three axes, their sensors, and the board in one loop.

Within a tick of 0.5 ms: sensors are sampled, the board computes from them, the physics moves.
"""

import hashlib

import numba
import numpy as np
from numpy.typing import NDArray

from drivers.teensy import control
from drivers.teensy.control import Controllers
from drivers.teensy.grasper import GRASPER
from drivers.teensy.logic import FORCE_MAX
from rig.grasper import plant as grasper_plant
from rig.grasper.plant import PROTOTYPES, Prototype, vary
from rig.simulation import noise
from rig.simulation.bench import call_board_tick, hash_of

MOTORS, INPUTS = GRASPER.motors, len(GRASPER.input_names)
COUNTS_A_TURN = 2048
"""Of each motor's encoder."""
FULL_SCALE_A = 2.0
"""Current of a full command."""
COUNTS_A_NEWTON = 4095 / 4.4
FORCE_ZERO = 100.0
"""Counts of a force sensor's amplifier without force, so that one that lives is seen to."""
_COUNTS_A_RADIAN = COUNTS_A_TURN / (2 * np.pi)


@numba.njit()
def _sample(state, rig, tick, row):  # type: ignore[no-untyped-def]
    axes, currents, seed = rig
    for k in range(MOTORS):
        p, angle = axes[k], state[k, grasper_plant.ANGLE]
        row[k] = np.floor(angle * p.gearhead_ratio * _COUNTS_A_RADIAN)
        current = currents[k] + p.current_offset_a
        current += p.current_noise_a * noise.normal(seed, tick, k)
        row[MOTORS + k] = np.floor(1e3 * current + 0.5)
        force = grasper_plant.contact_torque(p, angle) / p.arm_m
        force += p.force_noise_n * noise.normal(seed, tick, MOTORS + k)
        converted = np.floor(FORCE_ZERO + COUNTS_A_NEWTON * force + 0.5)
        row[2 * MOTORS + k] = min(max(converted, 0), FORCE_MAX)


@numba.njit()
def _move(state, rig, commands_e4):  # type: ignore[no-untyped-def]
    axes, currents, _seed = rig
    for k in range(MOTORS):
        currents[k] = FULL_SCALE_A * 1e-4 * commands_e4[k]
        grasper_plant.step_axis(state[k], axes[k], currents[k], 1.0)


def _build_loops(source: str):  # type: ignore[no-untyped-def]
    """Return the compiled loops; `source` is part of the cache's key, see `bench`."""

    @numba.njit(cache=True)
    def with_controllers(  # type: ignore[no-untyped-def]
        state, rig, first_tick, targets, memory, gains, rows
    ):
        _ = source
        for k in range(rows.shape[0]):
            row = rows[k]
            _sample(state, rig, first_tick + k, row)
            for motor in range(MOTORS):
                row[INPUTS + motor] = control.control_tick(
                    memory[motor], gains[motor], targets[k, motor], row[motor], row[motor]
                )
            _move(state, rig, row[INPUTS:])

    @numba.njit(cache=True)
    def with_board(  # type: ignore[no-untyped-def]
        state, rig, first_tick, ticks, call, clock_us
    ):
        _ = source
        function, board = call
        tick_us, period_us = clock_us
        inputs = np.zeros(INPUTS, np.int32)
        outputs = np.zeros(MOTORS, np.int32)
        for k in range(ticks):
            _sample(state, rig, first_tick + k, inputs)
            now_us = np.uint32(tick_us + period_us * k)
            call_board_tick(function, board, now_us, inputs.ctypes.data, outputs.ctypes.data)
            _move(state, rig, outputs)

    return with_controllers, with_board


_run_with_controllers, _run_with_board = _build_loops(hash_of((control, grasper_plant, noise)))


class GrasperBench:
    """A grasper in virtual time: the same seed gives the same counts however the calls are cut.

    Its yaw and its two jaws are the three axes. `spread` is the standard deviation of the logarithm
    of each hidden parameter, which differ from grasper to grasper.
    """

    def __init__(
        self, prototype: Prototype = PROTOTYPES["third"], seed: int = 0, spread: float = 0.0
    ) -> None:
        (yaw,), (jaw_1, jaw_2) = prototype.axes["yaw"], prototype.axes["grasp"]
        varied = [vary(axis, seed + k, spread) for k, axis in enumerate((yaw, jaw_1, jaw_2))]
        self._axes = tuple(axis.compiled for axis in varied)
        self._state = np.zeros((MOTORS, 3))
        noise_seed = np.uint64(int.from_bytes(hashlib.sha256(str(seed).encode()).digest()[:8]))
        self._rig = (self._axes, np.zeros(MOTORS), noise_seed)
        self._ticks = 0

    @property
    def force_n(self) -> NDArray[np.float64]:
        """The true force at each axis' tip."""
        angles = self._state[:, grasper_plant.ANGLE]
        pairs = zip(self._axes, angles, strict=True)
        return np.array([grasper_plant.contact_torque(p, q) / p.arm_m for p, q in pairs])

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Run ticks with the controllers inside; see `drivers.teensy.logic.Bench.advance`."""
        rows = np.zeros((len(setpoints), INPUTS + MOTORS), np.int32)
        memory, gains = controllers.state, controllers.gains
        _run_with_controllers(self._state, self._rig, self._ticks, setpoints, memory, gains, rows)
        self._ticks += len(setpoints)
        return rows

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run ticks with a board in the loop; see `drivers.teensy.core.FirmwareBench`."""
        call, clock_us = (tick_address, board_address), (tick_us, GRASPER.tick_us)
        _run_with_board(self._state, self._rig, self._ticks, ticks, call, clock_us)
        self._ticks += ticks
