"""The effects that the runs of a protocol can distinguish, before they are recorded."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimation.causes.findings import IN_SET, SURE
from estimation.causes.isolability import NOTHING, Isolable, isolability
from estimation.causes.sources import READ_LATE
from estimation.effects import catalogue
from rig.diagnosis.subject import declared_models, subject
from rig.errors import UsageError
from rig.protocols.protocol import load_protocol
from rig.simulation.campaign import simulate_reference_campaign


@dataclass(frozen=True)
class Plan:
    """The expected conclusion on each effect, the vaguest first, from so many runs of a source.

    `run_offsets` states whether runs have offsets of their own in some equation.
    """

    source: str
    runs: int
    effects: tuple[Isolable, ...]
    run_offsets: bool = True

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON types."""
        return {
            "source": self.source,
            "runs": self.runs,
            "effects": [
                {
                    "equation": one.equation,
                    "place": one.place,
                    "family": one.family,
                    "probability": round(one.share, 4),
                    "others": {name: round(p, 4) for name, p in _listed(one).items()},
                }
                for one in self.effects
            ],
        }


def plan_of(
    path: Path,
    model: Path | None = None,
    balance: str | None = None,
    machine: Path | None = None,
    on_part: Callable[[int, int], None] = lambda done, count: None,
) -> Plan:
    """Return the effects that the runs of a protocol, or recordings, can distinguish.

    A protocol, a file or a name, is played on the simulated reference rig; recordings are of any
    machine. The model, the only equation and the machine are those of `subject`. `on_part` is
    called with the number of effects done and of all.

    Raises:
        UsageError: No such protocol or recordings, or a machine that no simulator plays.
        EstimationError: An equation cannot be identified on these runs.
    """
    if path.is_dir() or (path.exists() and path.suffix != ".toml"):
        asked = subject(path, model, balance, machine=machine)
        recordings, models = list(asked.campaign.evidence), asked.models
    else:
        load_protocol(str(path))
        if machine is not None:
            raise UsageError(
                f"A protocol cannot be played on the machine of {machine}.",
                "Only the reference rig is simulated.",
                "Name recordings of the machine instead: rig diagnose --plan RECORDINGS.",
            )
        models = declared_models(model, balance)
        recordings = list(simulate_reference_campaign(1, str(path)).evidence)
    found = isolability(models, recordings, on_part=on_part)
    offsets = any(model.run_offsets for model in models)
    return Plan(str(path), len(recordings), tuple(found), offsets)


def _listed(one: Isolable, least: float = 0.05) -> dict[str, float]:
    """Return the other effects that are worth a word, with their probabilities."""
    return {name: p for name, p in one.others.items() if p >= least}


def sentences(plan: Plan) -> list[str]:
    """Return the plan as lines: effects not distinguished, not seen and named, and advice."""
    vague = [one for one in plan.effects if one.share < SURE and _seen(one)]
    unseen = [one for one in plan.effects if not _seen(one)]
    named = [one for one in plan.effects if one.share >= SURE]
    lines = [
        f"{plan.source}, {plan.runs} runs. Of each effect, as large as the residual is now:",
        f"{len(named)} of {len(plan.effects)} would be named; {len(vague)} would be one of several;"
        f" {len(unseen)} would not be seen.",
    ]
    if vague:
        lines.append(
            "One of several. Each line has an effect, the probability that it would be named, then"
            " the names that it would be given instead with theirs ('nothing': without a finding),"
            " and in brackets where it acts."
        )
    for one in vague:
        others = ", ".join(f"{name} {p:.2f}" for name, p in _listed(one).items())
        lines.append(f"  {one.equation}: {one.family} {one.share:.2f} or {others} ({one.place})")
    instead = "the declared terms" + " or the run offsets" * plan.run_offsets
    late = [one for one in unseen if one.family in READ_LATE]
    for why, effects in (
        (f"because {instead} take its place", [one for one in unseen if one not in late]),
        ("because short delays of readings are part of every model; one above 2 ms can be", late),
    ):
        if effects:
            lines.append(f"Not seen, {why}:")
            lines += [f"  {one.equation}: {one.family} ({one.place})" for one in effects]
    if named:
        lines.append("Named:")
        lines += [f"  {one.equation}: {one.family} {one.share:.2f} ({one.place})" for one in named]
    advice = {
        effect.family: effect.told_apart_by
        for one in vague
        for effect in catalogue().values()
        if effect.family == one.family and effect.told_apart_by
    }
    if advice:
        lines.append("What distinguishes them:")
        lines += [f"  {family}: {text}" for family, text in sorted(advice.items())]
    return lines


def _seen(one: Isolable) -> bool:
    return one.others.get(NOTHING, 0.0) < 1.0 - IN_SET / 2.0
