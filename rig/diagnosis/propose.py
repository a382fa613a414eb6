"""The next experiment of a diagnosis: a menu played on the simulated rig, and the best of it."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

from estimation.causes.experiment import Question, question, separation
from estimation.causes.verdict import Answer
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.result import Diagnosis
from estimation.effects import catalogue
from estimation.files import write_text_atomic
from estimation.recording import Recording
from rig.configuration.config import load_config
from rig.diagnosis.menu import menu, room_of, within
from rig.diagnosis.simulated import simulated_rig
from rig.protocols.protocol import Protocol, protocol_toml
from rig.simulation.fitted_rig import FittedRig

SEED = 7_000_000
"""Seed of the simulated sensors' noise."""

COST_PER_MINUTE = 0.01
"""Separation that a minute at the rig must add: a hundredth of the noise's variance."""

PAUSE_S = 60.0
"""Time between runs of a new campaign."""


def propose(
    answer: Answer, recordings: Sequence[Recording], executor: Executor | None = None
) -> dict[str, Any] | None:
    """Return the next experiment in plain JSON types, or None where every name is sure.

    It is chosen for the first finding without a sure name. Where the rig cannot be simulated, the
    experiments that the effects' files name are proposed, without a protocol.

    Args:
        answer: The diagnosis.
        recordings: The runs, with the campaign's time.
        executor: Plays experiments in parallel; None plays them here.
    """
    asked = (question(answer, k) for k in range(len(answer.kept)))
    found = next(((k, one) for k, one in enumerate(asked) if one is not None), None)
    if found is None:
        return None
    place, hypotheses = found
    balance = answer.diagnosis.findings[place].balance
    names = [one.label for one in hypotheses.hypotheses]
    train = [r for r in recordings if r.name in answer.diagnosis.sealed.discover]
    declared = [equation.model for equation in answer.layout.equations.values()]
    rig = simulated_rig(declared, train)
    if rig is None:
        return _by_hand(balance, names)
    last_s = max(float(r[CAMPAIGN_TIME][-1]) for r in recordings)
    offered = menu(room_of(recordings, load_config().reference_limits))
    worth = partial(_worth, rig, hypotheses, last_s)
    values = list(map(worth, offered) if executor is None else executor.map(worth, offered))
    scored = [(p, v) for p, v in zip(offered, values, strict=True) if v is not None]
    if not scored:
        return _by_hand(balance, names)
    scored.sort(key=lambda pair: COST_PER_MINUTE * _seconds(pair[0]) / 60.0 - pair[1])
    return _described(balance, names, scored)


def write_protocol(diagnosis: Diagnosis, path: Path) -> str:
    """Write the next experiment as a protocol file; return the message for the user."""
    proposed = diagnosis.next_experiment
    if proposed is None:
        return "No next experiment: there are no competing hypotheses to distinguish."
    if proposed["protocol"] is None:
        return f"No protocol for the next experiment; by hand: {proposed['description']}."
    write_text_atomic(path, protocol_toml(Protocol.model_validate(proposed["protocol"])))
    return f"Next: rig record --protocol {path}"


def _worth(rig: FittedRig, asked: Question, last_s: float, protocol: Protocol) -> float | None:
    """Return the expected separation of an experiment; None beyond the limits of the rig."""
    plans = protocol.plans()
    played = [rig.play(plan, SEED + k) for k, plan in enumerate(plans)]
    if not within(played, load_config().reference_limits):
        return None
    timed = []
    for recording in played:
        last_s += PAUSE_S
        timed.append(recording.with_columns(**{CAMPAIGN_TIME: last_s + recording.time_s}))
        last_s += float(recording.time_s[-1])
    return separation(asked, timed)


def _seconds(protocol: Protocol) -> float:
    return sum(plan.duration_s for plan in protocol.plans())


def _described(
    balance: str, between: Sequence[str], scored: Sequence[tuple[Protocol, float]]
) -> dict[str, Any]:
    protocol, best = scored[0]
    return {
        "name": protocol.name,
        "description": protocol.description,
        "balance": balance,
        "between": list(between),
        "discrimination": best,
        "others": {other.name: value for other, value in scored[1:]},
        "seconds": _seconds(protocol),
        "protocol": {
            "name": protocol.name,
            "description": protocol.description,
            "runs": [table.model_dump(exclude_unset=True) for table in protocol.runs],
        },
    }


def _by_hand(balance: str, between: Sequence[str]) -> dict[str, Any] | None:
    known: Mapping[str, Any] = catalogue()
    advice = [known[name].told_apart_by for name in between if name in known]
    described = "; ".join(dict.fromkeys(a for a in advice if a))
    if not described:
        return None
    return {
        "name": "by hand",
        "description": described,
        "balance": balance,
        "between": list(between),
        "discrimination": None,
        "others": {},
        "seconds": None,
        "protocol": None,
    }
