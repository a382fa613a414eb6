"""Excitations of an arm: the thesis' active-set search and ours, from the same starts."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation.arm.excitation import (
    FUNDAMENTAL_HZ,
    Excitation,
    by_active_set,
    condition,
    fitted,
    improved,
    numbers_of,
    reached,
    start,
)
from estimation.arm.tables import PSM
from estimation.files import write_text_atomic
from rig.output.page import Page
from rig.output.provenance import Provenance
from rig.output.table import TextTable

RATE_HZ = 200.0


@dataclass(frozen=True)
class Outcome:
    """What one search made of one start."""

    condition: float  # condition number of the base regressor, columns of unit length
    limits_share: float  # largest share of any limit that is used, by a bound for every instant
    seconds: float


@dataclass(frozen=True)
class Start:
    """One start and the results of the searches."""

    seed: int
    condition: float  # condition number there
    thesis: Outcome  # by the thesis' search
    shrunk: float  # condition number of the thesis' result once it is scaled into the limits
    ours: Outcome  # by our search, which goes on from the thesis' result; the time of both


@dataclass(frozen=True)
class ExcitationStudy:
    """The comparison; each search may take so many evaluations of the condition of each start."""

    schema: str
    arm: str
    evaluations: int
    starts: tuple[Start, ...]
    provenance: Provenance


def run_excitation(
    starts: int, evaluations: int, on_start: Callable[[int, int], None] = lambda done, total: None
) -> tuple[ExcitationStudy, Excitation]:
    """Return the comparison of both searches, and our excitation of the lowest condition number.

    They go from so many starts, of seeds from 0. Each search may take `evaluations` condition
    numbers of each start; `on_start` is called with the number of starts done and their total.
    """
    rows, made = [], []
    for seed in range(starts):
        begin = fitted(PSM, start(PSM, seed))
        clock = time.process_time()
        sampled = by_active_set(PSM, begin, evaluations)
        thesis_s = time.process_time() - clock
        found = improved(PSM, sampled, evaluations)
        ours_s = time.process_time() - clock
        shrunk = condition(PSM, fitted(PSM, numbers_of(PSM, sampled)))
        thesis, ours = _outcome(sampled, thesis_s), _outcome(found, ours_s)
        rows.append(Start(seed, condition(PSM, begin), thesis, shrunk, ours))
        made.append(found)
        on_start(len(made), starts)
    study = ExcitationStudy(
        "rig.study.excitation/1", PSM.name, evaluations, tuple(rows), Provenance.now(0)
    )
    return study, min(made, key=lambda each: condition(PSM, each))


def _outcome(found: Excitation, seconds: float) -> Outcome:
    return Outcome(condition(PSM, found), reached(PSM, found), seconds)


def page(study: ExcitationStudy) -> Page:
    """Return the comparison's page."""
    rows = []
    for each in study.starts:
        begin, shrunk = f"{each.condition:.0f}", f"{each.shrunk:.1f}"
        rows.append([str(each.seed), begin, *_cells(each.thesis), shrunk, *_cells(each.ours)])
    thesis, ours = (
        [f"{way}: {what}" for what in ("condition", "limits used, %", "core time, s")]
        for way in ("active set", "ours")
    )
    table = TextTable(
        f"Condition number of the base regressor, {study.evaluations} evaluations a search",
        ["start", "condition there", *thesis, "scaled into limits", *ours],
        rows,
        "Five harmonics of 0.1 Hz. Limits used: of position, velocity and acceleration, a bound"
        " for every instant (sampled values and half a step of the series' largest slope); up to"
        " 100 % nothing is passed. The thesis' limits are those within which its arm collides with"
        " nothing; its acceleration is not stated, four times the speed limit a second is assumed.",
    )
    return Page(f"Excitation of the {study.arm}", [], [table], study.provenance)


def _cells(found: Outcome) -> tuple[str, str, str]:
    return f"{found.condition:.1f}", f"{100 * found.limits_share:.1f}", f"{found.seconds:.1f}"


def write_trajectory(excitation: Excitation, path: Path) -> None:
    """Write one period of an excitation as text: time, s, and positions, rad or m, at 200 Hz."""
    instants = np.arange(round(RATE_HZ / FUNDAMENTAL_HZ)) / RATE_HZ
    position = excitation.motion(instants).position
    units = ["position_m" if j.kind == "prismatic" else "angle_rad" for j in PSM.joints]
    head = ",".join(["time_s", *(f"joint_{k}_{unit}" for k, unit in enumerate(units, start=1))])
    lines = [
        ",".join(f"{value:.9g}" for value in row) for row in np.column_stack([instants, position])
    ]
    write_text_atomic(path, "\n".join([head, *lines]) + "\n")
