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
MRDLab/mis-tool-characterization, that of networks on one of them, Tool_4_Maryland_L_2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation.bank.fitting import Normal, pull
from estimation.bank.interval import rescaled
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
        """Return for which samples the interval covers the sensor, shape (n,); None without one."""
        if not isinstance(estimator, BankEstimator) or estimator.interval is None:
            return None
        found = estimator.of_rows(self.rows)
        return np.asarray(np.abs(found.value - self.truth) <= found.half_width)


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

    Its interval is the source's, widened so that it covers the runs, each by weights adapted with
    the others where there are several; a network has none.

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
        return pull([run.normal for run in part], source.weights, source.scale, stiff)

    weights, interval = pulled(runs), None
    if source.interval is not None:
        others = [[other for other in runs if other is not run] or [run] for run in runs]
        residuals = [
            run.design @ pulled(part) - run.truth for run, part in zip(runs, others, strict=True)
        ]
        interval = rescaled(source.interval, [run.design for run in runs], residuals)
    lowest = np.min([source.ranges[0], *(run.ranges[0] for run in runs)], axis=0)
    highest = np.max([source.ranges[1], *(run.ranges[1] for run in runs)], axis=0)
    ranges = np.array([lowest, highest])
    return replace(
        source, weights=weights, interval=interval, ranges=ranges, instrument="", origin=None
    )


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
