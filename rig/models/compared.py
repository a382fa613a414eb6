"""Two estimators on the same runs: which has the smaller error, by how much, and where."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import wilcoxon

from estimation.bank.interval import covered_share
from estimation.campaign import Campaign
from estimation.closing import is_closing, processed
from estimation.estimator import Estimator
from estimation.estimators.bank import BankEstimator
from estimation.estimators.instrument import is_own
from estimation.estimators.network import NetworkEstimator
from estimation.estimators.origin import Origin, data_hash
from estimation.filters import FilterError
from estimation.recording import Recording
from estimation.scores import rmse
from rig.errors import DataError, UsageError
from rig.models.origins import file_hash
from rig.output.provenance import Provenance

SCHEMA = "rig.estimators.compared/1"
CERTAIN = 0.05
"""Largest p of the signed-rank test at which one estimator is called better."""


@dataclass(frozen=True)
class Side:
    """One of the two estimators, by its file and the file's hash."""

    file: str
    hash: str
    origin: Origin | None  # where it comes from, as its file states; None where it states nothing
    seen: tuple[str, ...]  # runs compared on that it was fitted on, by the hash of their samples


@dataclass(frozen=True)
class RunErrors:
    """Errors on the valid closing samples of one run, SI units, of the first and the second."""

    run: str
    samples: int  # samples compared on
    rmse: tuple[float, float]
    mean: tuple[float, float]  # mean errors, estimate less truth
    # share of the samples inside the interval of 95 %, of those with one; None without
    covered: tuple[float | None, float | None]
    conditions: dict[str, float]  # the run's conditions that are numbers


@dataclass(frozen=True)
class Comparison:
    """Result for the channel that both sides estimate."""

    schema: str
    target: str
    sides: tuple[Side, Side]
    runs: tuple[RunErrors, ...]
    left_out: tuple[str, ...]  # runs without a valid closing sample
    rmse: tuple[float, float]  # root mean square errors over all samples
    # chance of runs' errors at least this different if neither were better (Wilcoxon's signed-rank
    # test); 1 for fewer than two runs
    p: float
    provenance: Provenance

    @property
    def better(self) -> int | None:
        """Index of the better one, None where the runs do not decide."""
        return None if self.p > CERTAIN else int(np.argmin(self.rmse))


def compare(
    files: tuple[Path, Path],
    estimators: tuple[Estimator, Estimator],
    campaign: Campaign,
    on_run: Callable[[str], None] = lambda name: None,
) -> Comparison:
    """Compare two estimators of one channel on the closing samples of every run of evidence.

    Both are asked whatever the instrument, since the runs state the error. `files` hold the
    estimators; `on_run` is called with each run's name when it has been compared.

    Raises:
        UsageError: They estimate different channels.
        DataError: No run has a valid closing sample.
        MissingChannelError: A run lacks a channel.
    """
    target = estimators[0].target
    if estimators[1].target != target:
        raise UsageError(
            f"The estimators estimate different channels: {target} and {estimators[1].target}.",
            fix="Compare two of the same channel.",
        )
    found, left_out, squares, hashes = [], [], [], {}
    for recording in campaign.evidence:
        errors = _on_run(estimators, recording, target)
        if errors is None:
            left_out.append(recording.name)
        else:
            found.append(errors)
            squares.append([errors.samples * value**2 for value in errors.rmse])
            hashes[recording.name] = data_hash(recording)
        on_run(recording.name)
    if not found:
        raise DataError("No run has a valid closing sample to compare on.")
    first, second = np.sqrt(np.sum(squares, axis=0) / sum(run.samples for run in found))
    sides = [
        _side(file, estimator, hashes) for file, estimator in zip(files, estimators, strict=True)
    ]
    return Comparison(
        SCHEMA,
        target,
        (sides[0], sides[1]),
        tuple(found),
        tuple(left_out),
        (float(first), float(second)),
        _chance([run.rmse for run in found]),
        Provenance.now(0),
    )


Stated = BankEstimator | NetworkEstimator
"""Estimators that state their instrument and origin."""


def _on_run(estimators: Iterable[Estimator], recording: Recording, target: str) -> RunErrors | None:
    try:
        run = processed(recording, [target])
    except FilterError:
        return None
    kept = is_closing(run) & run.valid
    if not kept.any():
        return None
    truth = run[target][kept]
    rmses, mean, covered = [], [], []
    for own in estimators:
        estimator, share = _allowed(own, recording), None
        if isinstance(estimator, BankEstimator):
            whole = estimator.estimate(recording)
            error = whole.value[kept] - truth
            share = covered_share(error, whole.half_width[kept])
        else:
            error = estimator.predict(recording)[kept] - truth
        rmses.append(rmse(error, 0.0))
        mean.append(float(error.mean()))
        covered.append(share)
    conditions = {k: v for k, v in recording.conditions.items() if isinstance(v, float)}
    return RunErrors(
        recording.name,
        int(kept.sum()),
        (rmses[0], rmses[1]),
        (mean[0], mean[1]),
        (covered[0], covered[1]),
        conditions,
    )


def _allowed(estimator: Estimator, recording: Recording) -> Estimator:
    """Return the estimator, without interval where the recording is of another instrument."""
    if not isinstance(estimator, Stated) or is_own(estimator.instrument, recording):
        return estimator
    return estimator.for_any_instrument()


def _side(file: Path, estimator: Estimator, hashes: dict[str, str]) -> Side:
    origin = estimator.origin if isinstance(estimator, Stated) else None
    fitted = set(origin.data.values()) if origin is not None else set()
    seen = tuple(name for name, value in hashes.items() if value in fitted)
    return Side(file.name, file_hash(file), origin, seen)


def _chance(rmse: list[tuple[float, float]]) -> float:
    logs = np.log(np.array(rmse))
    differences = logs[:, 0] - logs[:, 1]
    if len(differences) < 2 or not differences.any():
        return 1.0
    return float(wilcoxon(differences).pvalue)
