"""The simulated rig behind an EPOS4: the drive's fake on a virtual bus, the plant as its motor.

Not modelled, in addition to the limits of the drive's fake: the load motor, which this rig lacks.
"""

import ctypes
import os

from drivers.epos4.driver import Epos4
from drivers.epos4.fake import Epos4Fake
from drivers.transport.can_bus import CanBus
from drivers.transport.python_can import open_can
from drivers.transport.simulated_can import LiveCanBus, SimulatedCanBus
from rig.configuration.config import Config
from rig.logic.link import LogicLink
from rig.simulation.bench import SimulatedBench
from rig.simulation.logger import plant_and_sensors

_COUNTS = ctypes.POINTER(ctypes.c_int32)
_TICK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, _COUNTS, _COUNTS)


class PlantMotor:
    """The plant as `drivers.epos4.fake.Motor`: torque in, encoder out."""

    def __init__(self, bench: SimulatedBench) -> None:
        self._bench = bench
        self._command_a_torque = -1e4 / (
            bench.parameters.torque_constant_n_m_a * bench.parameters.command_full_scale_a
        )
        self._command_e4 = 0
        self._position_count = 0
        self._tick = _TICK(self._exchange)
        self._address = ctypes.cast(self._tick, ctypes.c_void_p).value or 0

    def __call__(self, torque_n_m: float, ticks: int) -> int:
        """Move for `ticks` milliseconds and return the position, counts."""
        self._command_e4 = round(self._command_a_torque * torque_n_m)
        self._bench.advance_with_board(ticks, self._address, 0, 0)
        return self._position_count

    def _exchange(self, board: int, tick_us: int, inputs, outputs) -> None:  # type: ignore[no-untyped-def]
        self._position_count = inputs[0]
        outputs[0] = self._command_e4
        outputs[1] = 0


def open_simulated_canopen(config: Config) -> LogicLink:
    """Return the link to the logic of a simulated CANopen rig, in virtual time."""
    bus = open_simulated_bus(config)
    return LogicLink(Epos4(bus, **config.logger.options), bus.url)


def open_simulated_bus(config: Config) -> CanBus:
    """Return the host's place on a bus with a drive's fake, in virtual time."""
    return SimulatedCanBus([_drive(config)], "sim://epos4")


def open_live_bus(config: Config) -> CanBus:
    """Return the host's place on a virtual bus of python-can with a drive's fake, in real time."""
    channel = f"can:virtual:rig-{os.getpid()}"
    drive = _drive(config)
    drive.advance(1)  # the plant is compiled the first time, which takes longer than a drive may
    return LiveCanBus(open_can(channel), open_can(channel), [drive])


def _drive(config: Config) -> Epos4Fake:
    """Return the drive's fake with the plant as its motor."""
    plant, sensors, effects = plant_and_sensors(config.simulation)
    bench = SimulatedBench(plant, sensors, effects, config.simulation.seed)
    constant = round(plant.torque_constant_n_m_a * 1e6)
    objects = {(0x3001, 5): constant, (0x6076, 0): constant * 700 // 1000}
    return Epos4Fake(config.logger.options.get("node_id", 1), PlantMotor(bench), objects)
