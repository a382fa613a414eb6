"""Whether the other balances that read a sensor bear out the fault it is blamed for.

A torque sensor that creeps makes the same error in every balance that it stands in. What one
balance takes for its fault says how large that error is, and so what the others must show. Where
one of them shows nothing of it, the sensor is not at fault, and something beside it is.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from estimation.diagnosis.balance import Balance
from estimation.diagnosis.candidate import Candidate
from estimation.diagnosis.design import Run
from estimation.diagnosis.instruments import NOMINAL
from estimation.diagnosis.least_squares import least_squares
from estimation.diagnosis.naming import Discovery
from estimation.diagnosis.story import Story
from estimation.effects.effect import Proportional
from estimation.recording import FloatArray

ROLES = ("reading", "creeping")
"""Roles of the sensor that an effect blames."""

SHOWN = 0.3
"""Share of the expected error that another balance must show."""

PLAIN = 0.3
"""Least expected squared error, a share of what the other balance leaves: less is not seen."""

Fault = tuple[str, str]
"""Family of a fault and the channel it is found through."""


def denied(stories: Mapping[str, Story]) -> dict[str, set[Fault]]:
    """Return, for each balance, the faults that it names or allows and another balance denies."""
    found: dict[str, set[Fault]] = {}
    for name, story in stories.items():
        others = [s.balance for other, s in stories.items() if other != name]
        for candidate in _blaming(story.discovery):
            channel = dict(candidate.channels)[_role(candidate)]
            if any(_denies(other, story.balance, candidate) for other in others):
                found.setdefault(name, set()).add((candidate.family, channel))
    return found


def _blaming(discovery: Discovery) -> Iterable[Candidate]:
    """Return the candidates that blame a sensor: the named ones and their rivals."""
    best = {t.family: t.candidates[0] for t in discovery.ranking}
    for named in discovery.named:
        rivals = (best[family] for family in named.rivals if family in best)
        yield from (c for c in (named.candidate, *rivals) if _role(c))


def _role(candidate: Candidate) -> str:
    if not candidate.family.startswith("sensor."):
        return ""
    return next((role for role, _ in candidate.channels if role in ROLES), "")


def _denies(other: Balance, balance: Balance, fault: Candidate) -> bool:
    """Say whether another balance lacks most of the error that a fault makes in its sensor."""
    channel = dict(fault.channels)[_role(fault)]
    sensor = balance.model.target if channel in NOMINAL else channel
    here, there = _weight(balance, sensor), _weight(other, sensor)
    if not here or not there:
        return False
    terms = [*balance.terms, fault]
    weights = balance.solve(terms)[-len(fault.effect.amplitudes) :]
    made = {
        run.name: fault.columns(run.channels) @ weights * (there / here) for run in balance.runs
    }
    shared = [k for k, run in enumerate(other.runs) if run.name in made]
    if not shared:
        return False
    columns = other.columns(other.terms)
    expected = [_centred(other.runs[k], made[other.runs[k].name], other.demean) for k in shared]
    base = np.vstack([columns[k] for k in shared])
    error = np.concatenate(expected)
    error = error - base @ least_squares(base, error)
    remains = other.left(other.terms)
    left = np.concatenate([remains[k] for k in shared])
    size = float(error @ error)
    return size >= PLAIN * float(left @ left) and float(left @ error) < SHOWN * size


def _weight(balance: Balance, sensor: str) -> float:
    """Return how an error of a sensor enters a balance: 1 for its target, minus what it weighs."""
    if sensor == balance.model.target:
        return 1.0
    weights = iter(balance.solve(balance.terms))
    total = 0.0
    for term in balance.terms:
        own = [next(weights) for _ in term.effect.amplitudes]
        if isinstance(term.effect, Proportional) and sensor in dict(term.channels).values():
            total -= term.sign * own[0]
    return total


def _centred(run: Run, values: FloatArray, demean: bool) -> FloatArray:
    thin = run.thin(values)
    return np.asarray(thin - thin.mean()) if demean else thin
