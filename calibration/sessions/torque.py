"""Torque sensor on the bench: zero, shunt, then known weights on an arm, up and down again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.chain import REFERENCE
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step, or_words
from calibration.quality import BadDataError
from calibration.torque import (
    MINIMUM_LEVELS,
    MINIMUM_STEPS,
    check_shunt,
    fit_torque,
    weight_torque_n_m,
)
from calibration.torque import Step as Load
from estimation.recording import FloatArray

ENDING = "_torque_n_m"
SENSORS = {
    s.name.removesuffix(ENDING): s.name for s in REFERENCE.sensors if s.name.endswith(ENDING)
}
"""Sensor to its channel; the counts field has the sensor's name."""

MASSES_KG = (0.05, 0.1, 0.15, 0.2, 0.25)


@dataclass(frozen=True, kw_only=True)
class TorqueSession:
    """Calibrate one torque sensor against weights."""

    sensor: str = "proximal"  # `proximal` or `distal`
    arm_m: float = 0.1  # from the axis to where the weights hang, the arm level
    masses_kg: tuple[float, ...] = MASSES_KG  # weights, rising
    # number of passes up and down; four separate non-linearity from misplaced weights
    repeats: int = 1
    # change by the shunt, V/V, from the certificate; None for no check
    shunt_v_v: float | None = None
    counts_per_v_v: float | None = None  # gain of amplifier and converter; needed with a shunt
    temperature_k: float | None = None  # temperature of the sensor; None if it was not measured

    kind = "torque"
    devices = ("logger",)

    def __post_init__(self) -> None:
        if self.sensor not in SENSORS:
            raise BadDataError(
                "points", f"Unknown torque sensor {self.sensor!r}.", f"Known: {', '.join(SENSORS)}."
            )
        rising = len(self.masses_kg) > 0 and np.all(np.diff((0.0, *self.masses_kg)) > 0)
        if not (rising and self.arm_m > 0 and np.isfinite(self.arm_m)):
            raise BadDataError(
                "levels",
                "An arm is longer than 0, and the masses rise from 0.",
                f"Given: {1e3 * self.arm_m:g} mm and"
                f" {', '.join(f'{1e3 * mass:g}' for mass in self.masses_kg)} g.",
                "Give --masses-g in rising order, such as 50,100,150, and a positive --arm-mm.",
            )
        levels, steps = 1 + len(self.masses_kg), 1 + 2 * len(self.masses_kg) * self.repeats
        if levels < MINIMUM_LEVELS or steps < MINIMUM_STEPS:
            raise BadDataError(
                "points",
                f"{len(self.masses_kg)} weights, {self.repeats} times up and down, are too few.",
                f"A line needs {MINIMUM_LEVELS} different torques, no weight among them, and"
                f" {MINIMUM_STEPS} steps.",
                f"Give at least {MINIMUM_LEVELS - 1} weights.",
            )
        if (self.shunt_v_v is None) != (self.counts_per_v_v is None):
            raise BadDataError(
                "points", "A shunt check needs the certificate's V/V and the counts a V/V."
            )

    def steps(self) -> list[Step]:
        """Zero, shunt if there is one, then up and down through the weights, ending at zero."""
        steps = [] if self.shunt_v_v is None else [self._shunt_step(0), self._shunt_step(1)]
        up = (0.0, *self.masses_kg)
        for number, mass in enumerate((0.0, *(up[1:] + up[-2::-1]) * self.repeats)):
            what = f"Hang {mass * 1e3:g} g on the arm" if mass else "Take every weight off the arm"
            held: dict[str, float | str] = {"sensor": self.sensor}
            held |= {"mass_kg": mass, "arm_m": self.arm_m}
            text = f"{what} of the {self.sensor} sensor and wait until it hangs still."
            steps.append(Step(f"{number:02d}-{mass * 1e3:g}g", held, text))
        return steps

    def reading(self, measured: Sequence[Measurement], lines: CalibrationSet) -> str:
        """Return the reading of the last step, and its distance to the line of all steps so far."""
        field = lines.channels[SENSORS[self.sensor]].counts
        counts = _counts(measured[-1], field)
        shown = f"{counts.mean():.1f} +- {counts.std():.1f} counts"
        points = [
            (float(c["mass_kg"]), _counts(m, field).mean())
            for m in measured
            if "mass_kg" in (c := m.recording.conditions)
        ]
        if "mass_kg" not in measured[-1].recording.conditions or len({m for m, _ in points}) < 3:
            return shown
        masses, means = np.array(points).T
        line = np.polyfit(masses, means, 1)
        span = abs(line[0]) * np.ptp(masses)
        off = (means[-1] - np.polyval(line, masses[-1])) / span
        return f"{shown}, {off:+.2%} of the range off the line so far"

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the line of the sensor; see `calibration.torque`."""
        field = lines.channels[SENSORS[self.sensor]].counts
        loads, shunt = [], {}
        for measurement in measurements:
            conditions, counts = measurement.recording.conditions, _counts(measurement, field)
            if "shunt_ratio" in conditions:
                shunt[conditions["shunt_ratio"]] = counts
            else:
                torque = weight_torque_n_m(float(conditions["mass_kg"]), float(conditions["arm_m"]))
                loads.append(Load(float(torque), counts))
        deviation: float | None = None
        if self.shunt_v_v is not None and self.counts_per_v_v is not None:
            deviation = check_shunt(shunt[0.0], shunt[1.0], self.shunt_v_v, self.counts_per_v_v)
        fitted = fit_torque(loads)
        found: dict[str, float | str] = {
            "linearity_ratio": fitted.linearity,
            "hysteresis_ratio": or_words(fitted.hysteresis, "no load was reached both ways"),
            "zero_drift_ratio": or_words(fitted.drift, "it did not begin and end at zero"),
            "temperature_k": or_words(self.temperature_k, "not measured"),
            "shunt_deviation_ratio": or_words(deviation, "no shunt was given"),
        }
        torques, left = fitted.torque_n_m, fitted.residual_n_m
        rising = np.diff(torques, prepend=-1.0) > 0
        low, high = float(fitted.counts.min()), float(fitted.counts.max())
        result = Result(SENSORS[self.sensor], field, fitted.fit, low, high, tared=True)
        series = {
            "loading": (torques[rising], left[rising] * 1e3),
            "unloading": (torques[~rising], left[~rising] * 1e3),
        }
        return Conclusion((result,), found, Residuals("torque, N m", "residual, mN m", series))

    def _shunt_step(self, state: int) -> Step:
        word = "Switch the shunt on" if state else "Take every weight off; shunt switched off"
        conditions: dict[str, float | str] = {"sensor": self.sensor, "shunt_ratio": float(state)}
        if state and self.shunt_v_v is not None and self.counts_per_v_v is not None:
            conditions["shunt_v_v_ratio"] = self.shunt_v_v
            conditions["counts_per_v_v_ratio"] = self.counts_per_v_v
        return Step(f"shunt-{state}", conditions, f"{word}.")


def _counts(measurement: Measurement, field: str) -> FloatArray:
    if measurement.counts is None:
        raise BadDataError("points", f"{measurement.recording.name} has no raw counts.")
    return measurement.counts[field].astype(np.float64)
