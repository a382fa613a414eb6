"""An estimator fitted on one instrument, made to fit another one with a run or a few.

The weights of the source are the mean of a Gaussian prior; how far each may move depends on what
differs between instruments. Of a state estimator, the zero and the spring of the cables and wrist,
functions of position alone, differ most and have a wide prior; the gain of the load, which is the
motor's, a narrow one; the rest a medium one. Zero and gain are not distinguishable in a single run
at one load, so the prior decides. A network keeps its hidden layer, and its output layer is fitted
again, as in transfer learning for instruments of the da Vinci: J. Zhang, N. Yilmaz, U. Tumerdem, P.
Kazanzides, "Learning based estimation of 7 DOF instrument and environment interaction forces on the
da Vinci Research Kit" (2022), where a network of another instrument is trained on with a little
data.

The stiffnesses of states were chosen on two instruments of the public data set
MRDLab/mis-tool-characterization, that of networks on one of them, Tool_4_Maryland_L_2; the one of
changes at other angles also on Tool_4_Maryland_L_Pitch_1 and _Roll_1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.bank.beyond import Visits, cut_to
from estimation.bank.fitting import Normal, pull
from estimation.bank.interval import Interval, scaled, with_scores
from estimation.bank.states import LAGS, Bank
from estimation.closing import is_closing, processed
from estimation.estimators.bank import EVERY, BankEstimator, fit_runs
from estimation.estimators.network import NetworkEstimator
from estimation.estimators.run_evidence import RunEvidence
from estimation.networks import training
from estimation.networks.network import NetworkError, to_unit
from estimation.recording import FloatArray, Recording

Adaptable = BankEstimator | NetworkEstimator

POSITION, LOAD, REST = 1e-3, 10.0, 3.0
"""Stiffness of the weights of products of position alone, of those with the load, of the others."""

FLAT = 0.01
"""Penalty on a change of the estimate at angles that the runs adapted with lack, beyond its change
at the nearest angle that they have. Without it a polynomial of the angle fitted on one jaw stop
grows to thousands of mN m on the next."""
ANGLES, EVERY_ROW = 13, 20
"""Angles at which that change is computed, and of how many samples one is used."""

NORMAL_95 = 1.96
"""Half widths of 95 % are so many standard deviations of a normal distribution."""

OUTPUT, NODE_SPREAD = 0.1, 0.3
"""Stiffness of the weights of a network's output layer, and the spread it is relative to: that of a
logistic node at work. A node that barely varies in the given runs must keep its weight."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Closing samples of one run of another instrument.

    Attributes:
        rows: Filtered channels the estimator reads, shape (n, channels).
        truth: The target, shape (n,).
        valid: Samples without a flag, shape (n,); only they are fitted.
    """

    rows: FloatArray
    truth: FloatArray
    valid: np.ndarray

    @property
    def flagged(self) -> int:
        """Number of flagged samples."""
        return int((~self.valid).sum())

    @property
    def fitted(self) -> tuple[FloatArray, FloatArray]:
        """Rows and target that are fitted: every fourth valid sample."""
        kept = np.flatnonzero(self.valid)[::EVERY]
        return self.rows[kept], self.truth[kept]

    def estimate(self, estimator: Adaptable) -> FloatArray:
        """Return an estimator's estimates, shape (n,)."""
        if isinstance(estimator, BankEstimator):
            return estimator.of_rows(self.rows).value
        return estimator.network(self.rows)[:, 0]

    def covered(self, estimator: Adaptable) -> NDArray[np.bool_] | None:
        """Return whether the interval covers the sensor, of the samples with one; None without."""
        if not isinstance(estimator, BankEstimator) or estimator.interval is None:
            return None
        found = estimator.of_rows(self.rows)
        inside = np.abs(found.value - self.truth) <= found.half_width
        return np.asarray(inside[np.isfinite(found.half_width)])


def _channels(estimator: Adaptable) -> tuple[str, ...]:
    if isinstance(estimator, BankEstimator):
        return estimator.bank.channels
    return estimator.network.inputs


def evidence(estimator: Adaptable, recording: Recording) -> Evidence | None:
    """Reduce a raw run to what an estimator reads; None where it has no valid closing sample.

    Raises:
        MissingChannelError: The run lacks a channel.
    """
    names = _channels(estimator)
    run = processed(recording, [*names, estimator.target], estimator.low_pass)
    kept = is_closing(run)
    if not (kept & run.valid).any():
        return None
    rows = np.column_stack([run[name][kept] for name in names])
    return Evidence(rows, run[estimator.target][kept], run.valid[kept])


def adapted(source: Adaptable, runs: Sequence[Evidence]) -> Adaptable:
    """Return the source's estimator adapted to the runs of another instrument.

    Its interval is the source's, wider away from the conditions of the runs; a network has none.

    Args:
        source: Fitted on another instrument.
        runs: Runs of the new one.

    Raises:
        NetworkError: The campaign is empty.
    """
    if not runs:
        raise NetworkError("No closing samples to adapt the estimator with.")
    if isinstance(source, BankEstimator):
        return adapted_states(source, reduced(source, runs))
    return _adapted_network(source, runs)


def scratch(like: Adaptable, runs: Sequence[Evidence]) -> Adaptable:
    """Return an estimator of the same kind fitted on these runs alone.

    Raises:
        NetworkError: The campaign is empty, or torch is missing.
    """
    if isinstance(like, BankEstimator):
        return fit_runs(reduced(like, runs), like.bank, like.target)
    rows, truth = (np.concatenate(part) for part in zip(*(r.fitted for r in runs), strict=True))
    nodes = len(like.network.hidden)
    names = (like.network.inputs, like.network.outputs)
    settings = training.Settings(nodes=nodes)
    trained = training.train(rows[::EVERY], truth[::EVERY, None], names, settings)
    return NetworkEstimator(trained.network, like.low_pass)


