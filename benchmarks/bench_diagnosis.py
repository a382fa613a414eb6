"""How the cost of a diagnosis grows with samples and effects; `docs/figures/diagnosis_cost.py`.

Timed is what a search is made of: filter the runs, lay out the columns of the catalogue, and score
every candidate on every run left out. It is processor time, since other work on the machine would
bend a line of wall-clock times.
"""

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from benchmarks.ratio import Ratio
from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import Candidate, pool
from estimation.diagnosis.design import prepare, tables
from estimation.diagnosis.evidence import leave_one_run_out
from estimation.diagnosis.instruments import instruments, projection
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from rig.simulation.campaign import simulate_reference_campaign

SECONDS = (3.5, 7.0, 14.0)
"""Length of each run."""

SHARES = (0.25, 0.5, 1.0)
"""Of the catalogue."""

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
    whole = _tried()
    return [_cost(tuple(r.slice_time(0.0, s) for r in _recordings()), whole) for s in SECONDS]


def costs_over_effects() -> list[Cost]:
    """Time `SHARES` of the catalogue on whole runs; two draws of each, since some are dear."""
    whole, costs = _tried(), []
    for share in SHARES:
        step = round(1.0 / share)
        draws = [_cost(_recordings(), whole[first::step]) for first in sorted({0, step // 2})]
        mean = sum(one.seconds for one in draws) / len(draws)
        costs.append(replace(draws[0], seconds=mean))
    return costs


def measure() -> list[Ratio]:
    """Return the cost ratios of twice the samples and of twice the effects."""
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


@cache
def _fitted() -> Model:
    declared = model_file.read(Path("motor"))
    return fit(declared, Campaign.of(_recordings()), bootstrap=0)


def _tried() -> list[Candidate]:
    return pool(_fitted(), _measured())


def _measured() -> list[str]:
    return sorted(set.intersection(*({*r.columns} for r in _recordings())))


def _cost(recordings: tuple[Recording, ...], tried: list[Candidate]) -> Cost:
    model = _fitted()
    channels = [model.target, *model.channels, *instruments(_measured())]
    channels += [channel for c in tried for _, channel in c.channels]
    wanted = list(dict.fromkeys(channels))

    def search() -> None:
        runs = [prepare(recording, wanted, model) for recording in recordings]
        told = projection(runs, tried, model.target)
        balance = lay_out(model, [told(run) for run in runs])
        table = tables(balance.runs, tried, balance.demean)
        aims = [residual[:, None] for residual in balance.left(balance.terms)]
        sizes = [len(candidate.effect.amplitudes) for candidate in tried]
        leave_one_run_out(balance.base(balance.terms), table, sizes, aims)

    search()  # compiles
    seconds = []
    for _ in range(3):
        began = time.process_time()
        search()
        seconds.append(time.process_time() - began)
    return Cost(sum(map(len, recordings)), len(tried), min(seconds))
