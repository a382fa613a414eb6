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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimation.bank.beyond import Visits, cut_to
from estimation.bank.edges import other_levels
from estimation.bank.fitting import Normal, pull
from estimation.bank.interval import Interval, scaled, with_scores
from estimation.bank.states import LAGS, Bank
from estimation.closing import is_closing, processed
from estimation.estimator import rows_of
from estimation.estimators.bank import EVERY, BankEstimator, fit_runs
from estimation.estimators.network import NetworkEstimator
from estimation.estimators.run_evidence import RunEvidence, ranges_of
from estimation.networks import training
from estimation.networks.network import NetworkError, to_unit
from estimation.recording import FloatArray, Recording

Adaptable = BankEstimator | NetworkEstimator

POSITION, LOAD, REST = 1e-3, 10.0, 3.0
"""Stiffness of the weights of products of position alone, of those with the load, of the others."""

FLAT = 0.01
"""Penalty on a change of the source's estimate at angles that the runs adapted with lack, over its
change at the nearest angle that they have. Without it a polynomial of the angle fitted on one jaw
stop grows to thousands of mN m on the next."""
ANGLES, EVERY_ROW = 13, 20
"""Angles at which that change is computed, and of how many samples one is used."""

NORMAL_95 = 1.96
"""Half widths of 95 % are so many standard deviations of a normal distribution."""

OUTPUT, NODE_SPREAD = 0.1, 0.3
"""Stiffness of the weights of a network's output layer, and the spread it is relative to: that of a
logistic node at work. A node that barely varies in the given runs must keep its weight."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Closing samples of one run of another instrument."""

    rows: FloatArray  # filtered channels the estimator reads, shape (n, channels)
    truth: FloatArray  # the target, shape (n,)
    valid: np.ndarray  # samples without a flag, shape (n,); only they are fitted
    conditions: Mapping[str, float | str] = field(default_factory=dict)  # conditions of the run

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


def evidence(estimator: Adaptable, recording: Recording) -> Evidence | None:
    """Reduce a raw run to what an estimator reads; None where it has no valid closing sample.

    Raises:
        MissingChannelError: The run lacks a channel.
    """
    run = processed(recording, [*estimator.channels, estimator.target], estimator.low_pass)
    kept = is_closing(run)
    if not (kept & run.valid).any():
        return None
    rows = rows_of(run, estimator.channels)[kept]
    return Evidence(rows, run[estimator.target][kept], run.valid[kept], recording.conditions)


def adapted(source: Adaptable, runs: Sequence[Evidence]) -> Adaptable:
    """Return the source's estimator adapted to some runs of another instrument.

    Its interval is the source's, wider away from the conditions of the runs; a network has none.

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
    fitted = [(*run.fitted, run.conditions) for run in runs]
    return [
        part
        for rows, truth, conditions in fitted
        for part in RunEvidence.of_rows(source.bank, rows, truth[:, None], conditions)
    ]


def adapted_states(source: BankEstimator, runs: Sequence[RunEvidence]) -> BankEstimator:
    """Return a state estimator adapted to reduced runs, as `adapted` does."""
    stiff = stiffness(source.bank)

    def pulled(part: Sequence[RunEvidence]) -> FloatArray:
        normals, as_the_source = [run.normal for run in part], _elsewhere(source, part)
        return pull(normals, source.weights, source.scale, stiff, as_the_source)

    def ranges(part: Sequence[RunEvidence]) -> FloatArray:
        return ranges_of([source.ranges, *(run.ranges for run in part)])

    def error(part: Sequence[RunEvidence], run: RunEvidence) -> FloatArray:
        return run.estimate(source.bank, pulled(part), ranges(part)) - run.truth

    interval = None
    if source.interval is not None:
        as_it_is = [source.of_design(run.design, run.rows).value for run in runs]
        misfit = [float(np.var(e - r.truth)) for e, r in zip(as_it_is, runs, strict=True)]
        interval = _interval(source.interval, runs, error, float(np.mean(misfit)))
    new = {name for run in runs for name in other_levels(source.only, run.conditions)}
    return replace(
        source,
        weights=pulled(runs),
        interval=interval,
        ranges=ranges(runs),
        instrument="",
        origin=None,
        only={name: level for name, level in source.only.items() if name not in new},
    )


def _elsewhere(source: BankEstimator, runs: Sequence[RunEvidence]) -> tuple[FloatArray, FloatArray]:
    """Return normal equations of the source's shape at angles that runs lack.

    Samples of the runs are moved to angles over three times the range of source and runs. There the
    estimate is to differ from that at the nearest angle the runs have as the source's does.
    """
    rows = np.concatenate([run.rows for run in runs])[::EVERY_ROW]
    angle = rows[:, 0]
    low, high = angle.min(), angle.max()
    lowest, highest = min(low, source.ranges[0, 0]), max(high, source.ranges[1, 0])
    span = highest - lowest
    gram, cross = np.zeros((source.bank.size, source.bank.size)), np.zeros(source.bank.size)
    angles = np.linspace(lowest - span, highest + span, ANGLES)
    for moved in angles[(angles < low) | (angles > high)]:
        there, near = rows.copy(), rows.copy()
        there[:, 0], near[:, 0] = moved, np.clip(moved, low, high)
        change = source.bank.design(there) - source.bank.design(near)
        of_source = source.of_rows(there).value - source.of_rows(near).value
        gram += change.T @ change
        cross += change.T @ of_source
    weight = FLAT / (len(rows) * ANGLES)
    return weight * gram, weight * cross


def _interval(
    source: Interval,
    runs: Sequence[RunEvidence],
    error: Callable[[Sequence[RunEvidence], RunEvidence], FloatArray],
    misfit: float,
) -> Interval | None:
    """Return the source's interval, wider away from the runs adapted with.

    It is stated at the angles and poses of both the source and these runs; None where they share
    none. Places that no run of the new instrument has cost what unfitted ones cost on the source,
    or, where it is more, the variance of the source's error within the new runs: the prior variance
    of the difference between the instruments, of which the score is the share that is left. Where
    several runs are given, each by weights adapted with the others shows if that is enough; the
    interval is never narrower.
    """
    places = [run.places for run in runs]
    shared = cut_to(source.beyond, np.concatenate(places))
    if shared is None:
        return None
    source = replace(source, beyond=shared, price=max(source.price, NORMAL_95**2 * misfit))
    visits = Visits(places, shared)
    found = with_scores(source, visits.scores(np.arange(len(runs))).values)
    ratios = []
    for k, run in enumerate(runs if len(runs) > 1 else []):
        others = [j for j in range(len(runs)) if j != k]
        wide = with_scores(source, visits.scores(np.array(others)).values)
        missed = error([runs[j] for j in others], run)
        square = (NORMAL_95 * missed / wide.half_width(run.design, run.places)) ** 2
        if np.isfinite(square).any():
            ratios.append(np.nanmean(square))
    return scaled(found, max(float(np.mean(ratios)), 1.0) ** 0.5) if ratios else found


def spread_out(runs: Sequence[RunEvidence], count: int) -> list[int]:
    """Return which runs to adapt with, at most `count`: those that are closest to all the others.

    One after another, the run is taken after which the mean score of all runs by those taken is
    least. Only the conditions of the samples are used, not the target.
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
