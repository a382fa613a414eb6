"""Friction whose level changes within runs, at times that no recorded signal predicts.

No function of the signals predicts such an effect in a run that was left out, so it is looked for
within runs: a declared friction term with an amplitude that varies over time is fitted to every
other block of a run and judged on the blocks between them. An offset that varies likewise is part
of both fits, so a drifting zero is not taken for friction. A slow disturbance is followed by any
smooth column, so friction must explain more than the same column at other times of the run.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.causes.held_out import HeldOut
from estimation.recording import FloatArray

KNOTS = 12
"""Hat functions over a run; a block is half as long as they are apart."""

MOST = 0.75
"""Share of the runs, and of the test runs, in which the error is lower: not by chance in some."""

RIDGE = 0.01
"""Prior precision of an amplitude, of the mean information on one."""


@dataclass(frozen=True)
class Unsteady:
    """A declared friction term whose amplitude changes within runs.

    Attributes:
        equation: Its equation.
        effect: Id of the declared term.
        by_run: Run to the log ratio of its squared errors without and with the change.
        fall: Error of the test runs with it, over that without.
    """

    equation: str
    effect: str
    by_run: Mapping[str, float]
    fall: float

    @property
    def sentence(self) -> str:
        """What happens, for a person."""
        return (
            f"{self.equation}: the level of {self.effect} changes within runs, at times that no"
            " recorded signal predicts."
        )


def unsteady(held_out: HeldOut) -> Unsteady | None:
    """Return the friction term whose level changes most; None without evidence on the test runs."""
    errors, numbers = _errors(held_out), held_out.numbers
    if not errors:
        return None
    test = np.zeros(len(held_out.layout.runs), dtype=np.bool_)
    test[held_out.at] = True
    price = numbers.cause_cost + numbers.rare_cost
    price += numbers.choice_price * float(np.log(len(errors)))
    found = max(errors, key=lambda name: _gain(errors[name], ~test))
    by_run = np.array([_gain(errors[found], np.arange(len(test)) == k) for k in range(len(test))])
    evidence = 0.5 * numbers.samples_a_run * float(by_run[test].sum())
    if _gain(errors[found], ~test) < price or evidence < np.log(numbers.kept_evidence):
        return None
    if min(np.mean(by_run[test] > 0.0), np.mean(by_run > 0.0)) < MOST:
        return None
    names = [run.name for run in held_out.layout.runs]
    fall = float(np.exp(-0.5 * _gain(errors[found], test)))
    return Unsteady(*found, dict(zip(names, by_run.tolist(), strict=True)), fall)


def _gain(errors: FloatArray, runs: NDArray[np.bool_]) -> float:
    """Return the log ratio of squared errors, shape (runs, 2), over some of the runs."""
    old, new = errors[runs].sum(axis=0)
    return float(np.log(old / new)) if new > 0.0 else 0.0


def _errors(held_out: HeldOut) -> Mapping[tuple[str, str], FloatArray]:
    """Return equation and friction term to the squared errors without and with it, (runs, 2)."""
    joint, layout = held_out.joint, held_out.layout
    base = joint.left_out([held_out.at]).base[0]
    out = {}
    for name, equation in layout.equations.items():
        part = (name, "within")
        table = joint.tables[part]
        residual = table[..., -1] - table[..., :-1] @ base[[*joint.at[part]]]
        column = 0
        for term in equation.terms:
            if term.effect.id.startswith("friction."):
                found = np.zeros((len(layout.runs), 2))
                for r, run in enumerate(layout.runs):
                    used = run.grid[run.used[name]]
                    own = equation.columns(run.channels)[used][:, column]
                    found[r] = _judged(used / run.rate_hz, residual[r, : len(used)], own)
                out[name, term.effect.id] = found
            column += len(term.effect.amplitudes) + len(term.effect.shape)
    return out


def _judged(time_s: FloatArray, residual: FloatArray, column: FloatArray) -> tuple[float, float]:
    """Return the squared error of one run's blocks, without the term at its times and with it."""
    size = float(np.sqrt(np.mean(column**2)))
    if len(time_s) < 4 * KNOTS or size == 0.0:
        return 0.0, 0.0
    place = (time_s - time_s[0]) / (time_s[-1] - time_s[0]) * (KNOTS - 1)
    hats = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(KNOTS)))
    is_odd = np.floor(2.0 * place) % 2 == 1
    half = len(column) // 2
    shifted = [column[::-1], np.roll(column, half), np.roll(column[::-1], half)]
    level = column[:, None] / size  # another one in all of the run is no change within it
    others = [hats[:, :0], *(hats * (other / size)[:, None] for other in shifted)]
    without = min(_left_out(np.hstack([hats, level, x]), residual, is_odd) for x in others)
    return without, _left_out(np.hstack([hats, hats * level]), residual, is_odd)


def _left_out(columns: FloatArray, target: FloatArray, is_odd: NDArray[np.bool_]) -> float:
    """Return the squared error of each half of the samples, fitted on the other half."""
    total = 0.0
    precision = RIDGE * len(target) / KNOTS * np.eye(columns.shape[1])
    for fitted in (is_odd, ~is_odd):
        x, y = columns[fitted], target[fitted]
        amplitudes = np.linalg.solve(x.T @ x + precision, x.T @ y)
        total += float(np.sum((target[~fitted] - columns[~fitted] @ amplitudes) ** 2))
    return total
