"""Handing measured runs over to `rig diagnose`: MATLAB files, and the errors its answer states."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.io import savemat

from benchmarks.diagnosis.case import Report
from estimation.recording import FloatArray

MODELS = Path(__file__).parent


@dataclass(frozen=True, eq=False)
class Run:
    """One run.

    Attributes:
        name: Its name; runs are in the order of their names.
        time_s: Shape (n,), from 0 on.
        columns: Channels, SI units, names that end in the unit, shape (n,) each.
        conditions: What was held constant, names that end in a unit, or text.
    """

    name: str
    time_s: FloatArray
    columns: Mapping[str, FloatArray]
    conditions: Mapping[str, float | str] = field(default_factory=dict)


def write(runs: Sequence[Run], folder: Path) -> None:
    """Write the runs into a folder, one MATLAB file a run."""
    for run in runs:
        content = {"time_s": run.time_s, **run.columns, **run.conditions}
        savemat(folder / f"{run.name}.mat", content, oned_as="column")


def options(model: str) -> list[str]:
    """Return the words that name a declared model of this folder."""
    return ["--model", str(MODELS / f"{model}.model.toml")]


def cut(run: Run, at: Sequence[int]) -> list[Run]:
    """Return the parts of a run between some samples, each on a clock of its own."""
    parts = []
    for k, (first, last) in enumerate(itertools.pairwise(at)):
        part = slice(first, last)
        columns = {name: values[part] for name, values in run.columns.items()}
        time_s = run.time_s[part] - run.time_s[first]
        parts.append(Run(f"{run.name}-{k:02d}", time_s, columns, run.conditions))
    return parts


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


def errors(runs: Sequence[Run], target: str, report: Report, equation: str = "motor") -> Errors:
    """Return the errors an answer states, relative to the target; not a number where none is."""
    test = [run.columns[target] for run in runs if run.name in report["runs"]["confirm"]]
    size = math.sqrt(float(np.mean(np.concatenate(test) ** 2)))
    stated = [report[f"rmse_with_means_{when}"].get(equation) for when in ("before", "after")]
    return Errors(*(math.nan if error is None else error / size for error in stated))
