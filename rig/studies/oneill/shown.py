"""What the figures of the study are drawn from: estimates on held-out runs, before and after.

Before is a straight line through the surrogate, as in Table I of the paper; after are the products
of physical states. Both are fitted on the same runs, and estimate the same runs held out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation.bank.states import Bank
from estimation.estimators.bank import fit_runs
from estimation.estimators.run_evidence import RunEvidence
from estimation.recording import FloatArray
from rig.studies.oneill import fits


@dataclass(frozen=True, eq=False)
class Closing:
    """Closing samples of one run.

    Attributes:
        name: The run.
        time_s: Shape (n,).
        rows: Filtered channels of the bank, shape (n, channels).
        truth: The target without lag, shape (n,).
    """

    name: str
    time_s: FloatArray
    rows: FloatArray
    truth: FloatArray


@dataclass(frozen=True, eq=False)
class Shown:
    """Estimates of one target on held-out runs, in its SI unit.

    Attributes:
        target: Channel that is estimated.
        runs: The runs.
        before: Estimate by a straight line through the surrogate, by run.
        after: Estimate by physical states, by run.
    """

    target: str
    runs: tuple[Closing, ...]
    before: tuple[FloatArray, ...]
    after: tuple[FloatArray, ...]

    @property
    def median_run(self) -> int:
        """Place of the run whose error after is the median."""
        errors = [np.mean((e - r.truth) ** 2) for e, r in zip(self.after, self.runs, strict=True)]
        return int(np.argsort(errors)[len(errors) // 2])


def shown(
    target: str,
    bank: Bank,
    runs: Sequence[Closing],
    evidence: Sequence[RunEvidence],
    splits: Sequence[np.ndarray],
) -> Shown:
    """Estimate each run by fits without it.

    Args:
        target: Channel that is estimated.
        bank: The states and products.
        runs: The runs.
        evidence: What is fitted of each run.
        splits: Places of the runs held out together.
    """
    before: dict[int, FloatArray] = {}
    after: dict[int, FloatArray] = {}
    load = bank.channels.index(bank.surrogate)
    for held_out in splits:
        rest = [k for k in range(len(runs)) if k not in held_out]
        line = fits.fit_line(
            np.concatenate([runs[k].rows[:, load] for k in rest]),
            np.concatenate([runs[k].truth for k in rest]),
        )
        estimator = fit_runs([evidence[k] for k in rest], bank, target)
        for k in map(int, held_out):
            before[k] = line(runs[k].rows[:, load])
            after[k] = estimator.of_rows(runs[k].rows).value
    places = sorted(after)
    return Shown(
        target,
        tuple(runs[k] for k in places),
        tuple(before[k] for k in places),
        tuple(after[k] for k in places),
    )
