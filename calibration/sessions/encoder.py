"""An encoder: its zero at a mark, and against another one its ratio, offset and periodic error.

    angle = a reference + c + d T + h sgn(v) + A sin(n angle) + B cos(n angle)

T is the torque between the two, whose twist would look like an error, h the lost motion. The number
of periods per turn is searched for and must predict runs left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.chain import PAIRS, Pair
from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Residuals, Result, Step
from calibration.quality import BadDataError, check_change, check_points
from calibration.record import LINE, Fit
from calibration.regression import Regression, is_better, regress
from calibration.sessions.motion import joined, moves, residuals, steady
from estimation.recording import FloatArray

SPEEDS_RAD_S = (0.3, 0.5)
"""More than one: at one speed, time and angle are collinear."""
MARKS = 5
MARK_SPREAD_COUNT = 6.0
LEAST_PERIODS, MOST_PERIODS = 6, 40
"""Periods a turn that are searched; fewer do not fit into a jaw's travel often enough."""


@dataclass(frozen=True, kw_only=True)
class EncoderSession:
    """Calibrate one encoder."""

    # `spindle`, against the motor's encoder, or `jaw`, against the spindle's
    encoder: str = "spindle"
    loads_a: tuple[float, ...] = (0.2, 0.6)  # loads of the moves
    repeats: int = 2  # number of moves of each
    line_only: bool = False  # model no periodic error

    kind = "encoder"
    devices = ("logger",)

    def __post_init__(self) -> None:
        if self.encoder not in PAIRS:
            raise BadDataError(
                "points", f"Unknown encoder {self.encoder!r}.", f"Known: {', '.join(PAIRS)}."
            )

    def steps(self) -> list[Step]:
        """The mark several times, then slow moves."""
        text = f"Turn the {self.encoder} away and back until its index mark is lined up."
        marks = [
            Step(f"mark-{k}", {"mark_ratio": 1.0, "encoder": self.encoder}, text, duration_s=0.5)
            for k in range(MARKS)
        ]
        return [*marks, *moves(SPEEDS_RAD_S, self.loads_a, self.repeats)]

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the line with its zero at the mark, and the encoder's errors."""
        pair = PAIRS[self.encoder]
        line = lines.channels[pair.channel]
        marks = [m for m in measurements if "mark_ratio" in m.recording.conditions]
        moved = [m for m in measurements if "mark_ratio" not in m.recording.conditions]
        at = _mark_counts(marks, line.counts)
        runs = [steady(m, (pair.channel, pair.reference, pair.torque)) for m in moved]
        for name in (pair.channel, pair.reference):
            check_change(joined(runs, name), 0.2, name)
        plain = regress([(_plain(run, pair), run[pair.channel]) for run in runs])
        periods, waved = _best_wave(runs, pair)
        amplitude = float(np.hypot(*waved.values[-2:]))
        # smaller than half a count it may be the quantum's own pattern
        has_wave = is_better(waved.held_out, plain.held_out) and amplitude > abs(line.slope) / 2
        is_waved = has_wave and not self.line_only
        used = waved if is_waved else plain
        names = ["ratio", "offset_rad", "compliance_rad_n_m", "lost_motion_rad"]
        names += ["wave_sine_rad", "wave_cosine_rad"] if is_waved else []
        spread, covariance = float(at.std(ddof=1)), np.diag([0.0, at.var(ddof=1) / at.size])
        zero = {"slope": line.slope, "zero": float(at.mean())}
        line_fit = Fit(LINE, zero, covariance, spread * abs(line.slope), int(at.size))
        at_mark = Result(pair.channel, line.counts, line_fit, tared=line.tared)
        angles = joined(runs, pair.channel)
        low, high = float(angles.min()), float(angles.max())
        error_fit = used.as_fit("encoder", *names)
        errors = Result(f"{self.encoder}_encoder_rad", pair.reference, error_fit, low, high)
        wave = f"{periods} periods per turn" if has_wave else "none that predicts runs left out"
        found: dict[str, float | str] = {
            "mark_spread_count": spread,
            "ratio_over_nominal": float(used.values[0] / pair.nominal_ratio),
            "wave": wave,
            "wave_amplitude_rad": amplitude,
        }
        series = residuals(moved, [run[pair.channel] for run in runs], used)
        shown = Residuals("angle, rad", "residual, mrad", series)
        return Conclusion((at_mark, errors), found, shown)


def _mark_counts(marks: Sequence[Measurement], field: str) -> FloatArray:
    check_points(len(marks), 3, "readings at the mark")
    at = np.array([float(np.median(m.counts[field])) for m in marks if m.counts is not None])
    check_points(len(at), 3, "readings at the mark with raw counts")
    spread = float(at.std(ddof=1))
    if spread > MARK_SPREAD_COUNT:
        raise BadDataError(
            "not_steady",
            f"The mark was found {spread:.1f} counts apart.",
            f"At most {MARK_SPREAD_COUNT:g} passes.",
            "Come to the mark from the same side, with a magnifier.",
        )
    return at


def _plain(run: dict[str, FloatArray], pair: Pair) -> FloatArray:
    reference = run[pair.reference]
    return np.column_stack([reference, np.ones_like(reference), run[pair.torque], run["direction"]])


def _best_wave(runs: Sequence[dict[str, FloatArray]], pair: Pair) -> tuple[int, Regression]:
    """Return the periods per turn with the smallest residual, and that fit."""
    fits = {}
    for periods in range(LEAST_PERIODS, MOST_PERIODS + 1):
        columns = []
        for run in runs:
            phase = periods * run[pair.channel]
            wave = np.column_stack([np.sin(phase), np.cos(phase)])
            columns.append((np.hstack([_plain(run, pair), wave]), run[pair.channel]))
        fits[periods] = regress(columns)
    best = min(fits, key=lambda periods: fits[periods].residual_rms)
    return best, fits[best]
