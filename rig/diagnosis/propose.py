"""The next experiment of a diagnosis: a menu played on the simulated rig, and the best of it."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.experiment import Question, question, separation
from estimation.causes.verdict import Answer
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.result import Diagnosis
from estimation.effects import catalogue
from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from rig.configuration.config import load_config
from rig.configuration.machine_settings import ReferenceLimits
from rig.errors import RigError
from rig.protocols.protocol import Protocol, protocol_toml
from rig.simulation.fitted_rig import FittedRig, fitted_rig

PLAYED = ("motor", "gearbox", "cable", "stretch")
"""Equations of the simulated rig's own parts; also the names of their shipped models."""

MENU = {
    "grasps": "the plain grasps again, at three loads",
    "speeds": "constant speeds from slow to fast, both ways, at three loads",
    "reversals": "tiny motions to and fro, at three loads",
    "holds": "steps that are held, at three loads",
    "loads": "grasps while the load climbs and falls",
    "free": "slow and fast sweeps without load",
    "chirp": "small grasps that become faster and faster",
    "dwells": "moves after rests of different length",
}

COST_PER_MINUTE = 0.01
"""Separation that a minute at the rig must add: a hundredth of the noise's variance."""

OF_LIMIT = 0.8
"""Share of a limit of the rig that a proposed experiment may use."""


def propose(
    answer: Answer, recordings: Sequence[Recording], executor: Executor | None = None
) -> dict[str, Any] | None:
    """Return the next experiment in plain JSON types, or None where every name is sure.

    It is chosen for the first finding without a sure name, on runs with the campaign's time. Where
    the rig cannot be simulated, the experiments that the effects' files name are proposed, without
    a protocol. An executor plays experiments in parallel.
    """
    asked = (question(answer, k) for k in range(len(answer.kept)))
    found = next(((k, one) for k, one in enumerate(asked) if one is not None), None)
    if found is None:
        return None
    place, hypotheses = found
    names = [one.label for one in hypotheses.hypotheses]
    described = {"balance": answer.diagnosis.findings[place].balance, "between": names}
    train = [r for r in recordings if r.name in answer.diagnosis.sealed.discover]
    rig = simulated_rig([equation.model for equation in answer.layout.equations.values()], train)
    scored: list[tuple[Protocol, float]] = []
    if rig is not None:
        last_s = max(float(r[CAMPAIGN_TIME][-1]) for r in recordings)
        offered = menu(recordings, load_config().reference_limits)
        worth = partial(_worth, rig, hypotheses, last_s)
        values = map(worth, offered) if executor is None else executor.map(worth, offered)
        scored = [(p, v) for p, v in zip(offered, values, strict=True) if v is not None]
    if not scored:
        return _by_hand(described)
    scored.sort(key=lambda pair: COST_PER_MINUTE * _seconds(pair[0]) / 60.0 - pair[1])
    best, separated = scored[0]
    named = {"name": best.name, "description": best.description}
    return {
        **named,
        **described,
        "discrimination": separated,
        "others": {other.name: value for other, value in scored[1:]},
        "seconds": _seconds(best),
        "protocol": named | {"runs": [table.model_dump(exclude_unset=True) for table in best.runs]},
    }


def write_protocol(diagnosis: Diagnosis, path: Path) -> str:
    """Write the next experiment as a protocol file; return the message for the user."""
    proposed = diagnosis.next_experiment
    if proposed is None:
        return "No next experiment: there are no competing hypotheses to distinguish."
    if proposed["protocol"] is None:
        return f"No protocol for the next experiment; by hand: {proposed['description']}."
    write_text_atomic(path, protocol_toml(Protocol.model_validate(proposed["protocol"])))
    return f"Next: rig record --protocol {path}"


def simulated_rig(fitted: Sequence[Model], train: Sequence[Recording]) -> FittedRig | None:
    """Return the simulated rig with equations that were fitted on training runs.

    An equation that is not diagnosed is taken from the shipped models and fitted on the same runs:
    the plant needs all its parts. None where the simulated rig has none of the equations, or the
    runs lack a channel.
    """
    own = {model.balance: model for model in fitted if model.balance in PLAYED}
    if not own:
        return None
    campaign, parts = Campaign.of(train), []
    signals = next(iter(own.values())).signals
    try:
        for name in PLAYED:
            try:
                shipped = replace(model_file.read(Path(name)), signals=signals)
                parts.append(own.get(name) or fit(shipped, campaign, bootstrap=0))
            except EstimationError:
                continue
        return fitted_rig(parts, list(campaign.evidence))
    except (RigError, EstimationError):
        return None