def reduced(source: BankEstimator, runs: Sequence[Evidence]) -> list[RunEvidence]:
    """Return runs of another instrument as a fit of states takes them."""
    fitted = [run.fitted for run in runs]
    return [
        part
        for rows, truth in fitted
        for part in RunEvidence.of_rows(source.bank, rows, truth[:, None])
    ]


def adapted_states(source: BankEstimator, runs: Sequence[RunEvidence]) -> BankEstimator:
    """Return a state estimator adapted to reduced runs, as `adapted` does."""
    stiff = stiffness(source.bank)

    def pulled(part: Sequence[RunEvidence]) -> FloatArray:
        flat = FLAT * _change_elsewhere(source, part)
        return pull([run.normal for run in part], source.weights, source.scale, stiff, flat)

    weights = pulled(runs)
    interval = None if source.interval is None else _interval(source.interval, runs, pulled)
    lowest = np.min([source.ranges[0], *(run.ranges[0] for run in runs)], axis=0)
    highest = np.max([source.ranges[1], *(run.ranges[1] for run in runs)], axis=0)
    ranges = np.array([lowest, highest])
    return replace(
        source, weights=weights, interval=interval, ranges=ranges, instrument="", origin=None
    )


def _change_elsewhere(source: BankEstimator, runs: Sequence[RunEvidence]) -> FloatArray:
    """Return the mean square of what weights add at angles that runs lack, shape (size, size).

    Samples of the runs are moved to angles over three times the range of source and runs, and
    compared with themselves at the nearest angle that the runs have.
    """
    rows = np.concatenate([run.rows for run in runs])[::EVERY_ROW]
    angle = rows[:, 0]
    low, high = angle.min(), angle.max()
    lowest, highest = min(low, source.ranges[0, 0]), max(high, source.ranges[1, 0])
    span = highest - lowest
    total = np.zeros((source.bank.size, source.bank.size))
    angles = np.linspace(lowest - span, highest + span, ANGLES)
    for moved in angles[(angles < low) | (angles > high)]:
        there, near = rows.copy(), rows.copy()
        there[:, 0], near[:, 0] = moved, np.clip(moved, low, high)
        change = source.bank.design(there) - source.bank.design(near)
        total += change.T @ change / (len(rows) * ANGLES)
    return total


def _interval(
    source: Interval,
    runs: Sequence[RunEvidence],
    pulled: Callable[[Sequence[RunEvidence]], FloatArray],
) -> Interval | None:
    """Return the source's interval, wider away from the runs adapted with.

    It is stated at the angles and poses of both the source and these runs; None where they share
    none. Loads and speeds that no run of the new instrument has cost what unfitted ones cost on the
    source. Where several runs are given, each by weights adapted with the others shows if that is
    enough; the interval is never narrower.
    """
    places = [run.places for run in runs]
    shared = cut_to(source.beyond, np.concatenate(places))
    if shared is None:
        return None
    source = replace(source, beyond=shared)
    visits = Visits(places, shared)
    found = with_scores(source, visits.scores(np.arange(len(runs))).values)
    ratios = []
    for k, run in enumerate(runs if len(runs) > 1 else []):
        others = [j for j in range(len(runs)) if j != k]
        wide = with_scores(source, visits.scores(np.array(others)).values)
        error = run.design @ pulled([runs[j] for j in others]) - run.truth
        square = (NORMAL_95 * error / wide.half_width(run.design, run.places)) ** 2
        if np.isfinite(square).any():
            ratios.append(np.nanmean(square))
    return scaled(found, max(float(np.mean(ratios)), 1.0) ** 0.5) if ratios else found


def spread_out(runs: Sequence[RunEvidence], count: int) -> list[int]:
    """Return the runs to adapt with: those that are closest to all the others.

    One after another, the run is taken after which the mean score of all runs by those taken is
    least. Only the conditions of the samples are used, not the target.

    Args:
        runs: Runs of the new instrument to choose from.
        count: How many, at most all.
    """
    visits = Visits([run.places for run in runs])
    taken: list[int] = []
    for _ in range(min(count, len(runs))):
        left = [k for k in range(len(runs)) if k not in taken]
        taken.append(min(left, key=lambda k: visits.mean_by(np.array([*taken, k]))))
    return taken


def _adapted_network(source: NetworkEstimator, runs: Sequence[Evidence]) -> NetworkEstimator:
    network = source.network
    normals = []
    for rows, truth in (run.fitted for run in runs):
        design = np.column_stack([np.ones(len(rows)), network.nodes(rows)])
        unit = to_unit(truth[:, None], network.output_range)
        normals.append(Normal.of(design, unit))
    prior = np.roll(network.output[0], 1)  # the bias first
    stiff = np.full(len(prior), OUTPUT)
    stiff[0] = 0.0
    scale = np.full(len(prior), NODE_SPREAD)
    moved = np.roll(pull(normals, prior, scale, stiff), -1)
    return replace(source, network=replace(network, output=moved[None]), instrument="", origin=None)


def stiffness(bank: Bank) -> FloatArray:
    """Return how stiffly the prior holds each weight of a bank, shape (size,)."""
    found = np.full(bank.size, REST)
    for k, product in enumerate(bank.products):
        if set(product) == {"q"}:
            found[k] = POSITION
        elif set(product) <= {"q", "c", *LAGS}:
            found[k] = LOAD
    found[0] = 0.0  # the zero is free
    return found
