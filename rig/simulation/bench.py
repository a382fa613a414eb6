"""The simulated bench: plant, sensors and controller in one compiled loop.

Order within a tick: sensors are sampled, the controller computes this tick's command from them, the
row is written, then the physics moves 1 ms with that command.
"""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from drivers.teensy import control
from drivers.teensy.control import Controllers
from estimation.recording import FloatArray
from rig.errors import UsageError
from rig.simulation import (
    hidden,
    hidden_cable,
    hidden_drive,
    hidden_sensors,
    noise,
    parameters,
    places,
    plant,
    sensors,
)
from rig.simulation.parameters import (
    REFERENCE_GAINS,
    PlantParameters,
    SensorParameters,
    compiled,
)

REFERENCE_START_COUNT = 1366
"""Spindle count at which the reference campaign's runs start: 60 degrees open."""


class BenchInputError(UsageError):
    """The bench was asked for something it cannot run."""


SOURCES = (
    control, hidden, hidden_cable, hidden_drive, hidden_sensors, noise, parameters, places, plant,
    sensors,
)  # fmt: skip
"""What the compiled loops are made of."""


def hash_of(modules: Iterable[ModuleType]) -> str:
    """Return a hash of every source that compiled loops are made of.

    Numba's cache checks only the file of a function. The loops hold this hash as a
    closure variable, which is part of the cache's key, so a change in any of the files recompiles.
    It is the only closure variable: a function held that way would change the key in each process.
    """
    digest = hashlib.sha256()
    for module in modules:
        digest.update(Path(str(module.__file__)).read_bytes())
    return digest.hexdigest()


def _board_call(
    typing_context: Any, function: Any, board: Any, tick_us: Any, inputs: Any, outputs: Any
) -> Any:
    """Call `void tick(void *board, uint32_t us, const int32_t *inputs, int32_t *outputs)`."""
    from llvmlite import ir  # type: ignore[import-untyped]

    signature = types.void(types.intp, types.intp, types.uint32, types.intp, types.intp)

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, ir.IntType(32), pointer, pointer])
        callee = builder.inttoptr(arguments[0], kind.as_pointer())
        board, inputs, outputs = (builder.inttoptr(arguments[k], pointer) for k in (1, 3, 4))
        builder.call(callee, [board, arguments[2], inputs, outputs])
        return context.get_dummy_value()

    return signature, build


call_board_tick: Any = intrinsic(_board_call)
"""For compiled loops with a board behind a pointer."""


def _build_loops(source: str) -> tuple[Callable[..., None], Callable[..., None]]:
    """Return the compiled loops: with the controller inside, and with a board called by pointer."""

    @numba.njit(cache=True)
    def with_controller(  # type: ignore[no-untyped-def]
        state, rig, first_tick, setpoints, controller, rows
    ):
        _ = source
        p, s, table, seed = rig
        effects = table[0]
        memory, gains = controller
        for k in range(rows.shape[0]):
            row = rows[k]
            sensors.sample(state, s, effects, seed, first_tick + k, row)
            row[sensors.COMMAND_E4] = control.control_tick(
                memory, gains, setpoints[k, 0], row[sensors.SPINDLE], row[sensors.MOTOR]
            )
            current = -p.command_full_scale_a * 1e-4 * row[sensors.COMMAND_E4]
            plant.step_tick(state, p, effects, current, 1e-3 * setpoints[k, 1])

    @numba.njit(cache=True)
    def with_board(  # type: ignore[no-untyped-def]
        state, rig, first_tick, ticks, call, tick_us
    ):
        _ = source
        p, s, table, seed = rig
        effects = table[0]
        function, board = call
        inputs = np.zeros(7, np.int32)
        outputs = np.zeros(2, np.int32)
        for k in range(ticks):
            sensors.sample(state, s, effects, seed, first_tick + k, inputs)
            now_us = np.uint32(tick_us + 1000 * k)
            call_board_tick(function, board, now_us, inputs.ctypes.data, outputs.ctypes.data)
            current = -p.command_full_scale_a * 1e-4 * outputs[0]
            plant.step_tick(state, p, effects, current, 1e-3 * outputs[1])

    return with_controller, with_board


_run_with_controller, _run_with_board = _build_loops(hash_of(SOURCES))


class SimulatedBench:
    """A rig in virtual time: the same seed gives the same counts however the calls are cut.

    The seed is that of the sensors' noise and drift. The rig stands at rest at `start_count` of the
    spindle encoder, with no torque.
    """

    def __init__(
        self,
        parameters: PlantParameters | None = None,
        sensors_parameters: SensorParameters | None = None,
        effects: Iterable[hidden.HiddenEffect] = (),
        seed: int = 0,
        start_count: int = REFERENCE_START_COUNT,
    ) -> None:
        self.parameters = parameters or PlantParameters()
        self.sensors = sensors_parameters or SensorParameters()
        self.ticks_done = 0
        start_rad = -(start_count + 0.5) * sensors.TURN_RAD / self.sensors.spindle_count_per_turn
        self._state = plant.rest_state(self.parameters, start_rad)
        self._rig = (
            compiled(self.parameters),
            compiled(self.sensors),
            hidden.table(effects),
            np.uint64(int.from_bytes(hashlib.sha256(str(seed).encode()).digest()[:8])),
        )

    @property
    def state(self) -> NDArray[np.float64]:
        """A copy of the plant's true state, see `rig.simulation.places`."""
        return self._state.copy()

    def play(
        self, target_angle_rad: FloatArray, load_command_a: FloatArray
    ) -> dict[str, FloatArray]:
        """Run the armed bench along a spindle trajectory at 1 kHz, closing positive, shape (n,).

        It has the reference gains and a fresh controller. Returns SI channels of shape (n,), as
        `sensors.columns_of`.
        """
        per_rad = self.sensors.spindle_count_per_turn / sensors.TURN_RAD
        asked = np.column_stack((-target_angle_rad * per_rad, 1e3 * load_command_a))
        setpoints = np.round(asked).astype(np.int32)
        counts = self.advance(setpoints, Controllers.fresh(REFERENCE_GAINS))
        return sensors.columns_of(counts, setpoints, self.sensors)

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Run closed-loop ticks of 1 ms with the plain board's controller, without guards.

        The setpoints are the spindle's target, encoder counts, and the load motor's current, mA,
        shape (ticks, 2). The controller is changed in place.

        Returns:
            Counts with raw signs, shape (ticks, 8): seven inputs and the command.
        """
        rows = np.empty((len(setpoints), sensors.COMMAND_E4 + 1), np.int32)
        controller = controllers.state[0], controllers.gains[0]
        _run_with_controller(self._state, self._rig, self.ticks_done, setpoints, controller, rows)
        self.ticks_done += len(setpoints)
        return rows

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run ticks with a board in the loop; see `drivers.teensy.core.FirmwareBench`.

        The compiled loop calls it by pointer; the address may be 0 if the function takes that.

        Raises:
            BenchInputError: The function's address is null or the number of ticks negative.
        """
        if tick_address == 0 or ticks < 0:
            raise BenchInputError(
                f"A board cannot be run for {ticks} ticks through address {tick_address:#x}.",
                fix="Pass the address of the loaded library's `rig_board_tick`.",
            )
        call = tick_address, board_address
        _run_with_board(self._state, self._rig, self.ticks_done, ticks, call, tick_us)
        self.ticks_done += ticks
