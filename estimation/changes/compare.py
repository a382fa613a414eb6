"""What changed between two campaigns of one machine, with intervals over runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimation.causes.equations import Layout, lay_out
from estimation.changes.candidates import Came, SensorMoved
from estimation.changes.regression import Regression, solved
from estimation.changes.search import SURE, Gained, Step, impossible, laid_out, search
from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import FloatArray, Recording

SCHEMA = "rig.diff/1"

LEAST_RUNS = 4
"""Runs of each campaign: of fewer, 5 % of the choices of runs are less than one."""

IN_SET = 0.95
"""Share that a set of names covers."""

A, B, ON = "A:", "B:", "C:"


class ChangesError(EstimationError):
    """Two campaigns cannot be compared."""


@dataclass(frozen=True)
class Change:
    """One change.

    Attributes:
        verdict: `moved` for a parameter, `came` or `went` for an effect, `one_of` where the runs do
            not distinguish some of them.
        name: What changed.
        equation: Equation it is reported under.
        family: The effect.
        alternatives: Other names that explain it about as well.
        confidence: Weight of this name among all that explain about as much, over resampled sets of
            runs.
        p: Probability of a change this large where nothing changed, over all candidates.
        parameters: Parameter to its change from A to B (of an effect: its amplitude), SI.
        ci95: Parameter to the 95 % interval of that, over runs.
        unit: Parameter to its unit.
        before: Parameter to its value in A; None of an effect.
    """

    verdict: str
    name: str
    equation: str
    family: str
    alternatives: tuple[str, ...]
    confidence: float
    p: float
    parameters: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    unit: Mapping[str, str]
    before: Mapping[str, float | None]


@dataclass(frozen=True)
class Predicted:
    """Root mean square errors on a third campaign of an equation, within runs.

    Attributes:
        with_a: Fitted on A alone.
        with_b: Fitted on B alone.
        as_a: Fitted on both with the changes, taken as unchanged.
        as_b: The same, taken as changed.
        unit: Unit of the target.
    """

    with_a: float
    with_b: float
    as_a: float
    as_b: float
    unit: str


@dataclass(frozen=True)
class Difference:
    """The answer.

    Attributes:
        changes: The changes, largest first; empty where nothing changed beyond chance.
        runs: Campaign to the names of its runs.
        predicted: Equation to its errors on a third campaign; empty without one.
        notes: Limits of the answer, in words.
        seed: Seed of the random choices.
        schema: Name of this layout.
    """

    changes: tuple[Change, ...]
    runs: Mapping[str, tuple[str, ...]]
    predicted: Mapping[str, Predicted] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0
    schema: str = SCHEMA


def compare(
    a: Sequence[Recording],
    b: Sequence[Recording],
    models: Sequence[Model],
    on: Sequence[Recording] = (),
    seed: int = 0,
) -> Difference:
    """Find what changed from one campaign of a machine to another.

    Args:
        a: Runs of the first campaign, four at least.
        b: Runs of the second one, four at least.
        models: Declared equations.
        on: Runs of a third campaign, to predict.
        seed: Seed of the random choices of runs.

    Raises:
        ChangesError: Too few runs.
        LayoutError: No equation can be written with the channels of both.
        FitError: A declared equation cannot be identified.
    """
    for name, runs in (("first", a), ("second", b)):
        if len(runs) < LEAST_RUNS:
            raise ChangesError(
                f"The {name} campaign has {len(runs)} runs, too few to compare.",
                "A change is judged against the differences between runs of one campaign.",
                f"Record {LEAST_RUNS} runs at least of each.",
            )
    named = [*_named(a, A), *_named(b, B)]
    train = [r.name for r in named]
    layout = lay_out(models, [*named, *_named(on, ON)], train)
    fitted = layout.select(train)
    is_b = np.array([float(run.name.startswith(B)) for run in fitted.runs])
    conditions = {r.name: _stratum(r) for r in named}
    regression = Regression(fitted)
    steps = search(regression, is_b, [conditions[run.name] for run in fitted.runs], seed)
    return Difference(
        changes=tuple(_change(step, fitted, is_b) for step in steps),
        runs={"a": tuple(r.name for r in a), "b": tuple(r.name for r in b)},
        predicted=_predicted(layout, steps) if on else {},
        notes=(*_notes(conditions), *_not_identified(regression, is_b)),
        seed=seed,
    )


def _named(recordings: Sequence[Recording], prefix: str) -> list[Recording]:
    return [replace(r, name=f"{prefix}{r.name}") for r in recordings]


def _stratum(recording: Recording) -> str:
    return repr(sorted((k, str(v)) for k, v in recording.conditions.items()))


def _notes(conditions: Mapping[str, str]) -> list[str]:
    of_a = {v for k, v in conditions.items() if k.startswith(A)}
    of_b = {v for k, v in conditions.items() if k.startswith(B)}
    if of_a == of_b:
        return []
    return [
        "The two campaigns were not recorded under the same conditions: what the declared model"
        " lacks under a condition that only one of them has can appear as a change."
    ]


def _not_identified(regression: Regression, is_b: FloatArray) -> list[str]:
    return [
        f"Changes of the equation {equation} are not judged: its {parameter} comes out beyond its"
        " bounds, so its parameters are not identifiable from these runs."
        for equation, parameter in impossible(regression, is_b).items()
    ]


def _change(step: Step, layout: Layout, is_b: FloatArray) -> Change:
    best, candidate = step.best, step.best.candidate
    confidence = step.shares.get(best.family, 0.0)
    covered, others = confidence, []
    for name, share in step.shares.items():
        if name != best.family and covered < IN_SET:
            others.append(name)
            covered += share
    verdict = "moved"
    if isinstance(candidate, Came):
        verdict = "came" if best.in_b else "went"
    if confidence < SURE:
        verdict = "one_of"
    sizes = _sizes(best, step.spread, layout)
    return Change(
        verdict=verdict,
        name=best.family,
        equation=candidate.equation,
        family=candidate.family,
        alternatives=tuple(others),
        confidence=round(confidence, 4),
        p=step.p,
        parameters={name: value for name, (value, _, _) in sizes.items()},
        ci95={name: ends for name, (_, ends, _) in sizes.items()},
        unit={name: unit for name, (_, _, unit) in sizes.items()},
        before={name: _before(best, layout, is_b) for name in sizes},
    )


def _sizes(
    best: Gained, spread: FloatArray, layout: Layout
) -> dict[str, tuple[float, tuple[float, float], str]]:
    """Return each parameter's change, its interval and its unit."""
    candidate = best.candidate
    if isinstance(candidate, Came):
        source = candidate.source
        equation = layout.equations[source.place.home]
        names = [source.effect.amplitudes[k] for k in source.parts]
        channels = dict(source.channels)
        known = {role: channels[role] for role in source.effect.roles}
        labels = [(n.name, _unit(n.unit, equation.target, known)) for n in names]
    else:
        labels = [(candidate.parameter, candidate.unit)]
    ends = np.percentile(spread, [2.5, 97.5], axis=0) if len(spread) else np.full((2, 9), np.nan)
    out = {}
    for k, (name, unit) in enumerate(labels):
        value = float(best.amplitudes[k])
        low, high = float(ends[0, k]), float(ends[1, k])
        out[name] = (value, (min(low, value), max(high, value)), unit)
    return out


