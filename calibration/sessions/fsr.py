"""Force-sensing resistor pressed on the force sensor: curve, hysteresis, creep."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from calibration.fsr import Creep, FsrRun, fit_fsr, measure_creep
from calibration.fsr_memory import CREEP_START_S, FsrMemory, fit_memory
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step, or_words
from calibration.quality import BadDataError, check_points
from estimation.filters import LowPass, zero_phase
from estimation.recording import FloatArray, Recording

FSR = "fsr_v"
SMOOTH = LowPass(cutoff_hz=5.0, order=3)
KEPT_HZ = 50.0


@dataclass(frozen=True, kw_only=True)
class FsrSession:
    """Calibrate a force-sensing resistor."""

    top_n: float = 1.6  # greatest force of a press
    presses: int = 8  # number of presses, one run each
    press_s: float = 8.0  # length of a press
    hold_s: float = 30.0  # length of the hold that shows creep; 0 for none
    degree: int | None = None  # degree of the polynomial; chosen on runs left out if None
    force_at_zero_n: float | None = None  # force at 0 V, held; fitted if None
    axis: str = "force_z_n"  # channel of the force sensor that presses, rising
    rail_v: float = 3.3  # upper end of the amplifier's range
    curve_only: bool = False  # model neither hysteresis nor creep

    kind = "fsr"
    devices = ("logger", "force_sensor")

    def steps(self) -> list[Step]:
        """The empty sensors, the presses, and a hold under a weight."""
        still: dict[str, float | str] = {"press_n": 0.0, "profile": "hold"}
        rest = Step("rest", still, "Let nothing touch the sensors.", duration_s=1.0)
        text = (
            f"After Enter press slowly up to {self.top_n:g} N and off again, once, "
            f"in about {self.press_s:g} s."
        )
        runs = [
            Step(f"press-{k}", {"press_n": self.top_n, "profile": "ramp"}, text, self.press_s)
            for k in range(self.presses)
        ]
        if self.hold_s <= 0:
            return [rest, *runs]
        weight = 0.7 * self.top_n
        text = f"After Enter put a weight of {weight / 9.80665 * 1e3:.0f} g on and do not touch it."
        hold = Step("hold", {"press_n": weight, "profile": "hold"}, text, self.hold_s)
        return [rest, *runs, hold]

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the curve from voltage to force, with hysteresis and creep."""
        fit = partial(
            fit_fsr, degree=self.degree, force_at_zero_n=self.force_at_zero_n, rail_v=self.rail_v
        )
        runs = self.pressed(measurements)
        fitted = fit(runs)
        hysteresis, drift = fitted.hysteresis, fitted.drift
        creep = self._creep(measurements)
        memory = fit_memory(fitted.curve, runs, creep)
        if self.curve_only:
            memory = FsrMemory(held_out_rmse_n=memory.held_out_rmse_n)
        # the curve in the middle of the loop: what memory adds is taken off, and it is fitted again
        pure = [memory.memoryless(fitted.curve, run) for run in runs]
        fitted = fit(pure)
        curve = fitted.curve
        assert curve.fit is not None  # noqa: S101  it was fitted
        whole = curve.fit.extended(
            {"loading_gap_n": memory.gap_n, "creep_ratio": memory.creep_ratio},
            [memory.gap_standard_error_n, creep.standard_error if creep else 0.0],
        )
        low, high = curve.interval_n(np.array([(curve.low_v + curve.high_v) / 2]))
        held_out = ", ".join(f"{d}: {e:.4f}" for d, e in fitted.held_out_rmse_n.items())
        found: dict[str, float | str] = {
            "degree": str(len(curve.coefficients) - 1),
            "held_out_rmse_n_by_degree": held_out,
            "interval95_mid_n": float(high[0] - low[0]) / 2,
            "hysteresis_ratio": or_words(hysteresis, "no loading and unloading at one voltage"),
            "held_out_rmse_n": memory.held_out_rmse_n[0],
            "held_out_rmse_with_gap_n": memory.held_out_rmse_n[1],
            "loading_gap": self._gap_words(memory),
            "creep": "not measured"
            if creep is None
            else f"{creep.rate:+.2%} a decade +- {creep.standard_error:.2%}",
            "drift_ratio": drift,
        }
        series = {run.name: (run.fsr_v, run.force_n - curve.force_n(run.fsr_v)) for run in pure}
        result = Result("fsr_force_n", FSR, whole, curve.low_v, curve.high_v)
        return Conclusion((result,), found, Residuals("voltage, V", "residual, N", series))

    def pressed(self, measurements: Sequence[Measurement]) -> list[FsrRun]:
        """Return the pressed parts of the presses, the force less its zero.

        Raises:
            BadDataError: No reading of the empty sensors, too few presses, or a dead resistor.
        """
        zero_n, floor_v = self._rest(measurements)
        presses = [m for m in measurements if m.recording.name.startswith("press")]
        check_points(len(presses), 3, "presses")
        return [self._run(m, zero_n, floor_v) for m in presses]

    def _rest(self, measurements: Sequence[Measurement]) -> tuple[float, float]:
        """Return the force sensor's zero, and the voltage above which the resistor is pressed."""
        for measurement in measurements:
            if measurement.recording.name == "rest":
                volts = measurement.recording[FSR]
                floor_v = float(volts.mean() + 5 * volts.std() + 0.005)
                return float(measurement.recording[self.axis].mean()), floor_v
        raise BadDataError("points", "A reading of the empty sensors is missing.")

    def _gap_words(self, memory: FsrMemory) -> str:
        if self.curve_only:
            return "omitted, as requested"
        return "modelled" if memory.gap_n else "not significant"

    def _run(self, measurement: Measurement, zero_n: float, floor_v: float) -> FsrRun:
        """Return the pressed part of a run."""
        recording = measurement.recording
        time_s, smooth = self._smooth(recording, zero_n)
        pressed = smooth[:, 0] > floor_v
        if pressed.sum() < 20:
            raise BadDataError(
                "no_change",
                f"{recording.name}: the resistor's voltage never rises above its rest.",
                f"It rests below {floor_v:.3g} V.",
                "Check that it is connected, and press on its sensing area.",
            )
        return FsrRun(recording.name, time_s[pressed], smooth[pressed, 0], smooth[pressed, 1])

    def _creep(self, measurements: Sequence[Measurement]) -> Creep | None:
        hold = next((m.recording for m in measurements if m.recording.name == "hold"), None)
        if hold is None:
            return None
        time_s, smooth = self._smooth(hold, self._rest(measurements)[0])
        on = int(np.argmax(smooth[:, 1] > 0.9 * smooth[:, 1].max()))
        since_s = time_s[on:] - time_s[on] + CREEP_START_S
        return measure_creep(FsrRun("hold", since_s, smooth[on:, 0], smooth[on:, 1]), start_s=1.0)

    def _smooth(self, recording: Recording, zero_n: float) -> tuple[FloatArray, FloatArray]:
        """Return time, shape (n,), and voltage and force, both smoothed alike, shape (n, 2)."""
        both = np.column_stack([recording[FSR], recording[self.axis] - zero_n])
        step = max(1, round(recording.sample_rate_hz / KEPT_HZ))
        smooth = zero_phase(both, recording.sample_rate_hz, SMOOTH)
        return recording.time_s[::step], smooth[::step]
