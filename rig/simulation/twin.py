"""The simulated null: campaigns of a declared model with a recording's references and sensors.

A simulated null contains the effects of the declared equations only, run through the same
controller, loads, quantisation and noise, and logged at the same instants. A finding on it is an
artefact of the method: the null of a parametric bootstrap (Efron and Tibshirani, "An Introduction
to the Bootstrap", 1993, chapter 6).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign
from estimation.model import Model
from estimation.recording import FloatArray, Instrument, Recording
from rig.errors import DataError
from rig.protocols.motion import motion_of
from rig.protocols.protocol import RunPlan
from rig.protocols.trajectory import SAMPLE_RATE_HZ
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import noise_std, plant_of, sensors_of, with_load_unit, with_quanta
from rig.simulation.parameters import PlantParameters, SensorParameters
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of

NEEDED = (
    "target_angle_rad",
    "load_command_a",
    "motor_angle_rad",
    "spindle_angle_rad",
    "jaw_angle_rad",
    "proximal_torque_n_m",
    "distal_torque_n_m",
    "motor_current_a",
)
"""Channels that a recording needs for a simulated null."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The properties of a recorded run that its simulated nulls share.

    Attributes:
        plan: Trajectory and load at 1 kHz, from the run's first sample to its last.
        time_s: Device time of the recorded samples, shape (n,).
        tick: Tick of each recorded sample in the plan, shape (n,).
        flags: Of the recorded samples, shape (n,).
        start_rad: Where the spindle stood at the first sample.
        started_at_ns: Start of the run, or None.
        instrument: Identity of the instrument.
        others: Recorded channels that no plant simulates, such as a temperature; the nulls share
            them.
    """

    plan: RunPlan
    time_s: FloatArray
    tick: NDArray[np.int64]
    flags: NDArray[np.uint8]
    start_rad: float
    started_at_ns: int | None
    instrument: Instrument
    others: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Twin:
    """Makes campaigns of the declared model. It can be sent to another process.

    Attributes:
        plant: Parameters from the fitted models.
        sensors: Quanta and noise of the recordings.
        references: One a run.
    """

    plant: PlantParameters
    sensors: SensorParameters
    references: tuple[Reference, ...]

    def play(self, plan: RunPlan, seed: int) -> Recording:
        """Return one simulated run of another plan: the same rig, another motion and load."""
        size = plan.target_angle_rad.size
        first = self.references[0]
        reference = Reference(
            plan=plan,
            time_s=np.arange(size) / SAMPLE_RATE_HZ,
            tick=np.arange(size),
            flags=np.zeros(size, np.uint8),
            start_rad=float(plan.target_angle_rad[0]),
            started_at_ns=None,
            instrument=first.instrument,
            others={name: np.full(size, x.mean()) for name, x in first.others.items()},
        )
        return simulate(reference, self.plant, self.sensors, seed)

    def __call__(self, seed: int) -> tuple[Recording, ...]:
        """Return one campaign's recordings; the same seed gives the same samples."""
        return tuple(
            simulate(reference, self.plant, self.sensors, seed * 100_003 + index)
            for index, reference in enumerate(self.references)
        )


def build_twin(models: Iterable[Model], campaign: Campaign) -> Twin:
    """Return a maker of simulated nulls of a campaign.

    Raises:
        DataError: The campaign is empty, a run lacks something needed, or a model makes no plant.
        NotFittedError: A model has no values.
    """
    runs = list(campaign.evidence)
    if not runs:
        raise DataError("No runs for a simulated null.", fix="Name a folder with recordings.")
    references = tuple(reference_of(run) for run in runs)
    plant = with_load_unit(plant_of(models), runs)
    plant = replace(plant, jaw_zero_rad=_jaw_zero(plant, runs))
    quanta = with_quanta(SensorParameters(), runs[0])
    still = simulate(references[0], plant, quanta, seed=0)
    silent = {
        name: noise_std(still[name], still.sample_rate_hz)
        for name in ("proximal_torque_n_m", "distal_torque_n_m", "motor_current_a")
    }
    return Twin(plant, sensors_of(runs, silent, quanta), references)


def reference_of(run: Recording) -> Reference:
    """Return the properties of a recorded run that its simulated nulls share.

    Raises:
        DataError: The run lacks a channel, or was recorded without a trajectory.
    """
    missing = [name for name in NEEDED if name not in run]
    if missing:
        raise DataError(
            f"Run {run.name!r} can have no simulated null: it lacks {', '.join(missing)}.",
            "It needs the same trajectory and load, and must have the same channels.",
        )
    if np.ptp(run["target_angle_rad"]) == 0.0 and np.ptp(run["spindle_angle_rad"]) > 0.05:
        raise DataError(
            f"Run {run.name!r} can have no simulated null: its trajectory was not recorded.",
            "The spindle moves, and its target is constant.",
        )
    elapsed = run.time_s - run.time_s[0]
    tick = np.rint(elapsed * SAMPLE_RATE_HZ).astype(np.int64)
    grid = np.arange(tick[-1] + 1) / SAMPLE_RATE_HZ
    plan = RunPlan(
        run.name,
        np.interp(grid, elapsed, run["target_angle_rad"]),
        np.interp(grid, elapsed, run["load_command_a"]),
        dict(run.conditions),
    )
    return Reference(
        plan=plan,
        time_s=run.time_s,
        tick=tick,
        flags=run.flags,
        start_rad=float(run["spindle_angle_rad"][0]),
        started_at_ns=run.started_at_ns,
        instrument=run.instrument,
        others={name: values for name, values in run.columns.items() if name not in NEEDED},
    )


def simulate(
    reference: Reference, plant: PlantParameters, sensors: SensorParameters, seed: int
) -> Recording:
    """Return one simulated run with the reference's trajectory, load and instants.

    The load is ramped up before the run, as when it was recorded, so that it starts wound up.
    """
    bench = SimulatedBench(
        plant, sensors, seed=seed, start_count=spindle_count_of(reference.start_rad, sensors)
    )
    motion = motion_of(reference.plan, float(reference.plan.target_angle_rad[0]))
    played = play(bench, *(values[: motion.last] for values in motion.setpoints))
    logged = motion.first + reference.tick
    return Recording(
        reference.plan.name,
        reference.time_s,
        {**reference.others, **{name: values[logged] for name, values in played.items()}},
        flags=reference.flags,
        conditions=reference.plan.conditions,
        rig="simulated null",
        instrument=reference.instrument,
        started_at_ns=reference.started_at_ns,
        source=f"simulated null, seed {seed}",
    )


def _jaw_zero(plant: PlantParameters, runs: Sequence[Recording]) -> float:
    zeros = [
        np.median(
            run["jaw_angle_rad"]
            - plant.cable_ratio * run["spindle_angle_rad"]
            + run["distal_torque_n_m"] / plant.cable_stiffness_n_m_rad
        )
        for run in runs
    ]
    return float(np.median(zeros))
