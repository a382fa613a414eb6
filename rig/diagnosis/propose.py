"""The next experiment of a diagnosis: the menu played on the simulated twin, the best one taken."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from estimation.diagnosis.candidate import Candidate, projected
from estimation.diagnosis.design import DesignError, Run, prepare, targets
from estimation.diagnosis.instruments import projection as instrumented
from estimation.diagnosis.next_experiment import Worth, beside, rivals_of, worth
from estimation.diagnosis.result import Diagnosis, Finding
from estimation.diagnosis.story import Story
from estimation.diagnosis.twin import coarse
from estimation.diagnosis.variables import PROJECTED, projection
from estimation.files import write_text_atomic
from estimation.recording import Recording, shared_columns
from rig.configuration.config import load_config
from rig.diagnosis.menu import menu, room_of, within
from rig.protocols.protocol import Protocol, protocol_toml
from rig.simulation.twin import Twin

CAMPAIGN_TIME = "campaign_time_s"

SEED = 7_000_000
"""Far from the seeds of the twins that prove a finding."""


def propose(
    diagnosis: Diagnosis,
    stories: Mapping[str, Story],
    recordings: Sequence[Recording],
    twin: Twin | None,
) -> dict[str, Any] | None:
    """Return the next experiment in plain JSON types, or None where every name is unique.

    Without a twin, it is what the rivals themselves say tells them apart, in words, and no
    protocol.

    Args:
        diagnosis: The answer.
        stories: The stories behind it.
        recordings: The runs.
        twin: Simulates the declared models, or None.
    """
    measured = shared_columns(recordings)
    for finding in diagnosis.findings:
        story = stories[finding.balance]
        rivals = rivals_of(story, finding, measured)
        if len(rivals) < 2:
            continue
        if twin is None:
            return _in_words(finding, rivals)
        scored = _scored(story, finding, rivals, recordings, twin)
        if scored:
            return _described(finding, rivals, scored)
    return None


def write_protocol(diagnosis: Diagnosis, path: Path) -> str:
    """Write the next experiment as a protocol file; return what to tell a person."""
    proposed = diagnosis.next_experiment
    if proposed is None:
        return "No next experiment: there are no competing hypotheses to distinguish."
    if proposed["protocol"] is None:
        return f"No protocol for the next experiment; by hand: {proposed['description']}."
    write_text_atomic(path, protocol_toml(Protocol.model_validate(proposed["protocol"])))
    return f"Next: rig record --protocol {path}"


def _scored(
    story: Story,
    finding: Finding,
    rivals: Sequence[Candidate],
    recordings: Sequence[Recording],
    twin: Twin,
) -> list[tuple[Protocol, Worth]]:
    limits = load_config().reference_limits
    balance = story.balance
    known = list(balance.runs[0].channels)
    made = {"time_s", *PROJECTED.values(), *(projected(name) for name in known)}
    others = beside(story, finding)
    told = instrumented(balance.runs, [*others, *rivals], balance.model.target)
    whole = projection(balance)
    # old and new runs are thinned alike
    old = [coarse(run) for run in balance.runs]
    thin = replace(balance, runs=old, target=targets(old, balance.model), tables_of={})
    scored = []
    for protocol in menu(room_of(recordings, limits)):
        plans = protocol.plans()
        played = [twin.play(plan, SEED + k) for k, plan in enumerate(plans)]
        if not within(played, limits):
            continue
        if CAMPAIGN_TIME in known:
            played = _after(balance.runs, played)
        wanted = [name for name in known if name not in made]
        runs = []
        for run in played:
            try:
                runs.append(coarse(whole(told(prepare(run, wanted, balance.model)))))
            except DesignError:
                continue  # a run that only rests tells nothing of this balance
        if runs:
            seconds = sum(plan.duration_s for plan in plans)
            scored.append((protocol, worth(thin, others, rivals, protocol.name, runs, seconds)))
    return sorted(scored, key=lambda pair: -pair[1].net)


def _after(runs: Sequence[Run], played: Sequence[Recording]) -> list[Recording]:
    """Return played runs on the campaign's clock, a minute apart behind the runs there are."""
    last = max(float(run.channels[CAMPAIGN_TIME].max()) for run in runs)
    return [
        recording.with_columns(**{CAMPAIGN_TIME: last + 60.0 * (k + 1) + recording.time_s})
        for k, recording in enumerate(played)
    ]


def _described(
    finding: Finding, rivals: Sequence[Candidate], scored: Sequence[tuple[Protocol, Worth]]
) -> dict[str, Any]:
    protocol, best = scored[0]
    return {
        "name": protocol.name,
        "description": protocol.description,
        "balance": finding.balance,
        "between": [rival.family for rival in rivals],
        "discrimination": best.discrimination,
        "others": {other.name: told.discrimination for other, told in scored[1:]},
        "seconds": best.seconds,
        "protocol": {
            "name": protocol.name,
            "description": protocol.description,
            "runs": [table.model_dump(exclude_unset=True) for table in protocol.runs],
        },
    }


def _in_words(finding: Finding, rivals: Sequence[Candidate]) -> dict[str, Any]:
    advice = dict.fromkeys(r.effect.told_apart_by for r in rivals if r.effect.told_apart_by)
    return {
        "name": "by hand",
        "description": "; ".join(advice),
        "balance": finding.balance,
        "between": [rival.family for rival in rivals],
        "discrimination": None,
        "others": {},
        "seconds": None,
        "protocol": None,
    }
