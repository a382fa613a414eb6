"""The declared model's residual without hidden effects: denominator of the error ratio.

The declared model is fitted on the answer's training runs of the same campaign simulated without
the effects, and its error is that of the answer's test runs: over all valid samples, filtered as
the model says, each run's mean removed.
"""

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.case import Report
from estimation import model_file
from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.model import Model, balance_channels, estimate, settled
from estimation.recording import FloatArray
from rig.importers.registry import open_campaign


def errors_without(
    write: Callable[[Path], None], report: Report, equations: Iterable[str]
) -> dict[str, float]:
    """Return the error of each equation, in the unit of its target.

    Args:
        write: Writes the campaign without the effects into an empty folder.
        report: The answer whose training and test runs are used.
        equations: Names of shipped models.
    """
    with tempfile.TemporaryDirectory(prefix="case-") as folder:
        write(Path(folder))
        recordings = list(open_campaign(Path(folder)))
    training, test = (
        Campaign.of([r for r in recordings if r.name in report["runs"][part]])
        for part in ("discover", "confirm")
    )
    errors = {}
    for equation in equations:
        fitted = fit(model_file.read(Path(equation)), training, bootstrap=0)
        errors[equation] = _error(replace(fitted, counted="all"), test)
    return errors


def _error(model: Model, test: Campaign) -> float:
    """Return the root mean square residual over all valid samples, means removed."""
    parts = list[FloatArray]()
    for recording in test.evidence:
        run = balance_channels(model, recording)
        left = (run[model.target] - estimate(model, run))[settled(model, run)]
        parts.append(left - left.mean() if model.run_offsets else left)
    whole = np.concatenate(parts)
    return float(np.sqrt(np.mean((whole if model.run_offsets else whole - whole.mean()) ** 2)))
