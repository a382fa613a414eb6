"""What a diagnosis costs, and how that grows; `docs/figures/diagnosis_cost.py`.

Timed is a whole diagnosis of a campaign, and how the parts of a search grow with samples and
effects: filter the runs, fit the declared equation, lay out the columns of every candidate, and
score each on every run and condition left out. It is processor time: other work on the machine
changes wall-clock times.
"""

import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.ratio import Ratio
from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.candidates import every_claim, pool_of
from estimation.causes.folds import folds_of
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import lay_out
from estimation.causes.scoring import assessed
from estimation.recording import Recording
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.subject import Subject, declared_models
from rig.simulation.campaign import simulate_reference_campaign
from rig.simulation.hidden import HiddenEffect

SECONDS = (3.5, 7.0, 14.0)
"""Length of each run."""

SHARES = (0.25, 0.5, 1.0)
"""Of the catalogue."""

MOST_S = 10.0
"""Processor time that a diagnosis of some 15 runs of 14 s may take, on one core."""

TWICE = 2.5
"""Twice as much may cost so many times as much: linear, within a quarter."""


@dataclass(frozen=True)
class Cost:
    """One timing.

    Attributes:
        samples: Samples of all runs.
        candidates: Effects at points of their grids.
        seconds: Processor time, the shortest of several.
    """

    samples: int
    candidates: int
    seconds: float


def costs_over_samples() -> list[Cost]:
    """Time the whole catalogue on runs of `SECONDS`."""
    return [
        _cost(tuple(r.at(np.flatnonzero(r.time_s < s)) for r in _recordings()), 1.0)
        for s in SECONDS
    ]


def costs_over_effects() -> list[Cost]:
    """Time `SHARES` of the candidates on whole runs."""
    return [_cost(_recordings(), share) for share in SHARES]


def measure() -> list[Ratio]:
    """Return the cost of a whole diagnosis, and of twice the samples and twice the effects."""
    return [_whole(), *_twice()]


def _whole() -> Ratio:
    campaign = Campaign.of(
        simulate_reference_campaign(0, "diagnosis", (HiddenEffect("motor_ripple", 1.0),)).evidence
    )
    models = declared_models(None, None)
    with tempfile.TemporaryDirectory() as folder:
        ledger = Ledger(Path(folder) / "looks.jsonl")
        began = time.process_time()
        answer, _ = run_diagnosis(Subject(campaign, models), ledger, quick=True)
        seconds = time.process_time() - began
    found = ", ".join(f.family for f in answer.diagnosis.findings) or "nothing"
    return Ratio(
        "10 s over the processor time of a diagnosis",
        MOST_S / seconds,
        1.0,
        detail=f"{seconds:.1f} s for {len(campaign)} runs of 14 s, {len(models)} equations;"
        f" found {found}; no next experiment",
    )


def _twice() -> list[Ratio]:
    named = [("samples", costs_over_samples()), ("effects", costs_over_effects())]
    return [
        Ratio(
            f"a search over twice the {name}, over one",
            last.seconds / half.seconds,
            TWICE,
            higher_is_better=False,
            detail=f"{last.samples} samples x {last.candidates} candidates in"
            f" {last.seconds:.2f} s, {half.samples} x {half.candidates} in {half.seconds:.2f} s",
        )
        for name, (_, half, last) in named
    ]


@cache
def _recordings() -> tuple[Recording, ...]:
    return tuple(simulate_reference_campaign(protocol="diagnosis").evidence)[::2]


def _cost(recordings: tuple[Recording, ...], share: float) -> Cost:
    model = model_file.read(Path("motor"))
    step, tried = round(1.0 / share), 0

    def search() -> None:
        nonlocal tried
        names = [r.name for r in recordings]
        layout = lay_out([model], recordings, names)
        add_instruments(layout, names)
        joint = Joint(layout)
        pool = pool_of(joint, list(every_claim(layout))[::step])
        assessed(joint, pool, folds_of(layout))
        tried = sum(len(group.candidates) for group in pool)

    search()  # compiles
    seconds = []
    for _ in range(3):
        began = time.process_time()
        search()
        seconds.append(time.process_time() - began)
    return Cost(sum(map(len, recordings)), tried, min(seconds))
