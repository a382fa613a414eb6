"""What may be wrong with a comparison of two campaigns, in sentences."""

from collections.abc import Iterator, Sequence

import numpy as np

from estimation.causes.criterion import squared_of_runs
from estimation.causes.joint import Joint
from estimation.causes.scoring import Scored
from estimation.copies import copies
from estimation.recording import Recording


def of_recordings(first: Sequence[Recording], second: Sequence[Recording]) -> Iterator[str]:
    """Yield that runs are in both campaigns, and that their conditions differ, where it is so."""
    if found := copies([*first, *second]):
        pairs = ", ".join(f"{original} and {copy}" for copy, original in found.items())
        yield (
            f"Check: these runs are the same, sample by sample: {pairs}. Is one campaign named"
            " twice, or was a file copied? A run that is in both shows no change."
        )
    conditions = [
        {repr(sorted((k, str(v)) for k, v in r.conditions.items())) for r in runs}
        for runs in (first, second)
    ]
    if conditions[0] != conditions[1]:
        yield (
            "The two campaigns were not recorded under the same conditions: what the declared model"
            " lacks under a condition that only one of them has can appear as a change."
        )


def unexplained(
    joint: Joint, causes: Sequence[Scored], is_b: Sequence[bool], least: float = 1.2
) -> Iterator[str]:
    """Yield which equations still fit every run of one campaign worse than all of the other.

    The medians of the errors differ by a factor of `least` or more.
    """
    for one in causes:
        joint = joint.with_cause(one.candidate.laid, one.candidate.precision)
    base, later = joint.fitted_on(np.ones(len(is_b))), np.array(is_b)
    for name, equation in joint.layout.equations.items():
        p = name, "within"
        error = np.sqrt(np.maximum(squared_of_runs(joint, base, p), 0.0) / joint.samples[p])
        sides = {"first": error[~later], "second": error[later]}
        better, worse = sorted(sides, key=lambda side: float(np.median(sides[side])))
        low, high = (float(np.median(sides[side])) for side in (better, worse))
        if sides[worse].min() > sides[better].max() and high >= least * low:
            yield (
                f"Check: the equation {name} fits the {worse} campaign worse than the {better} one,"
                f" {high:.3g} against {low:.3g} {equation.model.unit}. More has changed than is"
                " stated here, its form is another one, or a sensor has more noise."
            )
