"""What can be identified of a machine from its sensors, and from recordings of it."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from estimation.campaign import Campaign
from estimation.channels import unit_of
from estimation.derived import measured_channels
from estimation.errors import EstimationError, nearest
from estimation.filters import LowPass
from estimation.fitting import fit, shapes_at_bound
from estimation.model import Evidence, Model, balance_channels, parameter_keys, settled
from estimation.noise import (
    noise_width,
)
from estimation.noise_check import noisy, swamped
from estimation.opposed import FIX, driven_back, opposed, size_of_target
from estimation.plant import Plant
from estimation.plant_equations import Missing, missing, signals, unused
from estimation.plant_models import declared
from estimation.recording import Recording, move_condition, shared_columns
from estimation.separable import inseparable
from estimation.signals import Reading
from estimation.travel import FOLLOWS, other_ratio, slope
from estimation.turned import turned_runs
from estimation.unit_factors import off_by, unit_factor

ALIKE = 3.0
"""Factor between a noise that is stated and that of the recordings."""

OFFSETS_IGNORED = "The fit ignores it (run_offsets = true)"
OF_A_LOAD = (
    "; with run_offsets = false it would explain most of it. State false if the zeros of the"
    " sensors can be trusted: without the differences of a load from run to run, gain and friction"
    " may be confused."
)
OF_ZEROS = (
    ", and with run_offsets = false it would not explain it either. The cause is zeros that differ"
    " from run to run, or a load that the equation does not read."
)

EXPLAINED = 0.5
"""Share of the error between runs below which a fit with their means explains most of it."""


@dataclass(frozen=True)
class Identified:
    """A parameter of an equation, by its effect."""

    effect: str  # id of the effect, with its channels where several terms have it
    name: str
    unit: str
    description: str
    value: float | None = None  # fitted on the recordings; None without them
    at_bound: bool = False  # whether that is the least or the largest value that makes sense
    # whether the runs show it: a shape at an end of what their speeds show may be further out
    is_shown: bool = True


@dataclass(frozen=True)
class CheckedEquation:
    """One equation of a machine."""

    name: str
    sentence: str  # the equation in words
    parameters: tuple[Identified, ...]  # what it identifies
    target: str
    unit: str
    # root mean square of what the fit does not explain over that of the target; None without
    # recordings
    relative_error: float | None = None
    # the same of the runs' means, where the fit ignores them (`run_offsets`); None where it does
    # not
    between_runs: float | None = None
    # why the recordings do not fit it, or contradict it; empty where they do neither
    trouble: str = ""
    # what the recordings do not separate, or show in noise only, sentences
    limits: tuple[str, ...] = ()


@dataclass(frozen=True)
class CheckedPlant:
    """What can be identified of a machine."""

    equations: tuple[CheckedEquation, ...]  # the equations that its sensors allow
    missing: tuple[Missing, ...]  # what they do not identify
    unused: tuple[str, ...]  # channels that no equation reads
    # where the recordings contradict the file, sentences
    contradictions: tuple[str, ...] = field(default=())
    runs: int = 0

    @property
    def is_sound(self) -> bool:
        """Whether there is an equation, each can be fitted, and nothing is contradicted."""
        troubled = any(equation.trouble for equation in self.equations)
        return bool(self.equations) and not troubled and not self.contradictions


def check(
    plant: Plant,
    campaign: Campaign | None = None,
    file: Path | None = None,
    recorded: Sequence[str] = (),
) -> CheckedPlant:
    """Check which parameters of a machine can be identified, and fitted on recordings of it.

    The file is the machine's, which sentences on what to change name. Without recordings,
    `recorded` are the channels that these will have; none where unknown.

    Raises:
        PlantError: An equation of its owner's has an unknown effect, role or channel.
    """
    models = declared(plant)
    if campaign is None:
        what = "is not among the channels of [data]"
        found = tuple(
            replace(_described(model), trouble=_absent(model, recorded, what) if recorded else "")
            for model in models
        )
        return CheckedPlant(found, tuple(missing(plant)), tuple(unused(plant)))
    campaign = campaign.held()  # it is walked many times
    recordings = list(campaign.evidence)
    columns = shared_columns(recordings) if recordings else []
    contradicted = tuple(contradictions(plant, recordings, str(file or plant.name)))
    return CheckedPlant(
        equations=tuple(_fitted(model, campaign, columns, bool(contradicted)) for model in models),
        missing=tuple(missing(plant)),
        unused=tuple(unused(plant)),
        contradictions=contradicted,
        runs=len(recordings),
    )


def _described(model: Model, campaign: Campaign | None = None) -> CheckedEquation:
    """Return an equation as declared, or as fitted on a campaign."""
    ends = set() if campaign is None else shapes_at_bound(model, campaign)
    parameters = tuple(
        Identified(
            key.removesuffix(f".{parameter.name}"),
            parameter.name,
            term.unit(parameter, model.target),
            parameter.description,
            None if campaign is None else term.values[parameter.name].value,
            campaign is not None and term.is_at_bound(parameter),
            key not in ends,
        )
        for term, parameter, key in parameter_keys(model)
    )
    return CheckedEquation(model.balance, model.description, parameters, model.target, model.unit)


def _fitted(
    model: Model, campaign: Campaign, columns: Sequence[str], is_contradicted: bool
) -> CheckedEquation:
    """Return an equation as the recordings have it; `is_contradicted` is of the file."""
    plain = _described(model)
    if absent := _absent(model, columns, "was not recorded", campaign.evidence):
        return replace(plain, trouble=absent)
    try:
        plain = replace(plain, limits=(*_one_way(model, campaign), *noisy(model, campaign)))
        fitted = fit(model, campaign, bootstrap=0)
    except EstimationError as error:
        return replace(plain, trouble=f"{error.what} {error.fix}".strip())
    shared = filter(None, [inseparable(fitted, campaign)])
    limits = (*plain.limits, *swamped(fitted, campaign), *shared)
    found = replace(_described(fitted, campaign), limits=limits)
    evidence = fitted.evidence
    assert evidence is not None  # noqa: S101  a fit sets its evidence
    size = size_of_target(fitted, campaign)
    # a difference of travels is none with a wrong ratio, and the sign of its load decides nothing
    is_none = is_contradicted and model.signals.combination(model.target) is not None
    if not is_none and (contradicted := opposed(fitted, campaign)):
        found = replace(found, trouble=f"{contradicted} {FIX}")
    else:
        signs = (*driven_back(fitted, campaign), *turned_runs(fitted, campaign))
        found = replace(found, limits=(*limits, *signs))
    if not fitted.run_offsets:
        return replace(found, relative_error=evidence.rmse_with_means / size)
    limits = (*found.limits, *filter(None, [offsets_note(fitted, campaign)]))
    means = between_runs(evidence) / size
    return replace(found, relative_error=evidence.rmse / size, between_runs=means, limits=limits)


def between_runs(evidence: Evidence) -> float:
    """Return the error of a fit between runs: the part of it that is in their means."""
    return math.sqrt(max(evidence.rmse_with_means**2 - evidence.rmse**2, 0.0))


def offsets_note(model: Model, campaign: Campaign) -> str:
    """Return that a fit ignores an error of runs' means that is larger than that within runs.

    And whether a fit with the means would explain it. Empty where it is smaller, and of a model
    that has no offset for each run. The campaign has the runs of the fit.
    """
    evidence = model.evidence
    if evidence is None or not model.run_offsets or between_runs(evidence) <= evidence.rmse:
        return ""
    times, remedy = between_runs(evidence) / evidence.rmse, OF_ZEROS
    with suppress(EstimationError):
        runs = campaign.select(evidence.runs)
        whole = fit(replace(model, run_offsets=False), runs, bootstrap=0).evidence
        assert whole is not None  # noqa: S101  a fit sets its evidence
        if between_runs(whole) < EXPLAINED * between_runs(evidence):
            remedy = OF_A_LOAD
    return (
        f"The error between runs, in their means, is {times:.2g} times that within runs."
        f" {OFFSETS_IGNORED}{remedy}"
    )


def _absent(model: Model, columns: Sequence[str], what: str, runs: Iterable[Recording] = ()) -> str:
    """Return which channels of an equation are not there, with the nearest one; empty if none."""
    needed = measured_channels([*model.channels, model.target], model.signals)
    absent = [name for name in needed if name not in (*columns, "time_s")]
    if not absent:
        return ""
    if move := move_condition(absent, runs):
        return f"{', '.join(absent)} {what} as a channel: {move}"
    near = nearest(absent[0], list(columns)) if columns else "There are no runs."
    return f"{', '.join(absent)} {what}. {near}"


def _one_way(model: Model, campaign: Campaign) -> Iterator[str]:
    """Yield that Coulomb friction is part of the offset where motion has one direction."""
    speeds = [t.channels["speed"] for t in model.terms if t.effect.id == "friction.coulomb"]
    if not speeds or all(t.effect.id != "sensor.offset" for t in model.terms):
        return
    for speed in speeds:
        ways = []
        for run in campaign.evidence:
            channels = balance_channels(model, run)
            ways.append({*np.sign(channels[speed][settled(model, channels)]).tolist()})
        sides = len(set().union(*ways))
        if sides == 1 or (sides and model.run_offsets and max(map(len, ways)) == 1):
            yield (
                f"{speed} never changes its sign{' within a run' * model.run_offsets}: Coulomb"
                " friction and the offset cannot be separated, only their sum is identified."
                " Record motion in the other direction, too."
            )


def contradictions(
    plant: Plant, recordings: Sequence[Recording], file: str = "the machine file"
) -> Iterator[str]:
    """Yield where recorded travels, or the noise of a reading, are not as the file states."""
    for axis in plant.axes:
        readings = [s.name for s in plant.sensors if (s.axis, s.reads) == (axis.name, "position")]
        for first, second in pairwise(readings):
            change = slope(recordings, first, second)
            if change is not None and abs(change - 1.0) > FOLLOWS:
                yield (
                    f"{first} and {second} both read the position of {axis.name}, but {second}"
                    f" changes {change:.4g} times as much.{off_by(change)} Correct its unit,"
                    f" gain or sign, or its axis, in {file}."
                )
    for sensor in plant.sensors:
        shown = [
            noise_width(r[sensor.name], Reading(step=sensor.step))
            for r in recordings
            if sensor.name in r and (sensor.rate_hz or r.sample_rate_hz) > 0.5 * r.sample_rate_hz
        ]
        stated = sensor.noise
        if stated and shown and not 1.0 / ALIKE < float(np.median(shown)) / stated < ALIKE:
            yield (
                f"{file} states a noise of {stated:.3g} {unit_of(sensor.name)} for {sensor.name},"
                f" but the recordings show {float(np.median(shown)):.3g}. Correct it, or delete"
                " it: the noise is then taken from the recordings."
            )
    for joint in plant.transmissions:
        driving, driven = plant.position(joint.input), plant.position(joint.output)
        if joint.ratio is None or driving is None or driven is None:
            continue
        if joint.compliant:
            wound = [
                s.name for s in plant.sensors if s.reads == "effort" and s.axis == joint.output
            ]
            low_pass, ends = LowPass(plant.cutoff_hz, plant.order), (driving.name, driven.name)
            change = other_ratio(recordings, ends, joint.ratio, wound, low_pass, signals(plant))
        else:
            change = slope(recordings, driven.name, driving.name)
        if change is not None and abs(change / joint.ratio - 1.0) > FOLLOWS:
            yield (
                f"{file} states the ratio {joint.ratio:g} for {joint.name}, but {driving.name}"
                f" changes {change:.4g} times as much as {driven.name}."
                f"{off_by(change / joint.ratio)} Correct the ratio, or the"
                f" {'unit' if unit_factor(change / joint.ratio) else 'counts'} of one of the"
                " sensors."
            )
