"""The errors that an answer states, relative to the target."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.case import Report
from estimation.diagnosis.split import path_of
from estimation.recording import Recording


@dataclass(frozen=True)
class Errors:
    """Error of the test runs over the root mean square of the target there, before and after."""

    before: float
    after: float

    def percent(self) -> str:
        """Return both in percent, in words."""
        if math.isnan(self.before + self.after):
            return "no error stated"
        return f"{100 * self.before:.2f} -> {100 * self.after:.2f} %"


def errors(
    runs: Sequence[Recording], target: str, report: Report, equation: str = "motor"
) -> Errors:
    """Return the errors an answer states, relative to the target; not a number where none is."""
    names = {path_of(name) for name in report["runs"]["confirm"]}  # of parts, the whole recordings
    test = [run[target] for run in runs if run.name in names]
    size = math.sqrt(float(np.mean(np.concatenate(test) ** 2)))
    stated = [report[f"rmse_with_means_{when}"].get(equation) for when in ("before", "after")]
    return Errors(*(math.nan if error is None else error / size for error in stated))
