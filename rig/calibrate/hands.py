"""Simulated hands: they carry out the instruction of a step in the simulation."""

import hashlib

import numpy as np
from numpy.typing import NDArray

from calibration.procedure import Step
from calibration.torque import STANDARD_GRAVITY_M_S2, weight_torque_n_m
from drivers.ati_net.driver import AtiNet
from drivers.ati_net.fake import RdtFake, fake_calibration
from drivers.teensy.control import Controllers
from drivers.teensy.fake import PythonBoard
from drivers.transport.simulated import SimulatedTransport
from rig.configuration.config import Config
from rig.simulation.bench import REFERENCE_START_COUNT, SimulatedBench
from rig.simulation.logger import plant_and_sensors
from rig.simulation.press import PressedFsr, press_force_n
from rig.simulation.sensors import COMMAND_E4, DISTAL, FSR, PROXIMAL

MARK_COUNT = 1000
"""Spindle count at which the simulated rig's index mark is lined up."""


class HandledBench:
    """The simulated bench with what hands add to it. Implements `drivers.teensy.logic.Bench`."""

    def __init__(self, config: Config) -> None:
        simulation = config.simulation
        self._plant, self._sensors, self._effects = plant_and_sensors(simulation)
        self._inner = self._made(REFERENCE_START_COUNT, simulation.seed)
        self._seed = simulation.seed
        self._added = np.zeros(COMMAND_E4)
        self._noise = np.random.default_rng(simulation.seed)
        self.fsr: PressedFsr | None = None

    def _made(self, start_count: int, seed: int) -> SimulatedBench:
        return SimulatedBench(self._plant, self._sensors, self._effects, seed, start_count)

    def hang(self, sensor: str, torque_n_m: float) -> None:
        """Put a torque on a sensor, from its weight's arm."""
        column, sign = (PROXIMAL, 1.0) if sensor == "proximal" else (DISTAL, -1.0)
        self._added[column] = sign * torque_n_m / self._sensors.torque_n_m_per_count

    def unbalance(self, sensor: str, counts: float) -> None:
        """Switch a shunt, which changes the reading by so many counts."""
        self._added[PROXIMAL if sensor == "proximal" else DISTAL] = counts

    def turn_to_mark(self) -> None:
        """Turn the spindle by hand until the mark is lined up, to about two counts."""
        self._seed += 1
        at = MARK_COUNT + round(float(self._noise.normal(0.0, 1.5)))
        self._inner = self._made(at, self._seed)

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Run the bench with the actions of the hands; see `drivers.teensy.logic.Bench.advance`."""
        rows = self._inner.advance(setpoints, controllers)
        for column in np.flatnonzero(self._added):
            limit = self._sensors.torque_limit_count
            moved = np.clip(np.round(rows[:, column] + self._added[column]), -limit - 1, limit)
            rows[:, column] = moved.astype(np.int32)
        if self.fsr is not None:
            rows[:, FSR] = self.fsr.counts(len(setpoints))
        return rows


class LoadedRdt(RdtFake):
    """The force sensor's fake with a load of our own on it, counts a unit from its calibration."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._noise = np.random.default_rng(seed)
        self.zero = np.array([3.1, -2.2, 5.7, 0.041, -0.033, 0.012])
        self.wrench = np.zeros(6)
        self.press: NDArray[np.float64] | None = None
        self._pressed = 0

    def load(self, tick: int) -> NDArray[np.int64]:
        """Return the counts of the six axes, int64, shape (6,)."""
        wrench = self.zero + self.wrench
        if self.press is not None:
            wrench[2] += self.press[min(self._pressed, self.press.size - 1)]
            self._pressed += 1
        noise = self._noise.normal(0.0, 1.0, 6) * [0.02, 0.02, 0.02, 5e-4, 5e-4, 5e-4]
        return np.round((wrench + noise) * 1e6).astype(np.int64)

    def begin_press(self, force_n: NDArray[np.float64] | None) -> None:
        """Press from now on with this force a millisecond; None for no press."""
        self.press, self._pressed = force_n, 0


TOOL_KG = 0.215
TOOL_CENTRE_M = np.array([0.004, -0.002, 0.031])
"""Mass and centre of mass of the simulated tool, which are unknown to a session."""


class SimulatedHands:
    """Sets up steps in the simulated world. Implements `calibration.procedure.Operator`."""

    def __init__(self, config: Config) -> None:
        self.bench = HandledBench(config)
        self._board = PythonBoard(self.bench)
        self._rdt = LoadedRdt(config.simulation.seed)
        self._seed = config.simulation.seed

    def open_logger(self) -> SimulatedTransport:
        """Open the way to the simulated logger, the same board each time."""
        return SimulatedTransport(self._board, "sim://", step_s=0.2)

    def open_force_sensor(self) -> AtiNet:
        """Open the simulated force sensor, the same one each time."""
        return AtiNet(SimulatedTransport(self._rdt, "sim://ati-net"), fake_calibration)

    def prepare(self, step: Step) -> None:
        """Do what the step asks for, by its conditions."""
        said = step.conditions
        if "mass_kg" in said:
            torque = weight_torque_n_m(float(said["mass_kg"]), float(said["arm_m"]))
            self.bench.hang(str(said["sensor"]), float(torque))
        if "shunt_ratio" in said:
            change_v_v = float(said["shunt_ratio"]) * float(said.get("shunt_v_v_ratio", 0.0))
            counts = change_v_v * float(said.get("counts_per_v_v_ratio", 0.0))
            self.bench.unbalance(str(said["sensor"]), counts)
        if "mark_ratio" in said:
            self.bench.turn_to_mark()
        if "press_n" in said:
            self._press(step)
        if "gravity_x_ratio" in said:
            down = np.array([float(said[f"gravity_{axis}_ratio"]) for axis in "xyz"])
            force = float(said.get("tool_ratio", 1.0)) * TOOL_KG * STANDARD_GRAVITY_M_S2 * down
            self._rdt.wrench = np.concatenate([force, np.cross(TOOL_CENTRE_M, force)])

    def _press(self, step: Step) -> None:
        said = step.conditions
        seed = int.from_bytes(hashlib.sha256(f"{self._seed}{step.name}".encode()).digest()[:4])
        duration_s = step.duration_s + 1.0
        force = press_force_n(str(said["profile"]), float(said["press_n"]), duration_s, seed)
        self._rdt.begin_press(force)
        self.bench.fsr = PressedFsr(force, seed)
