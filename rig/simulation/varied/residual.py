"""What the declared equations of the reference rig leave of a campaign: a quick linear fit.

The terms are those of the shipped models; the twist of the gear is taken with the rig's own ratio.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import model_file
from estimation.derived import GEARBOX, settled_places, zero_phase_channels
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from estimation.rest import SLOWEST_RAD_S, in_motion

EQUATIONS = ("motor", "gearbox", "cable", "stretch")
EVERY = 10
"""One in so many samples of 1 kHz is regressed on."""

WIDTHS = tuple(float(x) for x in np.geomspace(2e-3, 0.6, 14))
"""Widths of a friction's sign that are tried, shares of the usual fast speed."""


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
        equation: One of `EQUATIONS`.
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
            for name, slowest in SLOWEST_RAD_S.items():
                if name in model.channels:
                    counted &= in_motion(channels[name], valid, recording.sample_rate_hz, slowest)
        places[equation] = np.flatnonzero(counted)[::EVERY]
    return Prepared(channels, places)


def columns_of(run: Prepared, equation: str, widths: Sequence[float]) -> FloatArray:
    """Return an equation's declared columns at the samples that count, shape (n, k), offset free.

    Args:
        run: The run.
        equation: The equation.
        widths: Shape parameters of its terms, in order.
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

    Args:
        runs: The runs.
        equation: The equation.
        added: Columns beside the declared ones, one array (n, k) a run, filtered, at the full rate.
    """
    target = [centred(r.channels[declared(equation).target][r.places[equation]]) for r in runs]
    beside = [centred(a[r.places[equation]]) for a, r in zip(added, runs, strict=False)]
    whole = np.concatenate(target)
    best: tuple[float, tuple[float, ...], FloatArray, FloatArray] | None = None

    def tried(widths: tuple[float, ...]) -> float:
        nonlocal best
        tables = [centred(columns_of(r, equation, widths)) for r in runs]
        if beside:
            tables = [np.hstack(pair) for pair in zip(tables, beside, strict=True)]
        table = np.concatenate(tables)
        scale = np.sqrt(np.mean(table**2, axis=0)) + np.finfo(float).tiny
        gram = (table / scale).T @ (table / scale)
        right = (table / scale).T @ whole
        weights = np.linalg.lstsq(gram, right, rcond=1e-12)[0] / scale
        left = whole - table @ weights
        loss = float(left @ left)
        if best is None or loss < best[0]:
            best = (loss, widths, weights, left)
        return loss

    speed = _friction_speed(equation)
    if speed is None:
        tried(())
    else:
        fast = float(
            np.percentile(np.abs(np.concatenate([r.channels[speed][::EVERY] for r in runs])), 95)
        )
        losses = [tried((share * fast,)) for share in WIDTHS]
        at = int(np.argmin(losses))
        near = WIDTHS[max(at - 1, 0)], WIDTHS[min(at + 1, len(WIDTHS) - 1)]
        for share in np.geomspace(*near, 7)[1:-1]:
            tried((float(share) * fast,))
    assert best is not None  # noqa: S101 - one is tried at least
    cuts = np.cumsum([len(y) for y in target])[:-1]
    return Fitted(equation, best[1], best[2], tuple(np.split(best[3], cuts)))


def left_with(runs: Sequence[Prepared], fitted: Fitted) -> tuple[FloatArray, ...]:
    """Return what other runs leave of an equation that was fitted elsewhere, at the full rate."""
    found = []
    for run in runs:
        whole = replace(run, places={fitted.equation: np.arange(len(run.channels["time_s"]))})
        columns = columns_of(whole, fitted.equation, fitted.widths)
        found.append(run.channels[declared(fitted.equation).target] - columns @ fitted.weights)
    return tuple(found)


def _friction_speed(equation: str) -> str | None:
    for term in declared(equation).terms:
        if term.effect.shape:
            return dict(term.channels)["speed"]
    return None
