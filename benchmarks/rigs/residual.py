"""Residual of the declared equations of the reference rig on a campaign: a quick linear fit.

The terms are those of the shipped models; the twist of the gear is taken with the rig's own ratio.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import model_file
from estimation.derived import settled_places, zero_phase_channels
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from estimation.rest import in_motion

EQUATIONS = ("motor", "gearbox", "cable", "stretch")
GEARBOX = "gearbox_differential_rad"
EVERY = 10
"""One in so many samples of 1 kHz is regressed on."""

WIDTHS = tuple(float(x) for x in np.geomspace(2e-3, 0.6, 14))
"""Widths of a friction's sign that are tried, shares of the usual fast speed."""

FINER = 9
"""Widths that are tried between the neighbours of the best one."""


@cache
def declared(equation: str) -> Model:
    """Return the shipped model of an equation."""
    return model_file.read(Path(equation))


@dataclass(frozen=True, eq=False)
class Prepared:
    """One run's filtered channels and the samples that each equation counts.

    Attributes:
        channels: Channel to values at the full rate, filtered without lag, shape (n,).
        places: Equation to the samples that are regressed on.
    """

    channels: Mapping[str, FloatArray]
    places: Mapping[str, NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class Fitted:
    """A declared equation fitted on a campaign.

    Attributes:
        widths: Width of the friction's sign, where there is one.
        weights: Of the declared columns, signed.
        residuals: What is left of each run, its mean removed, shape (n,).
    """

    equation: str
    widths: tuple[float, ...]
    weights: FloatArray
    residuals: tuple[FloatArray, ...]

    def rms(self, runs: Sequence[int] | None = None) -> float:
        """Return the root mean square over some runs, all when None."""
        chosen = [self.residuals[k] for k in (range(len(self.residuals)) if runs is None else runs)]
        return float(np.sqrt(np.mean(np.concatenate(chosen) ** 2)))


def needed_channels() -> list[str]:
    """Return the channels of the declared equations, but for the gear's twist."""
    names = [c for e in EQUATIONS for c in (*declared(e).channels, declared(e).target)]
    names += ["spindle_velocity_rad_s", "motor_angle_rad", "spindle_angle_rad"]
    return [name for name in dict.fromkeys(names) if name != GEARBOX]


def prepare(recording: Recording, ratio: float) -> Prepared:
    """Filter one run's channels as the declared models say, and find the samples that count."""
    low_pass = declared("motor").low_pass
    filtered = zero_phase_channels(recording, needed_channels(), low_pass)
    channels = {**filtered.columns, "time_s": filtered.time_s}
    channels[GEARBOX] = channels["motor_angle_rad"] / ratio - channels["spindle_angle_rad"]
    inner = settled_places(filtered, low_pass)
    valid = np.zeros(len(filtered), bool)
    valid[inner] = True
    places = {}
    for equation in EQUATIONS:
        model, counted = declared(equation), valid.copy()
        if model.samples == "motion":
            for name, slowest in model.signals.rest.items():
                if name in model.channels:
                    counted &= in_motion(channels[name], valid, recording.sample_rate_hz, slowest)
        places[equation] = np.flatnonzero(counted)[::EVERY]
    return Prepared(channels, places)


def columns_of(run: Prepared, equation: str, widths: Sequence[float]) -> FloatArray:
    """Return an equation's declared columns at the samples that count, shape (n, k), offset free.

    `widths` are the shape parameters of its terms, in order.
    """
    rest, blocks, places = list(widths), [], run.places[equation]
    for term in declared(equation).terms:
        if term.effect.id == "sensor.offset":
            continue
        own, rest = rest[: len(term.effect.shape)], rest[len(term.effect.shape) :]
        inputs = {role: run.channels[c][places] for role, c in term.channels.items()}
        blocks.append(term.sign * term.effect.columns(inputs, own))
    return np.hstack(blocks)


def centred(values: FloatArray) -> FloatArray:
    """Return values with their mean removed."""
    return np.asarray(values - values.mean(axis=0))


def fit(runs: Sequence[Prepared], equation: str, added: Sequence[FloatArray] = ()) -> Fitted:
    """Fit a declared equation, each run with an offset of its own.

    The width of a friction's sign is searched on a grid, then on a finer one about its best: all
    other columns are taken out of the sign's and of the target once, so that a width costs little.

    Args:
        runs: The runs.
        equation: The equation.
        added: Further columns, one array (n, k) a run, filtered, at the full rate.
    """
    parts = [r.channels[declared(equation).target][r.places[equation]] for r in runs]
    target = np.concatenate([centred(part) for part in parts])
    beside = [a[r.places[equation]] for a, r in zip(added, runs, strict=False)]
    speed = _friction_speed(equation)
    widths: tuple[float, ...] = ()
    if speed is not None:
        fixed = _centred_table(runs, equation, (1.0,), beside, sign_column(equation))
        basis = np.linalg.qr(fixed / (np.sqrt(np.mean(fixed**2, axis=0)) + 1e-300))[0]
        speeds = [r.channels[speed][r.places[equation]] for r in runs]
        fast = float(np.percentile(np.abs(np.concatenate(speeds)), 95))
        best = _best_share(WIDTHS, speeds, fast, basis, target)
        near = WIDTHS[max(best - 1, 0)], WIDTHS[min(best + 1, len(WIDTHS) - 1)]
        finer = [float(x) for x in np.geomspace(*near, FINER)]
        widths = (finer[_best_share(finer, speeds, fast, basis, target)] * fast,)
    table = _centred_table(runs, equation, widths, beside)
    scale = np.sqrt(np.mean(table**2, axis=0)) + np.finfo(float).tiny
    scaled = table / scale
    weights = np.linalg.lstsq(scaled.T @ scaled, scaled.T @ target, rcond=1e-12)[0] / scale
    left = target - table @ weights
    cuts = np.cumsum([len(part) for part in parts])[:-1]
    return Fitted(equation, widths, weights, tuple(np.split(left, cuts)))


def _centred_table(
    runs: Sequence[Prepared],
    equation: str,
    widths: Sequence[float],
    beside: Sequence[FloatArray],
    without: int | None = None,
) -> FloatArray:
    """Return all runs' columns, each run's mean removed, without one of the declared ones."""
    tables = []
    for k, run in enumerate(runs):
        own = columns_of(run, equation, widths)
        if without is not None:
            own = np.delete(own, without, axis=1)
        tables.append(centred(np.hstack([own, beside[k]]) if beside else own))
    return np.concatenate(tables)


def _best_share(
    shares: Sequence[float],
    speeds: Sequence[FloatArray],
    fast: float,
    basis: FloatArray,
    target: FloatArray,
) -> int:
    """Return the place of the width, a share of the fast speed, with the least residual."""
    rest = target - basis @ (basis.T @ target)
    gains = []
    for share in shares:
        sign = np.concatenate([centred(np.tanh(v / (share * fast))) for v in speeds])
        own = sign - basis @ (basis.T @ sign)
        gains.append(float(own @ rest) ** 2 / max(float(own @ own), 1e-300))
    return int(np.argmax(gains))


def left_with(runs: Sequence[Prepared], fitted: Fitted) -> tuple[FloatArray, ...]:
    """Return the residual on other runs of a fitted equation, at the full rate."""
    found = []
    for run in runs:
        whole = replace(run, places={fitted.equation: np.arange(len(run.channels["time_s"]))})
        columns = columns_of(whole, fitted.equation, fitted.widths)
        found.append(run.channels[declared(fitted.equation).target] - columns @ fitted.weights)
    return tuple(found)


def _friction_speed(equation: str) -> str | None:
    """Return the speed whose sign an equation's friction takes; None without friction."""
    for term in declared(equation).terms:
        if term.effect.shape:
            return dict(term.channels)["speed"]
    return None


def sign_column(equation: str) -> int:
    """Return the place of the friction that takes a speed's sign among the declared columns."""
    terms = [t for t in declared(equation).terms if t.effect.id != "sensor.offset"]
    return next(k for k, term in enumerate(terms) if term.effect.shape)
