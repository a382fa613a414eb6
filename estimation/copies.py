"""Runs that are the same sample by sample: a file that was copied, or imported twice.

A run is the unit of evidence. A copy adds no evidence, and one among the test runs would
confirm what was fitted on the original.
"""

from collections.abc import Iterable

import numpy as np

from estimation.campaign import Campaign, Run
from estimation.diagnosis.split import samples_hash
from estimation.errors import ExplainedError
from estimation.recording import FloatArray, Recording

SAME_S = 1e-6
"""Difference of two clocks that is the rounding of their times, s."""


def copies(recordings: Iterable[Recording]) -> dict[str, str]:
    """Return the runs with the samples of an earlier one, each with the name of the first.

    Runs of two rigs or instruments are not copies: such runs do not make one campaign. The clock of
    a copy may begin at another time.
    """
    found: dict[str, str] = {}
    known: dict[tuple[object, ...], list[tuple[str, FloatArray]]] = {}
    for run in recordings:
        since = run.time_s - run.time_s[:1]
        alike = known.setdefault((samples_hash(run, of_clock=False), run.rig, run.instrument), [])
        first = next((n for n, own in alike if np.allclose(own, since, rtol=0, atol=SAME_S)), None)
        if first is None:
            alike.append((run.name, since))
        else:
            found[run.name] = first
    return found


def without_copies(campaign: Campaign) -> Campaign:
    """Return a campaign in which the copies of a run are excluded, with the reason.

    Only runs in memory, and runs of different files of one size, are read for it.
    """
    found = copies(filter(None, map(_read, _candidates(campaign.evidence))))
    reason = "it is the same as {}, sample by sample; delete one of them"
    return campaign.exclude({name: reason.format(first) for name, first in found.items()})


def _candidates(campaign: Campaign) -> list[Run]:
    sizes: dict[int, set[str]] = {}
    own: dict[str, int] = {}
    for run in campaign.runs:
        if run.source is not None and run.source.is_file():
            own[run.name] = run.source.stat().st_size
            sizes.setdefault(own[run.name], set()).add(str(run.source))
    return [run for run in campaign.runs if run.name not in own or len(sizes[own[run.name]]) > 1]


def _read(run: Run) -> Recording | None:
    """Return a run's recording; None of one that is damaged, which reading it later states."""
    try:
        return run.recording()
    except ExplainedError:
        return None
