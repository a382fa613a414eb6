"""The processing and the linear fits of O'Neill et al. 2018, on any campaign of the grasper rig.

Source: J. J. O'Neill, T. K. Stephens, T. M. Kowalewski, "Evaluation of torque measurement
surrogates as applied to grip torque and jaw angle estimation of robotic surgical tools", IEEE
Robotics and Automation Letters 2018, sections II.C and II.E, Table I.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign, Split, Table
from estimation.closing import closing_samples, processed
from estimation.errors import EstimationError
from estimation.recording import FloatArray, Recording
from estimation.scores import Score, score

AUTHORS_SKIP = 1 / 8
"""The authors' linear fit omits this first part of the closing samples."""

TEST_SHARE = 0.15
"""Share of the samples that the paper's random split tests on."""

SURROGATES = {
    "command": "motor_command_ratio",
    "current": "motor_current_a",
    "gearbox": "gearbox_differential_rad",
}
"""The paper's torque surrogates by short name, and the channel of each."""

TARGET = "proximal_torque_n_m"


class StudyError(EstimationError):
    """After the paper's processing no samples remain to fit or to score."""


@dataclass(frozen=True)
class LinearFit:
    """The paper's linear fit: torque = gain x surrogate + offset, SI units."""

    gain: float
    offset: float

    def __call__(self, surrogate: FloatArray) -> FloatArray:
        """Return the estimate for surrogate values of shape (n,)."""
        return self.gain * surrogate + self.offset


def fit_line(surrogate: FloatArray, torque: FloatArray) -> LinearFit:
    """Fit a line by least squares.

    Args:
        surrogate: Shape (n,).
        torque: Shape (n,), N m.

    Raises:
        StudyError: Fewer than two samples, or the surrogate does not vary.
    """
    if len(surrogate) < 2 or np.ptp(surrogate) == 0:
        raise StudyError(
            f"A line cannot be fitted to {len(surrogate)} closing samples.",
            "The spindle never closes fast enough, or the surrogate is constant.",
        )
    centre = surrogate.mean()
    gain = float((surrogate - centre) @ torque / np.sum((surrogate - centre) ** 2))
    return LinearFit(gain, float(torque.mean() - gain * centre))


def score_authors(surrogate: FloatArray, torque: FloatArray) -> tuple[LinearFit, Score]:
    """Fit and score on the last 7/8 of the closing samples, as the authors do."""
    first = round(len(surrogate) * AUTHORS_SKIP)
    fit = fit_line(surrogate[first:], torque[first:])
    return fit, score(fit(surrogate[first:]), torque[first:])


def score_random(surrogate: FloatArray, torque: FloatArray, seed: int) -> tuple[LinearFit, Score]:
    """Fit on a random 85 % of the samples and score on the rest, as the paper does.

    Neighbouring samples are almost equal, so the test samples are no new evidence: this split is
    for comparison with the paper only.
    """
    order = np.random.default_rng(seed).permutation(len(surrogate))
    test, train = np.split(order, [round(TEST_SHARE * len(order))])
    fit = fit_line(surrogate[train], torque[train])
    return fit, score(fit(surrogate[test]), torque[test])


Fitter = Callable[[Table], Callable[[Table], FloatArray]]
"""Fits on a table of closing samples and returns what estimates the torque on another one."""


def linear_fitter(channel: str) -> Fitter:
    """Return the fitter of the linear fit on one channel."""

    def fit(table: Table) -> Callable[[Table], FloatArray]:
        line = fit_line(table.columns[channel], table.columns[TARGET])
        return lambda other: line(other.columns[channel])

    return fit


ESTIMATE = "estimate_n_m"


def held_out(splits: list[Split], channels: Iterable[str], fitter: Fitter) -> Table:
    """Fit on each split's training runs and estimate its test runs; all test runs in one table.

    Args:
        splits: Splits of a campaign of closing samples; see `Campaign.folds`.
        channels: Channels the fitter needs, and any others wanted in the table.
        fitter: The estimator to fit.

    Returns:
        The channels, `TARGET` and `ESTIMATE` of all test runs, N m for the last two.
    """
    wanted = list(dict.fromkeys([*channels, TARGET]))
    tables, estimates = [], []
    names: list[str] = []
    runs: list[NDArray[np.intp]] = []
    for split in splits:
        estimator = fitter(split.train.concatenate(wanted, valid_only=False))
        test = split.test.concatenate(wanted, valid_only=False)
        estimates.append(estimator(test))
        runs.append(test.run + len(names))
        names += test.names
        tables.append(test)
    columns = {name: np.concatenate([t.columns[name] for t in tables]) for name in wanted}
    return Table(
        {**columns, ESTIMATE: np.concatenate(estimates)}, np.concatenate(runs), tuple(names)
    )


def score_table(table: Table) -> Score:
    """Score the estimate of a table from `held_out`."""
    return score(table.columns[ESTIMATE], table.columns[TARGET])


def closing_campaign(
    campaign: Campaign,
    names: Iterable[str],
    on_run: Callable[[Recording], None] = lambda run: None,
) -> Campaign:
    """Reduce a campaign to its closing samples, held in memory; excluded runs stay excluded.

    Args:
        campaign: Raw runs, read one at a time.
        names: Channels to keep.
        on_run: Called with each processed run, before it is reduced.
    """
    wanted = list(names)

    def reduced() -> Iterable[Recording]:
        for recording in campaign:
            run = processed(recording, wanted)
            on_run(run)
            yield closing_samples(run)

    return Campaign.of(reduced())
