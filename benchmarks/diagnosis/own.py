"""Cases of the project's own simulator, with the shipped protocols and the declared models."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from benchmarks.diagnosis import scoring
from benchmarks.diagnosis.case import KINDS, Case
from benchmarks.diagnosis.draw import Answer, draw, write, write_next
from benchmarks.diagnosis.excitation import plans_of
from benchmarks.diagnosis.truths import TRUTHS

COUNTS = {
    "strong": 10,
    "weak": 6,
    "pair": 6,
    "outside": 5,
    "some_runs": 4,
    "confounded": 4,
    "clean": 5,
}


def cases(seed: int, counts: Mapping[str, int] = COUNTS) -> Iterator[Case]:
    """Yield the cases of a seed, the classes in turn, so that half a measurement shows them all.

    Args:
        seed: Seed of the draw; `seeds.py` lists what each is for.
        counts: Cases of each class.
    """
    of_kind = [[_case(kind, k, seed) for k in range(counts.get(kind, 0))] for kind in KINDS]
    for turn in itertools.zip_longest(*of_kind):
        yield from (case for case in turn if case is not None)


def _case(kind: str, number: int, seed: int) -> Case:
    answer = draw(kind, number, seed)
    truth = truth_of(answer)
    case = Case(
        f"{kind}-{number}",
        kind,
        partial(write, answer),
        partial(scoring.judge, truth),
    )
    if kind == "clean":
        return case
    case = replace(case, write_without=partial(write, replace(answer, effects=())))
    if kind != "confounded":
        return case
    return replace(
        case,
        write_next=partial(write_next, answer),
        judge_next=partial(scoring.judge_next, truth),
    )


def truth_of(answer: Answer) -> scoring.Truth:
    """Return the hidden truth in the form of an answer."""
    plans = plans_of(answer.excitation)
    hidden = [
        scoring.Hidden({t.family, *t.accepted}, t.equations, t.depends_on)
        for t in (TRUTHS[effect.name] for effect in answer.effects)
    ]
    runs = [plans[index].name for index in answer.runs]
    return scoring.Truth(answer.kind, hidden, runs, answer.either)