def menu(recordings: Sequence[Recording], limits: ReferenceLimits) -> list[Protocol]:
    """Return the experiments: six short runs each, so that some of them can confirm.

    They stay within the travel of the recordings, and within the rig's limits of travel and load.
    """
    angles = np.concatenate([r["spindle_angle_rad"] for r in recordings])
    reach = OF_LIMIT * limits.spindle_angle_rad
    low, high = (float(x) for x in np.clip(np.percentile(angles, [1, 99]), -reach, reach))
    whole, travel = high - low, round(0.6 * (high - low), 4)
    loads = [load for load in (0.15, 0.5, 0.9) if load <= OF_LIMIT * limits.load_command_a]
    climb = [loads[0], loads[-1], loads[len(loads) // 2], loads[0]]
    levels = [round(part * travel, 4) for part in (0, 0.5, 1, 0.5, 0)]
    tiny, small = (round(part * whole, 4) for part in (0.04, 0.06))
    starts = [round(low + part * whole, 4) for part in (0.05, 0.3)]
    every = {"loads_a": loads, "jaw_starts_rad": starts}
    half = {"amplitude_rad": round(0.5 * travel, 4), **every}
    along = {"travel_rad": travel, **every}
    sine = {"kind": "sine", "duration_s": 10.0, **half}
    rests, speeds = [0.2, 4.0, 1.0, 0.2, 2.0], [0.12, 0.3, 0.8, 1.5]
    climbing = {"kind": "load_staircase", **half, "loads_a": climb, "hold_s": 3.0}
    tables: dict[str, dict[str, object]] = {
        "grasps": {**sine, "frequencies_hz": [0.3]},
        "speeds": {"kind": "speed_staircase", "speeds_rad_s": speeds, "pause_s": 0.1, **along},
        "reversals": {**sine, "frequencies_hz": [0.8], "amplitude_rad": tiny},
        "holds": {"kind": "step_hold", "levels_rad": levels, "hold_s": 2.5, **every},
        "loads": {**climbing, "frequencies_hz": [0.15, 0.3, 0.5]},
        "free": {**sine, "frequencies_hz": [0.1, 0.25, 0.5], "loads_a": [0.0]},
        "chirp": {"kind": "chirp", "low_hz": 0.2, "high_hz": 4.0, "amplitude_rad": small, **every},
        "dwells": {"kind": "dwell", "dwells_s": rests, **along},
    }
    return [
        Protocol.model_validate({"name": name, "description": MENU[name], "runs": [table]})
        for name, table in tables.items()
    ]


def within(recordings: Sequence[Recording], limits: ReferenceLimits) -> bool:
    """Whether simulated runs stay away from every limit."""
    return all(
        float(np.abs(run[name]).max()) <= OF_LIMIT * limit
        for run in recordings
        for name, limit in limits.model_dump().items()
        if name in run
    )


def _worth(
    rig: FittedRig,
    asked: Question,
    last_s: float,
    protocol: Protocol,
    seed: int = 7_000_000,
    pause_s: float = 60.0,
) -> float | None:
    """Return the expected separation of an experiment; None beyond the limits of the rig."""
    played = [rig.play(plan, seed + k) for k, plan in enumerate(protocol.plans())]
    if not within(played, load_config().reference_limits):
        return None
    timed = []
    for recording in played:
        last_s += pause_s
        timed.append(recording.with_columns(**{CAMPAIGN_TIME: last_s + recording.time_s}))
        last_s += float(recording.time_s[-1])
    return separation(asked, timed)


def _seconds(protocol: Protocol) -> float:
    return sum(plan.duration_s for plan in protocol.plans())


def _by_hand(described: Mapping[str, Any]) -> dict[str, Any] | None:
    known: Mapping[str, Any] = catalogue()
    advice = [known[name].told_apart_by for name in described["between"] if name in known]
    text = "; ".join(dict.fromkeys(a for a in advice if a))
    if not text:
        return None
    return {
        "name": "by hand",
        "description": text,
        **described,
        "discrimination": None,
        "others": {},
        "seconds": None,
        "protocol": None,
    }
