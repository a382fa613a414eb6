"""Joint torques of a patient-side manipulator in free space: Piqué 2018, made again.

Each of two paths is fitted, and the model tested on the other. The thesis' model first, then the
effects that a forward search keeps: each round adds the effect that helps most on the path that was
not fitted, in one direction only. The other direction is reported and never chosen on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.arm.base import base_of
from estimation.arm.effects import ArmEffect, candidates
from estimation.arm.identification import Fit, fit, nrmsd_percent, smoothed, thesis_weights
from estimation.arm.motion import LOW_PASS, Motion, joint_channels, motion_of
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM
from estimation.filters import LowPass, zero_phase
from estimation.recording import FloatArray, Recording
from rig.errors import DataError
from rig.importers.registry import open_campaign
from rig.reports.provenance import Provenance

FINE = LowPass(cutoff_hz=20.0, order=3)
"""Filter of the motion that columns are made from before they are filtered as the torque is."""

EDGE_S = 1.0
"""Left out at either end: the filters' transients, and elements that have not slipped yet."""

RATE_SHARE = 10.0
"""Samples kept a second, in cutoffs of the torque's filter."""

DAMPING = 1e-3
"""Of the fits with effects: their columns are many and hardly told apart on one path."""

LEAST_GAIN = 0.02
"""Mean relative gain over the joints below which the search stops."""

THESIS_TABLE_3_2 = (2.38, 4.80, 12.83, 6.49, 15.29, 18.11)
"""The thesis' NRMSD on a path it was not fitted to, %, on another robot."""

THESIS = "thesis' model"
FILTERED = "columns filtered as the torque"
EFFECTS = "with the effects kept"


@dataclass(frozen=True)
class Row:
    """One model, fitted on one path and tested on another.

    Attributes:
        model: Which model.
        fitted_on: Path of the fit.
        tested_on: Path of the test.
        parameters: Number of parameters.
        condition: Condition number of the fit's weighted columns, each of unit length.
        nrmsd_percent: Error of each joint on the test path, % of its torque's range.
        fitted_nrmsd_percent: The same on the path of the fit.
    """

    model: str
    fitted_on: str
    tested_on: str
    parameters: int
    condition: float
    nrmsd_percent: tuple[float, ...]
    fitted_nrmsd_percent: tuple[float, ...]


@dataclass(frozen=True)
class Trial:
    """One effect that the search tried.

    Attributes:
        effect: Its name.
        what: What it is.
        kept_in_round: Round of the search that kept it, from 1; None if dropped.
        gain_percent: Mean relative gain over the joints, on the test path of the search: in the
            round that kept it, else in the last round.
        other_way_percent: The same in the direction that was not chosen on.
    """

    effect: str
    what: str
    kept_in_round: int | None
    gain_percent: float
    other_way_percent: float


@dataclass(frozen=True)
class Parameter:
    """One identified base parameter of the thesis' model."""

    name: str
    value: float
    standard_error: float


@dataclass(frozen=True)
class Study:
    """Results of the study.

    Attributes:
        schema: Name of this layout.
        arm: The arm's table.
        paths: The two paths; the search fits the first and tests on the second.
        rows: The models, each in both directions, then on further runs.
        thesis: The thesis' own errors, %.
        trials: What the search tried.
        parameters: Identified parameters of the thesis' model on the first path, SI units.
        provenance: When and from what this was made.
    """

    schema: str
    arm: str
    paths: tuple[str, str]
    rows: tuple[Row, ...]
    thesis: tuple[float, ...]
    trials: tuple[Trial, ...]
    parameters: tuple[Parameter, ...]
    provenance: Provenance


