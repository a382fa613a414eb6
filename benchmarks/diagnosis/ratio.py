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
from estimation.residual import centred, residuals
from rig.importers.registry import open_campaign

EVERY_HZ = 1e6
"""Above any rate of recording: every sample counts."""


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
        parts = residuals(replace(fitted, counted="all"), test, EVERY_HZ)
        left = np.concatenate(centred(fitted, [part.values for part in parts]))
        errors[equation] = float(np.sqrt(np.mean(left**2)))
    return errors
