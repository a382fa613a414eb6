"""The simulated rig of fitted models and their recordings: plant, load unit and sensors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from estimation.model import Model
from estimation.recording import FloatArray, Instrument, Recording
from rig.errors import DataError
from rig.protocols.protocol import RunPlan
from rig.protocols.trajectory import SAMPLE_RATE_HZ
from rig.simulation.campaign import bench_at, simulated_run
from rig.simulation.fitted import plant_of
from rig.simulation.parameters import PlantParameters, SensorParameters

NOISE_ABOVE_HZ = 150.0
"""White noise is measured above this frequency, where the rig barely moves."""

PLAYED = (
    "target_angle_rad", "load_command_a", "motor_angle_rad", "spindle_angle_rad", "jaw_angle_rad",
    "proximal_torque_n_m", "distal_torque_n_m", "motor_current_a",
)  # fmt: skip
"""Channels that the recordings of a fitted rig need."""

NOISY = {
    "proximal_torque_n_m": "proximal_noise_n_m",
    "distal_torque_n_m": "distal_noise_n_m",
    "motor_current_a": "current_noise_a",
}
"""Channel with white noise to the parameter of its sensor."""


@dataclass(frozen=True, eq=False)
class FittedRig:
    """A rig with the effects of fitted models only. It can be sent to another process."""

    plant: PlantParameters  # parameters from the models
    sensors: SensorParameters  # quanta and noise of the recordings
    instrument: Instrument  # identity of the recordings' instrument
    # means of recorded channels that no plant simulates, such as a temperature
    others: Mapping[str, float]

    def play(self, plan: RunPlan, seed: int) -> Recording:
        """Return one simulated run of a plan; the same seed gives the same samples."""
        made = _played(plan, self.plant, self.sensors, seed)
        others = {name: np.full(len(made), value) for name, value in self.others.items()}
        return replace(made, instrument=self.instrument, columns={**others, **made.columns})


def fitted_rig(models: Iterable[Model], runs: Sequence[Recording]) -> FittedRig:
    """Return the rig of models that were fitted on runs.

    Raises:
        EstimationError: A run lacks one of `PLAYED`, or a model has no values.
        DataError: There are no runs, a model makes no plant, or the trajectory was not recorded.
    """
    if not runs:
        raise DataError("There are no runs to fit a rig on.")
    plant = _with_load_unit(plant_of(models), runs)
    plant = replace(plant, jaw_zero_rad=_jaw_zero(plant, runs))
    plan, tick = recorded_plan(runs[0])
    quanta = _with_quanta(runs[0])
    still = _played(plan, plant, quanta, 0)
    silent = {name: noise_std(still[name][tick], runs[0].sample_rate_hz) for name in NOISY}
    others = {n: float(x.mean()) for n, x in runs[0].columns.items() if n not in PLAYED}
    return FittedRig(plant, _with_noise(quanta, runs, silent), runs[0].instrument, others)


def recorded_plan(run: Recording) -> tuple[RunPlan, NDArray[np.int64]]:
    """Return trajectory and load of a recorded run at 1 kHz, and the place of each sample there.

    Raises:
        DataError: The spindle moves, and its target is constant.
    """
    if np.ptp(run["target_angle_rad"]) == 0.0 and np.ptp(run["spindle_angle_rad"]) > 0.05:
        raise DataError(f"Run {run.name!r} was recorded without its trajectory.")
    elapsed = run.time_s - run.time_s[0]
    tick = np.rint(elapsed * SAMPLE_RATE_HZ).astype(np.int64)
    grid = np.arange(tick[-1] + 1) / SAMPLE_RATE_HZ
    target, load = (np.interp(grid, elapsed, run[name]) for name in PLAYED[:2])
    return RunPlan(run.name, target, load, dict(run.conditions)), tick


def _played(
    plan: RunPlan, plant: PlantParameters, sensors: SensorParameters, seed: int
) -> Recording:
    bench = bench_at(float(plan.target_angle_rad[0]), plant, sensors, seed=seed)
    return simulated_run(bench, plan, f"simulated, seed {seed}")


def _jaw_zero(plant: PlantParameters, runs: Sequence[Recording]) -> float:
    zeros = []
    for run in runs:
        stretch = run["distal_torque_n_m"] / plant.cable_stiffness_n_m_rad
        wound = plant.cable_ratio * run["spindle_angle_rad"]
        zeros.append(np.median(run["jaw_angle_rad"] - wound + stretch))
    return float(np.median(zeros))


def _with_load_unit(plant: PlantParameters, runs: Sequence[Recording]) -> PlantParameters:
    """Return the plant with the load unit the runs show: torque a load current, and friction.

    Least squares of distal torque on the load's current, the smooth direction of the spindle and
    an offset. The plant is not changed where the load never varies.
    """
    load, torque = "load_command_a", "distal_torque_n_m"
    columns = [(run[load], _direction(run), np.ones(len(run)), run[torque]) for run in runs]
    table = np.concatenate([np.column_stack(column)[::20] for column in columns])
    slope, friction, _ = np.linalg.lstsq(table[:, :3], table[:, 3], rcond=None)[0]
    if np.ptp(table[:, 0]) == 0.0 or slope <= 0.0:
        return plant
    friction = max(float(friction), 0.0)
    return replace(plant, load_torque_n_m_a=float(slope), load_friction_n_m=friction)


def _direction(run: Recording) -> FloatArray:
    speed = np.gradient(run["spindle_angle_rad"], run.time_s)
    smooth = signal.sosfiltfilt(signal.butter(2, 20.0, fs=run.sample_rate_hz, output="sos"), speed)
    return np.tanh(smooth / 0.02)


def noise_std(values: FloatArray, rate_hz: float) -> float:
    """Return the standard deviation of white noise that has the power above `NOISE_ABOVE_HZ`."""
    sos = signal.butter(6, NOISE_ABOVE_HZ, "highpass", fs=rate_hz, output="sos")
    high = signal.sosfiltfilt(sos, values)
    edge = min(100, values.size // 4)
    share = 1.0 - NOISE_ABOVE_HZ / (0.5 * rate_hz)
    return float(np.std(high[edge : values.size - edge]) / np.sqrt(share))


def _with_noise(
    sensors: SensorParameters, runs: Sequence[Recording], silent: Mapping[str, float]
) -> SensorParameters:
    """Return sensors with the noise of recordings.

    That of a simulation with silent sensors, from quantisation and the controller, is taken off.
    """
    own = {}
    for channel, parameter in NOISY.items():
        found = float(np.median([noise_std(r[channel], r.sample_rate_hz) for r in runs]))
        own[parameter] = float(np.sqrt(max(found**2 - silent[channel] ** 2, 0.0)))
    return replace(sensors, **own)


def _with_quanta(run: Recording) -> SensorParameters:
    """Return silent sensors, drift and offset free, that round as the recording's do."""
    sensors = SensorParameters()
    torque = _quantum(run["proximal_torque_n_m"]) or sensors.torque_n_m_per_count
    current = _quantum(run["motor_current_a"]) or sensors.current_a_per_count
    counts = {
        f"{name}_count_per_turn": round(2.0 * np.pi / step)
        for name in ("motor", "spindle", "jaw")
        if (step := _quantum(run[f"{name}_angle_rad"])) is not None
    }
    return replace(
        sensors,
        **counts,
        **dict.fromkeys([*NOISY.values(), *_ZEROS], 0.0),
        torque_n_m_per_count=torque,
        torque_quantum_count=1.0,
        torque_limit_count=sensors.torque_limit_count * sensors.torque_n_m_per_count / torque,
        current_a_per_count=current,
    )


_ZEROS = (
    "proximal_offset_n_m", "distal_offset_n_m", "proximal_ramp_n_m_s", "distal_ramp_n_m_s",
    "torque_walk_n_m_s",
)  # fmt: skip


def _quantum(values: FloatArray) -> float | None:
    """Return the resolution of a converter, or None with fewer than two different values."""
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > 1e-9]
    return float(gaps.min()) if gaps.size else None
