"""A drawn rig with its protocol and sensors, and what it records with effects switched on.

What does not change with an effect is worked out once: the plant's motion without effects, and the
noise of every run, which is the same with and without.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.rigs import kernel, residual
from benchmarks.rigs.drawn import Drawn
from benchmarks.rigs.hidden import MOST, Hidden, rows_of
from benchmarks.rigs.plant import Controller, Plant
from benchmarks.rigs.protocol import LEAD_S, Plan, Protocol
from benchmarks.rigs.residual import Prepared
from benchmarks.rigs.sensors import READINGS, Chain, Fault, error_of, noise_of, read
from estimation.recording import FloatArray, Instrument, Recording

EPOCH_NS = 1_700_000_000_000_000_000
RATE_HZ = 1000.0
FIRST = round(LEAD_S * RATE_HZ)
"""Sample at which a run begins, behind its lead."""


@dataclass(frozen=True)
class Switched:
    """An effect with its amplitude and the runs that have it."""

    drawn: Drawn
    amplitude: float
    runs: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Moved:
    """What the plant did in one run, from the lead on.

    Attributes:
        true: Columns as the compiled loop's, shape (n, 8).
        added: What each effect adds at its place, and a pulley's torque, shape (n, 2 x most).
    """

    true: FloatArray
    added: FloatArray


FEWEST = 100
"""A run of fewer samples in motion, of 100 a second, barely moves."""


class UnstableError(Exception):
    """A drawn rig does not work: it is drawn again."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A rig, its protocol and its sensors.

    Attributes:
        controller: Kind and gains.
        protocol: How its runs were made up.
        seed: Seed of the noise.
        clean: Runs without effects that were played.
        noise: Noise of runs that was drawn.
    """

    plant: Plant
    controller: tuple[str, Controller]
    protocol: Protocol
    plans: tuple[Plan, ...]
    chain: Chain
    seed: int
    clean: dict[int, Moved] = field(default_factory=dict, repr=False)
    noise: dict[int, tuple[FloatArray, ...]] = field(default_factory=dict, repr=False)

    def moved(self, index: int, switched: Sequence[Switched] = ()) -> Moved:
        """Return the motion of the plant in one run; kept where no effect moves it.

        Raises:
            UnstableError: The motion does not stay finite.
        """
        inside = [s for s in switched if index in s.runs and isinstance(s.drawn.part, Hidden)]
        if not inside and index in self.clean:
            return self.clean[index]
        plan = self.plans[index]
        parts = [s.drawn.part for s in inside if isinstance(s.drawn.part, Hidden)]
        rows = rows_of(parts, [s.amplitude for s in inside])
        n = len(plan.setpoints)
        out, added = np.zeros((n, kernel.LOGGED)), np.zeros((n, 2 * MOST))
        fine = kernel.play(
            self.plant, self.controller[1], plan.load, rows, plan.setpoints,
            plan.level_n_m, plan.jumps, (float(FIRST), plan.start_s), out, added,
        )  # fmt: skip
        if not fine or not np.isfinite(out).all():
            raise UnstableError(plan.name)
        moved = Moved(out, added)
        if not inside:
            self.clean[index] = moved
        return moved

    def errors(
        self, index: int, moved: Moved, switched: Sequence[Switched]
    ) -> dict[str, FloatArray]:
        """Return the additions of faulty sensors in one run: channel to values from the lead on."""
        faults = [s for s in switched if index in s.runs and isinstance(s.drawn.part, Fault)]
        true = {name: moved.true[:, k] for k, name in enumerate(READINGS)}
        found: dict[str, FloatArray] = {}
        for s in faults:
            assert isinstance(s.drawn.part, Fault)
            error = error_of(s.drawn.part, s.amplitude, true, FIRST, self.plans[index].start_s)
            found[s.drawn.part.reading] = found.get(s.drawn.part.reading, 0.0) + error
        return found

    def record(
        self, index: int, switched: Sequence[Switched] = (), silent: bool = False
    ) -> Recording:
        """Return one run's recording; a silent one is without sensor noise, lags and steps."""
        plan, moved = self.plans[index], self.moved(index, switched)
        errors = self.errors(index, moved, switched)
        chain = self.chain.on_time if silent else self.chain
        if index not in self.noise:
            self.noise[index] = noise_of(self.chain, len(moved.true), (self.seed, index))
        readings = read(chain, moved.true, errors, None if silent else self.noise[index])
        columns = {name: values[FIRST:] for name, values in readings.items()}
        limit = self.controller[1].limit_a
        columns["target_angle_rad"] = plan.setpoints[FIRST:, 0]
        columns["motor_command_ratio"] = moved.true[FIRST:, kernel.COMMAND] / limit
        columns["load_command_a"] = moved.true[FIRST:, kernel.LOAD] / self.plant.load_constant
        return Recording(
            plan.name,
            np.arange(len(plan.setpoints) - FIRST) / RATE_HZ,
            columns,
            conditions=plan.conditions,
            rig=f"simulated rig {self.seed}",
            instrument=Instrument(model="simulated", serial=f"SIM-{self.seed}", side="left"),
            started_at_ns=EPOCH_NS + round(plan.start_s * 1e9),
            source="simulated",
        )

    def prepared(
        self, runs: Sequence[int], switched: Sequence[Switched] = (), silent: bool = False
    ) -> list[Prepared]:
        """Return some runs' channels, filtered as the declared equations say.

        Raises:
            UnstableError: A run barely moves.
        """
        found = []
        for k in runs:
            run = residual.prepare(self.record(k, switched, silent), self.plant.ratio)
            if min(len(places) for places in run.places.values()) < FEWEST:
                raise UnstableError(self.plans[k].name)
            found.append(run)
        return found

    def forget(self) -> None:
        """Drop what was kept to build it faster; it is made again when asked for."""
        self.clean.clear()
        self.noise.clear()

    @property
    def every(self) -> tuple[int, ...]:
        """Places of all runs."""
        return tuple(range(len(self.plans)))


def signature(place: str, plant: Plant) -> Mapping[str, float]:
    """Return the share of an effect at a place in each equation's target, for one unit.

    The torque constant's share is logged as a torque lost at the motor; the pulley's second part,
    a torque at the spindle, is the cable's.
    """
    if place in ("motor", "constant"):
        return {"motor": -plant.ratio}
    if place == "jaw":
        return {"cable": plant.pull, "stretch": -1.0 / plant.cable_stiffness}
    return {
        "gear": {"gearbox": 1.0},
        "spindle": {"cable": 1.0},
        "cable": {"stretch": -1.0},
        "pulley": {"stretch": 1.0},
    }[place]
