"""A diagnosis of a campaign: read the runs, split them, search, and open the test runs.

The caller writes the requested files, then enters the use of the runs into the access log, then
shows the result: the held-out runs count as used once there is a result to see, and not before.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from estimation.arm.balances import declared_arm
from estimation.arm.shared import laid_out
from estimation.campaign import Campaign
from estimation.causes.layout import prepared
from estimation.causes.refits import Refits
from estimation.causes.verdict import Answer, answer
from estimation.derived import measured_channels
from estimation.diagnosis.audit import flagged, steady
from estimation.diagnosis.split import cut_and_split, path_of, period_of
from estimation.plant_check import offsets_note
from estimation.plant_equations import integrals
from estimation.recording import FloatArray, Recording
from rig.diagnosis.ledger import Ledger, Look, look_at
from rig.diagnosis.propose import propose
from rig.diagnosis.subject import Subject
from rig.importers.apart import spoiled
from rig.importers.questions import doubts, without
from rig.output.table import counted

LEAST_SHARED = 200
"""Samples that two repeats must share for a noise floor."""


def run_diagnosis(
    asked: Subject,
    ledger: Ledger,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    quick: bool = False,
    on_stage: Callable[[str], None] = lambda _: None,
) -> tuple[Answer, Look]:
    """Diagnose declared models on a campaign.

    Args:
        asked: The recordings and the models that are declared of them.
        ledger: Log of the runs that earlier diagnoses used; it is not written here.
        seed: Seed of the split and of intervals.
        executor: Plays the experiments that may be proposed in parallel.
        quick: Propose no next experiment.
        on_stage: Called with what begins, in words.

    Returns:
        The diagnosis with what a report needs, and what the log has to hold: a later diagnosis of
        these runs is exploratory.

    Raises:
        LedgerError: The log cannot be read or written.
        DataError: A recording cannot be read.
        EstimationError: Nothing can be decided; the reason is in the message.
    """
    ledger.check()
    on_stage("reading the recordings")
    whole, lost = _usable(asked)
    for reason in lost:
        on_stage(reason)
    known = ledger.known(whole)
    recordings, sealed = cut_and_split(whole, seed, known)
    seen = [name for name in sealed.confirm if path_of(name) in known]
    arm = declared_arm(asked.models, recordings)
    if arm is not None:
        on_stage("fitting the links that all joints share")
        recordings = laid_out(arm, recordings, sealed.discover)
    recordings = prepared(recordings)
    found = answer(recordings, asked.models, sealed, on_stage=on_stage)
    proposed = None
    if not quick:
        on_stage("choosing the experiment that separates the alternatives")
        proposed = propose(found, recordings, executor)
    asked_of = (f"Check: {line}" for line in doubts(whole, asked.plant))
    of_file = _of_file(asked, found, Campaign.of(recordings))
    notes = [*found.diagnosis.notes, *lost, *flagged(whole), *of_file, *asked_of]
    if seen:
        share = f"{len(seen)} of the {counted(len(sealed.confirm), 'test run')}"
        was = "was" if len(seen) == 1 else "were"
        notes.append(f"Exploratory: {share} {was} used by an earlier diagnosis: {', '.join(seen)}.")
    diagnosis = replace(
        found.diagnosis,
        exploratory=bool(seen),
        notes=tuple(notes),
        noise_floor=noise_floors(found.refits, recordings),
        next_experiment=proposed,
        quick=quick,
    )
    return replace(found, diagnosis=diagnosis), look_at(whole, sealed)


def _of_file(asked: Subject, found: Answer, runs: Campaign) -> Iterator[str]:
    """Yield what the file of the machine has to do with the result, a sentence each."""
    models = {name: equation.model for name, equation in found.layout.equations.items()}
    for name, model in models.items() if asked.of_machine else ():
        if note := offsets_note(model, runs):
            yield f"{name}: {note[0].lower()}{note[1:]}"
    for finding in found.diagnosis.findings:
        places = (finding.place, *finding.alternative_places.values())
        for channel in dict.fromkeys(place.removeprefix("sensor ") for place in places):
            if channel in asked.formulas:
                yield (
                    f"{finding.balance}: no sensor reads {channel}, which is the formula"
                    f" {asked.formulas[channel]}. An error of it is one of the formula, or of the"
                    f" reading {models[finding.balance].target} that it is compared with."
                )


def _usable(asked: Subject) -> tuple[list[Recording], list[str]]:
    """Return the runs that can be used as they are, and a sentence on each other run."""
    whole, lost = steady(list(asked.campaign.evidence))
    bad = _spoiled(asked, whole)
    lost += [f"Run {name} is left out: {reason}." for name, reason in bad.items()]
    return [recording for recording in whole if recording.name not in bad], lost


def _spoiled(asked: Subject, recordings: Sequence[Recording]) -> dict[str, str]:
    """Return the runs in which a recorded channel of an equation is surely wrong, and how."""
    integral_of = {} if asked.plant is None else integrals(asked.plant)
    read = {
        integral_of.get(name, name)
        for model in asked.models
        for name in measured_channels([*model.channels, model.target], model.signals)
    }
    return spoiled(without(recordings, integral_of), read)


def noise_floors(refits: Refits, recordings: Sequence[Recording]) -> dict[str, float | None]:
    """Return each equation's noise floor in its target's unit, None where nothing was repeated.

    Two runs of one motion and load contain the same physics, and so do two periods of one path.
    Half of the variance of the difference of their residuals is unexplained by any model of these
    variables.
    """
    pairs = repeats(recordings)
    out = dict[str, float | None]()
    for equation, refit in refits.of.items():
        used = [pair for pair in pairs if {*pair} <= refit.recordings.keys()]  # some are left out
        both = [_difference(refits, equation, *pair) for pair in used]
        centred = [x - x.mean() for x in both if x.size >= LEAST_SHARED]
        squares = sum(0.5 * float(np.sum(x**2)) for x in centred)
        samples = sum(map(len, centred))
        out[equation] = float(np.sqrt(squares / samples)) if samples else None
    return out


def repeats(recordings: Sequence[Recording]) -> list[tuple[str, str]]:
    """Return the pairs of runs of the same motion under the same load, or of one path."""
    return [
        (one.name, other.name)
        for one, other in itertools.combinations(recordings, 2)
        if len(one) == len(other)
        and (period_of(one.name) == period_of(other.name) != "" or _asked_alike(one, other))
    ]


def _asked_alike(one: Recording, other: Recording, alike: float = 2e-3) -> bool:
    """Whether two runs have one reference, to a small angle and current, that moves."""
    asked = ("target_angle_rad", "load_command_a")
    return all(
        name in one and name in other and float(np.abs(one[name] - other[name]).max()) < alike
        for name in asked
    ) and bool(np.ptp(one[asked[0]]) > alike)


def _difference(refits: Refits, equation: str, one: str, other: str) -> FloatArray:
    """Return the difference of two residuals at the samples that both use."""
    solved = refits.after(equation)
    found = [refits.of[equation].residuals(solved, name) for name in (one, other)]
    if found[0] is None or found[1] is None:
        return np.empty(0)
    (first, _, left), (second, _, right) = found[0], found[1]
    _, at, also = np.intersect1d(first, second, assume_unique=True, return_indices=True)
    return np.asarray(left[at] - right[also])
