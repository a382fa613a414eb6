"""Joint torques of a patient-side manipulator in free space: Piqué 2018, made again.

Each of two paths is fitted, and the model tested on the other. The thesis' model first, then the
effects that a forward search keeps: each round adds the effect that helps most on the path that was
not fitted, in one direction. An effect that the other direction does not confirm is left out. Last,
effects chosen on the path that is fitted alone, so that the other is untouched by the choice.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from estimation.arm.base import base_of
from estimation.arm.consistent import consistent_fit
from estimation.arm.effects import ArmEffect
from estimation.arm.identification import Fit, fit, nrmsd_percent
from estimation.arm.tables import PSM
from estimation.arm.wrist import candidates
from estimation.recording import FloatArray, Recording
from rig.arm.search import Prepared, Trial, chosen_within, prepare, search
from rig.output.provenance import Provenance

THESIS_TABLE_3_2 = (2.38, 4.80, 12.83, 6.49, 15.29, 18.11)
"""The thesis' NRMSD on a path it was not fitted to, %, on another robot."""

THESIS = "thesis' model"
CLOSED = "thesis' model with the arm's loops"
CONSISTENT = "thesis' model, physically consistent"
FILTERED = "columns filtered as the torque"
EFFECTS = "with the effects kept"
WITHIN = "with effects chosen on the fitted path alone"

SIMPLER_PERCENT = (1.0, 3.0)
"""Least gain in both directions of simpler choices of effects that further runs are tested with."""


@dataclass(frozen=True)
class Row:
    """One model, fitted on one path and tested on another."""

    model: str
    fitted_on: str
    tested_on: str
    parameters: int
    # condition number of the fit's weighted columns, each of unit length; None of a damped or
    # bounded fit, whose damping or bounds set it
    condition: float | None
    # error of each joint on the test path, % of its torque's range
    nrmsd_percent: tuple[float, ...]
    fitted_nrmsd_percent: tuple[float, ...]  # the same on the path of the fit
    # the error on the test path with each joint's mean error removed, or None where it was not
    # asked for
    without_offset_percent: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Parameter:
    """One identified base parameter of the thesis' model."""

    name: str
    value: float  # by weighted least squares
    standard_error: float  # of that value; includes noise only
    consistent: float  # by the physically consistent fit


@dataclass(frozen=True)
class Study:
    """Results of the study."""

    schema: str
    arm: str
    paths: tuple[str, str]  # the two paths; the search fits the first and tests on the second
    rows: tuple[Row, ...]  # the models, each in both directions, then on further runs
    thesis: tuple[float, ...]
    trials: tuple[Trial, ...]
    # identified parameters of the thesis' model on the first path, SI units
    parameters: tuple[Parameter, ...]
    provenance: Provenance


def run_study(
    first: Recording,
    second: Recording,
    *,
    also: Sequence[Recording] = (),
    tried: Sequence[ArmEffect] | None = None,
    on_step: Callable[[str], None] = lambda step: None,
) -> Study:
    """Do the study on two paths of the same arm: the search fits the first and tests on the second.

    Models that were fitted on the second path are tested on further runs, too. `tried` are the
    effects to search; None takes all that are worth trying.

    Raises:
        ArmError: The thesis' parameters are not identifiable from a path, or it contains no arm.
        DataError: A path is too short.
    """
    on_step("columns")
    effects = candidates(PSM) if tried is None else tried
    there = (prepare(first, effects), prepare(second, effects))
    back = (there[1], there[0])
    trials, kept = search(there, back, effects, lambda number: on_step(f"effects, round {number}"))
    on_step("fits")
    rows = []
    alone = {
        path.name: chosen_within(path, run, effects)
        for path, run in zip(there, (first, second), strict=True)
    }
    for one, other in (there, back, *((there[1], prepare(run, effects)) for run in also)):
        rows += [
            _row(THESIS, one, other, attrgetter("thesis")),
            _row(CLOSED, one, other, attrgetter("closed")),
            _row(CONSISTENT, one, other, attrgetter("thesis"), _consistent(one)),
            _row(FILTERED, one, other, attrgetter("filtered")),
            _row_with_effects(EFFECTS, one, other, kept),
            _row_with_effects(WITHIN, one, other, alone[one.name]),
        ]
    for run in also:
        rows += _simpler_rows(there[1], prepare(run, effects), trials)
    found = _fit(there[0], there[0].thesis)
    real = _consistent(there[0])
    named = zip(base_of(PSM).names, found.values, found.errors, real, strict=True)
    return Study(
        schema="rig.study.pique/1",
        arm=f"{PSM.name}; {PSM.source}",
        paths=(first.name, second.name),
        rows=tuple(rows),
        thesis=THESIS_TABLE_3_2,
        trials=tuple(trials),
        parameters=tuple(Parameter(n, float(v), float(e), float(c)) for n, v, e, c in named),
        provenance=Provenance.now(0),
    )


def _fit(path: Prepared, columns: FloatArray) -> Fit:
    torque, weights = path.torque[:, : path.joints], path.weights[: path.joints]
    return fit(columns, torque, weights, 0.0, path.independent_share)


def _row(
    model: str,
    one: Prepared,
    other: Prepared,
    columns: Callable[[Prepared], FloatArray],
    values: FloatArray | None = None,
) -> Row:
    """Return the row of a model's columns; without values they are fitted by least squares."""
    condition = None
    if values is None:
        found = _fit(one, columns(one))
        values, condition = found.values, found.condition

    def error(path: Prepared) -> tuple[float, ...]:
        left = nrmsd_percent(columns(path) @ values, path.torque[:, : path.joints])
        return tuple(map(float, left))

    return Row(model, one.name, other.name, len(values), condition, error(other), error(one))


def _consistent(path: Prepared) -> FloatArray:
    torque, weights = path.torque[:, : path.joints], path.weights[: path.joints]
    return base_of(PSM).mapping @ consistent_fit(PSM, path.thesis, torque, weights)


def _simpler_rows(one: Prepared, other: Prepared, trials: Sequence[Trial]) -> list[Row]:
    """Return rows of the effects that gained most in both directions, chosen without this run."""
    rows = []
    for least in SIMPLER_PERCENT:
        kept = [
            trial.effect
            for trial in trials
            if trial.kept_in_round is not None
            and min(trial.gain_percent, trial.other_way_percent) >= least
        ]
        model = f"with the {len(kept)} effects that gain {least:g} % both ways"
        rows.append(_row_with_effects(model, one, other, kept))
    return rows


def _row_with_effects(model: str, one: Prepared, other: Prepared, kept: list[str]) -> Row:
    values = one.values(kept)
    torque = other.torque[:, : other.joints]
    left = torque - other.estimate(kept, values)
    spread = np.ptp(torque, axis=0)
    return Row(
        model=model,
        fitted_on=one.name,
        tested_on=other.name,
        parameters=len(values),
        condition=None,
        nrmsd_percent=tuple(map(float, other.nrmsd_percent(kept, values))),
        fitted_nrmsd_percent=tuple(map(float, one.nrmsd_percent(kept, values))),
        without_offset_percent=tuple(map(float, 100 * left.std(axis=0) / spread)),
    )