@dataclass(frozen=True)
class Prepared:
    """One path, ready to be fitted or tested on: filtered, cut, thinned.

    Attributes:
        name: The run.
        torque: Filtered torque, shape (n, joints).
        thesis: Base columns of filtered motion, as the thesis makes them.
        filtered: Base columns of barely filtered motion, then filtered.
        effects: Filtered columns of every candidate by name.
        independent_share: Share of its samples that are independent after the filter.
    """

    name: str
    torque: FloatArray
    thesis: FloatArray
    filtered: FloatArray
    effects: dict[str, FloatArray]
    independent_share: float

    def columns(self, kept: list[str]) -> FloatArray:
        """Return the filtered columns of the base and of some effects."""
        return np.concatenate([self.filtered, *(self.effects[name] for name in kept)], axis=2)


def open_paths(data: Path, names: Sequence[str]) -> list[Recording]:
    """Read runs of a folder by name.

    Raises:
        UsageError: There is nothing at the path.
        DataError: A run is missing or cannot be read.
    """
    campaign = open_campaign(data)
    missing = [name for name in names if name not in campaign.names]
    if missing:
        raise DataError(
            f"{data} holds no run {' and no run '.join(missing)}.",
            f"It holds: {', '.join(campaign.names) or 'nothing'}.",
            "Name those you mean: --paths FIRST SECOND",
        )
    return [campaign.select([name]).runs[0].recording() for name in names]


def prepare(recording: Recording) -> Prepared:
    """Filter one path and make its columns.

    Raises:
        DataError: The run is too short.
        ArmError: It holds no joints of the arm.
    """
    rate_hz = recording.sample_rate_hz
    position, _, torque = joint_channels(recording)
    edge = round(EDGE_S * rate_hz)
    if len(position) < 4 * edge:
        raise DataError(
            f"Run {recording.name!r} is too short to identify an arm.",
            f"{len(position) / rate_hz:.3g} s, of which {EDGE_S} s at either end are left out.",
        )
    base = base_of(PSM)
    every = max(1, round(rate_hz / (RATE_SHARE * LOW_PASS.cutoff_hz)))
    kept = slice(edge, len(position) - edge, every)
    fine = motion_of(position, 1 / rate_hz, FINE)

    def ready(columns: FloatArray) -> FloatArray:
        return smoothed(columns, rate_hz)[kept]

    coarse: Motion = motion_of(position, 1 / rate_hz)
    return Prepared(
        name=recording.name,
        torque=zero_phase(torque[:, : len(PSM.joints)], rate_hz, LOW_PASS)[kept],
        thesis=regressor(PSM, coarse)[kept][:, :, base.columns],
        filtered=ready(regressor(PSM, fine)[:, :, base.columns]),
        effects={effect.name: ready(effect.columns(fine)) for effect in candidates(PSM)},
        independent_share=min(1.0, 2 * LOW_PASS.cutoff_hz * every / rate_hz),
    )


def run_study(
    first: Recording,
    second: Recording,
    *,
    also: Sequence[Recording] = (),
    on_step: Callable[[str], None] = lambda step: None,
) -> Study:
    """Do the study on two paths of the same arm.

    Args:
        first: The path the search fits.
        second: The path it tests on.
        also: Further runs to test models on that were fitted on the second path.
        on_step: Called with what is being done.

    Raises:
        ArmError: A path does not tell the thesis' parameters, or holds no arm.
        DataError: A path is too short.
    """
    on_step("columns")
    there = (prepare(first), prepare(second))
    back = (there[1], there[0])
    on_step("effects")
    trials, kept = search(there, back, candidates(PSM))
    on_step("fits")
    rows = []
    for one, other in (there, back, *((there[1], prepare(run)) for run in also)):
        rows += [
            _row(THESIS, one, other, one.thesis, other.thesis, 0.0),
            _row(FILTERED, one, other, one.filtered, other.filtered, 0.0),
            _row(EFFECTS, one, other, one.columns(kept), other.columns(kept), DAMPING),
        ]
    found = _fit(there[0], there[0].thesis, 0.0)
    named = zip(base_of(PSM).names, found.values, found.errors, strict=True)
    return Study(
        schema="rig.study.pique/1",
        arm=f"{PSM.name}; {PSM.source}",
        paths=(first.name, second.name),
        rows=tuple(rows),
        thesis=THESIS_TABLE_3_2,
        trials=tuple(trials),
        parameters=tuple(Parameter(n, float(v), float(e)) for n, v, e in named),
        provenance=Provenance.now(0),
    )


