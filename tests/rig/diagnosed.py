"""A diagnosis with its signals, made from synthetic runs in seconds and without a search."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.campaign import Campaign
from estimation.derived import settled_places, zero_phase_channels
from estimation.diagnosis.result import Diagnosis, Error, Finding, Value
from estimation.diagnosis.split import Sealed, split
from estimation.effects import effect
from estimation.fitting import fit
from estimation.model import Estimate, Model, Term, estimate
from estimation.recording import Recording
from rig.diagnosis.traces import EquationTraces, RunTrace, Traces
from tests.estimation.synthetic import campaign

RIPPLE_N_M = 3e-3


def example() -> tuple[Diagnosis, Traces]:
    """Return a diagnosis that identified a ripple of seven waves a motor turn, and its signals."""
    whole = campaign(lambda angle, speed, load: RIPPLE_N_M * np.sin(7 * angle))
    runs = [handle.recording() for handle in whole.runs]
    sealed = split(runs, 0)
    training = Campaign.of(r for r in runs if r.name in sealed.discover)
    declared = model_file.read(Path("motor"))
    ripple = Term(effect("ripple.motor"), values={"order": Estimate(7.0)})
    before = fit(declared, training)
    after = fit(replace(declared, terms=(*declared.terms, ripple)), training)
    shown = _traces(runs, sealed, before, after)
    values = after.terms[-1].values
    errors = _errors(shown)
    finding = Finding(
        balance="motor",
        family="ripple.motor",
        verdict="one_of",
        rmse_before=errors.before,
        rmse_after=errors.after,
        runs_improved=len(sealed.confirm),
        runs_total=len(sealed.confirm),
        alternatives=("ripple.current",),
        depends_on=("motor_angle",),
        confidence=0.71,
        probabilities={"ripple.motor": 0.71, "ripple.current": 0.25},
        parameters={
            name: Value(known.value, "1" if name == "order" else "N m", known.ci95)
            for name, known in values.items()
        },
    )
    moved = {
        f"{term.effect.id}.{p.name}": {
            "before": term.values[p.name].value,
            "after": other.values[p.name].value,
        }
        for term, other in zip(before.terms, after.terms, strict=False)
        for p in term.effect.amplitudes
    }
    found = Diagnosis(
        findings=(finding,),
        errors={"motor": errors},
        unit={"motor": "N m"},
        noise_floor={"motor": 1e-3},
        moved={"motor": moved},
        sealed=sealed,
        notes=("A note with a <tag> & more.",),
        seconds=3.0,
    )
    return found, Traces({"motor": shown}, (("motor_angle_rad",),))


def _traces(
    recordings: list[Recording], sealed: Sealed, before: Model, after: Model
) -> EquationTraces:
    """Return the signals of the test runs with two fitted models."""
    runs = []
    for recording in recordings:
        if recording.name not in sealed.confirm:
            continue
        channels = zero_phase_channels(recording, [*after.channels, after.target], before.low_pass)
        places = settled_places(channels, before.low_pass, 5)
        left = [(channels[before.target] - estimate(m, channels))[places] for m in (before, after)]
        runs.append(
            RunTrace(
                recording.name,
                channels.time_s[places],
                channels[before.target][places],
                left[0] - left[0].mean(),
                left[1] - left[1].mean(),
                {"motor_angle_rad": channels["motor_angle_rad"][places]},
            )
        )
    return EquationTraces(before, tuple(runs))


def _errors(shown: EquationTraces) -> Error:
    by_run: dict[str, dict[str, float]] = {}
    for side in ("before", "after"):
        by_run[side] = {run.run: float(np.std(getattr(run, side))) for run in shown.runs}
    pooled = [float(np.sqrt(np.mean(np.square(list(one.values()))))) for one in by_run.values()]
    ratio = pooled[1] / pooled[0]
    return Error(*pooled, *pooled, (0.9 * ratio, 1.1 * ratio), by_run["before"], by_run["after"])
