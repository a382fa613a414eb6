"""Friction whose level changes within runs or between them, as nothing that is recorded predicts.

No function of the signals predicts such an effect in a run that was left out, so it is looked for
within runs: a declared friction term with an amplitude of the run, or one that varies over time, is
fitted to every other block of a run and judged on the blocks between them. An offset that varies is
part of all fits, so a drifting zero is not taken for friction. A slow disturbance is followed by
any smooth column, so friction must explain more than the same column at other times of the run.
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

Errors = Mapping[tuple[str, str], FloatArray]
"""Equation and friction term to squared errors of each run."""

RIDGE = 0.01
"""Prior precision of an amplitude, of the mean information on one."""


@dataclass(frozen=True)
class Unsteady:
    """A declared friction term whose amplitude changes within runs or between them.

    Attributes:
        equation: Its equation.
        effect: Id of the declared term.
        within: Whether it changes within runs.
        by_run: Run to the log ratio of its squared errors without and with the change.
        fall: Error of the test runs with it, over that without.
    """

    equation: str
    effect: str
    within: bool
    by_run: Mapping[str, float]
    fall: float


def unsteady(held_out: HeldOut) -> Unsteady | None:
    """Return the friction term whose level changes most; None without evidence on the test runs."""
    errors = _errors(held_out)
    within = {name: found[:, 1:] for name, found in errors.items()}
    between = {name: found[:, :2] for name, found in errors.items()}
    return _changing(held_out, within, True) or _changing(held_out, between, False)


def _changing(held_out: HeldOut, errors: Errors, within: bool) -> Unsteady | None:
    """Return the term whose change is shown by the errors without and with it, (runs, 2)."""
    numbers = held_out.numbers
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
    return Unsteady(*found, within, dict(zip(names, by_run.tolist(), strict=True)), fall)


def _gain(errors: FloatArray, runs: NDArray[np.bool_]) -> float:
    """Return the log ratio of squared errors, shape (runs, 2), over some of the runs."""
    old, new = errors[runs].sum(axis=0)
    return float(np.log(old / new)) if new > 0.0 else 0.0


def _errors(held_out: HeldOut) -> Errors:
    """Return equation and friction term to the squared errors of its levels, (runs, 3).

    With the usual level, with one of the run, and with one that changes within the run.
    """
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
                found = np.zeros((len(layout.runs), 3))
                for r, run in enumerate(layout.runs):
                    used = run.grid[run.used[name]]
                    own = equation.columns(run.channels)[used][:, column]
                    found[r] = _judged(used / run.rate_hz, residual[r, : len(used)], own)
                out[name, term.effect.id] = found
            column += len(term.effect.amplitudes) + len(term.effect.shape)
    return out


def _judged(
    time_s: FloatArray, residual: FloatArray, column: FloatArray
) -> tuple[float, float, float]:
    """Return the squared errors of one run's blocks, with each of the levels of a term."""
    size = float(np.sqrt(np.mean(column**2)))
    if len(time_s) < 4 * KNOTS or size == 0.0:
        return 0.0, 0.0, 0.0
    place = (time_s - time_s[0]) / (time_s[-1] - time_s[0]) * (KNOTS - 1)
    hats = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(KNOTS)))
    is_odd = np.floor(2.0 * place) % 2 == 1
    half = len(column) // 2
    own = column[:, None] / size
    shifted = [own[::-1], np.roll(own, half, axis=0), np.roll(own[::-1], half, axis=0)]

    def error(*added: FloatArray) -> float:
        return _left_out(np.hstack([hats, *added]), residual, is_odd)

    usual = min(error(), *(error(other) for other in shifted))
    of_run = min(error(own), *(error(own, hats * other) for other in shifted))
    return usual, of_run, error(hats * own)


def _left_out(columns: FloatArray, target: FloatArray, is_odd: NDArray[np.bool_]) -> float:
    """Return the squared error of each half of the samples, fitted on the other half."""
    total = 0.0
    precision = RIDGE * len(target) / KNOTS * np.eye(columns.shape[1])
    for fitted in (is_odd, ~is_odd):
        x, y = columns[fitted], target[fitted]
        amplitudes = np.linalg.solve(x.T @ x + precision, x.T @ y)
        total += float(np.sum((target[~fitted] - columns[~fitted] @ amplitudes) ** 2))
    return total
