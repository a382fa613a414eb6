"""What changed between two campaigns, as data."""

from collections.abc import Mapping
from dataclasses import dataclass, field

SCHEMA = "rig.diff/3"


@dataclass(frozen=True)
class Change:
    """One change.

    Attributes:
        verdict: `moved` for a parameter, `came` or `went` for an effect, `one_of` where the runs do
            not distinguish some of them, `depends_on` where the likeliest has an unknown form.
        how: `moved`, `came` or `went`, of the likeliest.
        family: The effect.
        alternatives: Other names that explain it about as well.
        confidence: Probability of this name next to the other changes, that of no change included.
        parameters: Parameter to its change from A to B (of an effect: its amplitude), SI; none of
            an unknown form.
        ci95: Parameter to the 95 % interval of that, over runs.
        unit: Parameter, and shape parameter, to its unit.
        before: Parameter to its value in A; None of an effect.
        shape: Shape parameter of an effect to its value, SI.
        depends_on: Variables that an effect depends on.
        form: Id of the form of the effect, such as `friction.load.power`.
    """

    verdict: str
    how: str
    name: str
    equation: str
    family: str
    alternatives: tuple[str, ...]
    confidence: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    ci95: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    unit: Mapping[str, str] = field(default_factory=dict)
    before: Mapping[str, float | None] = field(default_factory=dict)
    shape: Mapping[str, float] = field(default_factory=dict)
    depends_on: tuple[str, ...] = ()
    form: str = ""


@dataclass(frozen=True)
class Predicted:
    """Root mean square errors on a third campaign of an equation, within runs.

    Attributes:
        with_a: Fitted on A alone.
        with_b: Fitted on B alone.
        as_a: Fitted on both with the changes, taken as unchanged.
        as_b: The same, taken as changed.
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
    """

    changes: tuple[Change, ...]
    runs: Mapping[str, tuple[str, ...]]
    predicted: Mapping[str, Predicted] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seed: int = 0
    schema: str = SCHEMA
