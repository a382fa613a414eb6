"""The result of a diagnosis: verdict, findings, errors. Contract `rig.diagnosis/1`."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from estimation.diagnosis.split import Sealed

SCHEMA = "rig.diagnosis/1"

VERDICTS = (
    "identified",
    "one_of",
    "depends_on",
    "something_missing",
    "unexplained",
    "nothing_missing",
)
"""From the strongest claim to none; the verdict of a diagnosis is its weakest finding's."""

VARIABLES = [
    "velocity",
    "velocity_sign",
    "load",
    "current",
    "acceleration",
    "time",
    "history",
    "dwell",
    "run",
    "temperature",
    "wrist_pitch",
    "wrist_roll",
]
"""Variables that a finding may depend on; besides these, `joint_N` of an arm, and angles, positions
and what a sensor responds to by the name of their channel, such as `spindle_angle`."""


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter: value, unit symbol, and 95 % interval of a bootstrap over runs, or None."""

    value: float
    unit: str
    ci95: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One cause; its fields are those of the JSON, in their order.

    Attributes:
        balance: Equation it is reported under.
        also_in: Other equations that the same cause enters.
        place: Where in the machine it acts: an equation, `torque at CHANNEL` or `sensor CHANNEL`.
        family: Name of the effect, or `unknown`.
        form: Id of the form of it that was found, such as `spring.position.curved`; empty without.
        verdict: What is claimed of it.
        alternatives: Families that these runs cannot distinguish from it.
        alternative_places: Family to the place where it would act, where that is another one.
        other_places: Places where an effect of this family lowers the error as much.
        probabilities: Family to its probability, for the family and its alternatives.
        no_effect: Probability of none; the rest to one is that of families that are not listed.
        depends_on: Variables it depends on.
        confidence: Probability that the name is right, or None without a name.
        parameters: Name to value.
        error_of: Equation whose error is stated: its own, or another one whose error falls most
            where its own does not fall.
        with_means: Whether the means of runs are left in that error: where the equation has no
            offsets of runs, or where it does not fall without them.
        rmse_before: That error on the test runs before this finding, after those found earlier.
        rmse_after: The same after it.
        runs_improved: Test runs whose error it lowers.
        runs_total: Test runs.
        runs_affected: Runs in which it acts.
    """

    balance: str
    also_in: tuple[str, ...] = ()
    place: str = ""
    family: str
    form: str = ""
    verdict: str
    alternatives: tuple[str, ...] = ()
    alternative_places: Mapping[str, str] = field(default_factory=dict)
    other_places: tuple[str, ...] = ()
    probabilities: Mapping[str, float] = field(default_factory=dict)
    no_effect: float = 0.0
    depends_on: tuple[str, ...] = ()
    confidence: float | None = None
    parameters: Mapping[str, Value] = field(default_factory=dict)
    error_of: str
    with_means: bool = False
    rmse_before: float = math.nan
    rmse_after: float = math.nan
    runs_improved: int = 0
    runs_total: int = 0
    runs_affected: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Error:
    """Errors on the test runs, pooled over their samples, in the unit of the target.

    Attributes:
        before: Root mean square, each run's mean removed, declared model.
        after: The same with the findings.
        with_means_before: Root mean square with the means left in, declared model.
        with_means_after: The same with the findings.
        ratio_ci95: 95 % interval of after / before, a bootstrap over the test runs.
        by_run_before: Test run to its error before.
        by_run_after: Test run to its error after.
    """

    before: float
    after: float
    with_means_before: float
    with_means_after: float
    ratio_ci95: tuple[float, float]
    by_run_before: Mapping[str, float]
    by_run_after: Mapping[str, float]


def is_unexplained(over_noise: float) -> bool:
    """Whether more than half of an error's power is not noise of the readings."""
    return over_noise**2 > 2.0


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Attributes:
        findings: In the order found; empty when nothing is missing.
        errors: Equation to its errors on the test runs.
        unit: Equation to the unit symbol of its target.
        noise_floor: Equation to the error that no model can go below, None where it is not known.
        moved: Equation to declared parameter to its value before and after the findings.
        sealed: The split.
        undecided: Equation to the reason why it could not be decided.
        notes: Limits of this diagnosis, in words.
        exploratory: Whether the test runs had been used before.
        seconds: How long it took.
        next_experiment: The experiment that separates the alternatives best, plain JSON types, or
            None.
        quick: Whether no such experiment was searched for.
        over_noise: Equation to the error left over the noise of its readings, where they show any.
    """

    findings: tuple[Finding, ...]
    errors: Mapping[str, Error]
    unit: Mapping[str, str]
    noise_floor: Mapping[str, float | None]
    moved: Mapping[str, Mapping[str, Mapping[str, float]]]
    sealed: Sealed
    undecided: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    exploratory: bool = False
    seconds: float = 0.0
    next_experiment: Mapping[str, Any] | None = None
    quick: bool = False
    over_noise: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """The weakest finding's verdict; without findings whether noise explains the errors."""
        if not self.findings:
            is_noise = not any(map(is_unexplained, self.over_noise.values()))
            return "nothing_missing" if is_noise else "unexplained"
        return max((f.verdict for f in self.findings), key=VERDICTS.index)

    def to_json(self) -> dict[str, Any]:
        """Return the object of the published schema; what is not defined is None."""
        errors = self.errors.items()
        whole: dict[str, Any] = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "findings": [asdict(f) for f in self.findings],
            "rmse_before": {name: e.before for name, e in errors},
            "rmse_after": {name: e.after for name, e in errors},
            "rmse_with_means_before": {name: e.with_means_before for name, e in errors},
            "rmse_with_means_after": {name: e.with_means_after for name, e in errors},
            "unit": dict(self.unit),
            "noise_floor": dict(self.noise_floor),
            "over_noise": dict(self.over_noise),
            "runs": {"discover": self.sealed.discover, "confirm": self.sealed.confirm},
            "next_experiment": self.next_experiment,
            "declared_parameters_moved": self.moved,
            "exploratory": self.exploratory,
            "seed": self.sealed.seed,
            "seconds": self.seconds,
            "seal": self.sealed.seal,
            "data_hash": self.sealed.data_hash,
            "undecided": dict(self.undecided),
            "notes": self.notes,
        }
        return {key: _plain(value) for key, value in whole.items()}


def _plain(value: Any) -> Any:
    """Return plain JSON types; a number that is not finite is None, and so is a pair with one."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        plain = [_plain(item) for item in value]
        return None if isinstance(value, tuple) and None in plain else plain
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