def search(
    there: tuple[Prepared, Prepared],
    back: tuple[Prepared, Prepared],
    tried: tuple[ArmEffect, ...],
) -> tuple[list[Trial], list[str]]:
    """Add effects one by one, while one helps on the path that was not fitted.

    Args:
        there: Path to fit and path to test on: what is chosen on.
        back: The other direction: what is reported only.
        tried: The candidates.

    Returns:
        What became of each candidate, kept ones first, and the names of those kept in order.
    """
    names = [effect.name for effect in tried]
    chosen_on, reported = _Direction(*there, names), _Direction(*back, names)
    kept: list[str] = []
    trials: list[Trial] = []
    rest = list(tried)
    while rest:
        gains = [chosen_on.gain(kept, effect.name) for effect in rest]
        best = int(np.argmax(gains))
        if gains[best] < LEAST_GAIN:
            break
        effect = rest.pop(best)
        trials.append(_trial(effect, len(kept) + 1, gains[best], reported.gain(kept, effect.name)))
        kept.append(effect.name)
    for effect in rest:
        gain, other_way = (way.gain(kept, effect.name) for way in (chosen_on, reported))
        trials.append(_trial(effect, None, gain, other_way))
    return trials, kept


def _trial(effect: ArmEffect, kept_in_round: int | None, gain: float, other: float) -> Trial:
    return Trial(effect.name, effect.what, kept_in_round, 100 * gain, 100 * other)


class _Direction:
    """A path to fit and one to test on; any subset of the effects is one small solution.

    The damped fit of `estimation.arm.identification.fit`, from cross-products made once.
    """

    def __init__(self, one: Prepared, other: Prepared, names: list[str]) -> None:
        weights = thesis_weights(one.torque)
        own = one.columns(names)
        table = (own * weights[:, None]).reshape(-1, own.shape[2])
        self._length = np.linalg.norm(table, axis=0)
        self._length[self._length == 0] = 1.0
        table /= self._length
        self._gram = table.T @ table
        self._right = table.T @ (one.torque * weights).ravel()
        self._others = other.columns(names)
        self._torque = other.torque
        blocks = np.cumsum([one.filtered.shape[2], *(one.effects[n].shape[2] for n in names)])
        every = np.split(np.arange(blocks[-1]), blocks[:-1])
        self._base, self._places = every[0], dict(zip(names, every[1:], strict=True))

    def score(self, kept: list[str]) -> FloatArray:
        """Return the error of each joint on the test path, %."""
        own = np.concatenate([self._base, *(self._places[name] for name in kept)])
        damped = self._gram[np.ix_(own, own)] + DAMPING * np.eye(len(own))
        values = np.linalg.solve(damped, self._right[own]) / self._length[own]
        return nrmsd_percent(self._others[:, :, own] @ values, self._torque)

    def gain(self, kept: list[str], name: str) -> float:
        """Return the mean relative gain over the joints of one more effect; joints count alike."""
        return float(np.mean(1 - self.score([*kept, name]) / self.score(kept)))


def _fit(path: Prepared, columns: FloatArray, damping: float) -> Fit:
    weights = thesis_weights(path.torque)
    return fit(columns, path.torque, weights, damping, path.independent_share)


def _row(
    model: str,
    one: Prepared,
    other: Prepared,
    own: FloatArray,
    others: FloatArray,
    damping: float,
) -> Row:
    found = _fit(one, own, damping)
    return Row(
        model=model,
        fitted_on=one.name,
        tested_on=other.name,
        parameters=own.shape[2],
        condition=found.condition,
        nrmsd_percent=tuple(map(float, nrmsd_percent(others @ found.values, other.torque))),
        fitted_nrmsd_percent=tuple(map(float, nrmsd_percent(own @ found.values, one.torque))),
    )