def _unit(expression: str, target: str, channels: Mapping[str, str]) -> str:
    from estimation.channels import unit_of
    from estimation.units import evaluate

    symbols = {"target": unit_of(target)} | {r: unit_of(n) for r, n in channels.items()}
    return evaluate(expression, symbols)


def _before(best: Gained, layout: Layout, is_b: FloatArray) -> float | None:
    """Return a moved parameter's value in A; None of an effect, 1 of a sensor's gain."""
    candidate = best.candidate
    if isinstance(candidate, Came):
        return None
    if isinstance(candidate, SensorMoved):
        return 1.0
    regression = Regression(layout)
    laid = laid_out(candidate, regression)
    assert laid is not None  # noqa: S101  a declared column is finite
    parameters = solved(regression.grown(laid, is_b).gram())
    column = regression.declared_column(candidate.equation, candidate.column)
    return float(parameters[column])


def _predicted(layout: Layout, steps: Sequence[Step]) -> dict[str, Predicted]:
    """Return the errors on the third campaign's runs, by four models."""
    names = [run.name for run in layout.runs]
    of = {p: np.array([float(n.startswith(p)) for n in names]) for p in (A, B, ON)}
    plain = Regression(layout)
    alone = {p: solved(plain.gram(of[p])) for p in (A, B)}
    grown = dict.fromkeys((A, B), plain)
    for step in steps:
        laid = laid_out(step.best.candidate, plain)
        assert laid is not None  # noqa: S101  it was laid out in the search
        side = of[B] if step.best.in_b else of[A]
        for taken_as in (A, B):
            acts = side + of[ON] * float((taken_as == B) == step.best.in_b)
            grown[taken_as] = grown[taken_as].grown(laid, acts)
    both = {p: solved(grown[p].gram(of[A] + of[B])) for p in (A, B)}
    out = {}
    for equation, declared in layout.equations.items():
        out[equation] = Predicted(
            with_a=plain.rms(equation, alone[A], of[ON]),
            with_b=plain.rms(equation, alone[B], of[ON]),
            as_a=grown[A].rms(equation, both[A], of[ON]),
            as_b=grown[B].rms(equation, both[B], of[ON]),
            unit=declared.model.unit,
        )
    return out
