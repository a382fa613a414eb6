"""From claims to findings: one cause is told once, whatever balances show it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.bank.states import GEAR_RATIO
from estimation.diagnosis.candidate import UNKNOWN
from estimation.diagnosis.consequences import follows
from estimation.diagnosis.design import Run
from estimation.diagnosis.frozen import Frozen, freeze, samples_of, squares
from estimation.diagnosis.result import Finding, Stated, Value
from estimation.diagnosis.story import Claim, Story
from estimation.recording import FloatArray

Added = Mapping[str, FloatArray]
"""Run to what a finding changes in the estimate at its valid samples, shape (n,)."""

SAME_CAUSE = 0.9
"""Two balances of one unit show one cause when what it adds correlates at least this well."""

TWICE = 2.0
"""And when the sizes differ by less than this factor."""

NEARLY = 0.8
"""A balance that names a cause better speaks for another one where it removes at least this share
of what the other removes of its own error."""

ECHO, LARGER = 0.3, 3.0
"""A claim that removes less than this share of its balance's squared error is not told from the
echo of a cause in another balance that removes so many times its share there."""

SHAKEN = ("inertia.missing", UNKNOWN)
SHAKEN_ECHO, SHAKEN_LARGER = 0.4, 1.5
"""The same for what any motion faster than usual shows: parts that move, and what has no name."""

PLAIN = 0.05
"""What is surely named, and no such motion, is told from this share on."""

MOTION = {"velocity", "acceleration"}
"""Variables of what such a motion alone shows: it has a cause, where another balance names one."""

SAME_RATE = 0.03
"""Two waves are one when their periods a turn differ by less than this share."""

HARMONICS = 3
"""Or when one comes up to so many times as often: what one balance bends has harmonics there."""

_TORQUE = "proximal torque sensor"
SENSORS = {
    "motor": {"current sensor", _TORQUE, "motor encoder"},
    "gearbox": {_TORQUE, "motor encoder", "spindle encoder"},
    "cable": {_TORQUE, "distal torque sensor", "spindle encoder"},
    "stretch": {"distal torque sensor", "spindle encoder", "jaw encoder"},
}
"""What each balance reads: a sensor at fault shows in all that read it."""

ENCODER, OF_TORQUE = "sensor.encoder_inl", ("motor", "cable")
"""A fault of an angle's reading, and balances of torque that no such fault can reach."""

UNREAD = ("cable", "stretch")
"""A torque at the jaw shows in the first by itself, in the second by what it stretches."""

ANGLES = {"motor_angle", "spindle_angle", "jaw_angle"}
"""Variables that tell where the rig stands."""

LIKE = {"sensor.lag": ("sensor.delay",), "sensor.delay": ("sensor.lag",)}
"""Faults that two balances may name differently."""


@dataclass(frozen=True)
class Told:
    """A finding of one balance.

    Attributes:
        finding: What is reported.
        added: What it changes in the estimate.
        story: The story of its balance.
        place: Place of its claim there.
        share: Share of the squared error in motion that it removes on the confirm runs.
    """

    finding: Finding
    added: Added
    story: Story
    place: int
    share: float

    @property
    def is_motion(self) -> bool:
        """Whether it is unnamed and depends on motion alone."""
        of = {*self.finding.depends_on}
        return self.finding.family == UNKNOWN and bool(of) and of <= MOTION

    def is_surer_than(self, other: "Told") -> bool:
        """Say whether it names, better than a finding of another balance, what both show."""
        mine, others = self.finding, other.finding
        if others.family == ENCODER and mine.balance in OF_TORQUE:
            return self.share >= ECHO  # no encoder makes a torque
        if other.is_motion and mine.verdict == "identified":
            return True
        told = others.family.startswith("sensor.") and _same_sensor(others, mine)
        if told or self.share < NEARLY * other.share:
            return False
        if (mine.verdict == "identified") != (others.verdict == "identified"):
            return mine.verdict == "identified"
        if mine.verdict == "identified":
            return self.share > other.share
        return (mine.confidence or 0.0) > (others.confidence or 0.0)

    def acts_behind(self, other: "Told") -> bool:
        """Say whether this is a torque that no sensor reads, and another balance shows its stretch.

        That goes with the angle alone, in whatever form: as if the angle's sensor were at fault, or
        as a function of it that has no name.
        """
        mine, others = self.finding, other.finding
        if (mine.balance, others.balance) != UNREAD or self.share < ECHO:
            return False
        if not all(f.depends_on and {*f.depends_on} <= ANGLES for f in (mine, others)):
            return False
        unnamed = others.family == UNKNOWN and mine.family != UNKNOWN
        return unnamed or others.family.startswith("sensor.")

    def is_cause_of(self, other: "Told") -> bool:
        """Say whether a finding of another balance is told by this one already."""
        if same_fault(self.finding, other.finding):
            return True
        if self.story.balance.model.unit == other.story.balance.model.unit:
            return _same_torque(self.added, other.added)
        return follows(self.story, self.place, other.story, other.place)


def _findings(story: Story) -> list[Told]:
    """Return the findings of one balance."""
    found = []
    last = story.before
    for k, claim in enumerate(story.claims):
        now = freeze(story.balance, [c.part for c in story.claims[: k + 1]])
        runs = [*story.balance.runs, *story.confirm]
        old, new = squares(last, runs, at_rest=True), squares(now, runs, at_rest=True)
        held = slice(len(story.balance.runs), None)
        samples = samples_of(story.confirm).sum()
        named = claim.named if claim.verdict in ("identified", "one_of") else None
        found.append(
            Told(
                Finding(
                    balance=story.balance.model.balance,
                    family=named.candidate.family if named else UNKNOWN,
                    verdict=claim.verdict,
                    rmse_before=float(np.sqrt(old[held].sum() / samples)),
                    rmse_after=float(np.sqrt(new[held].sum() / samples)),
                    runs_improved=int(np.count_nonzero(new[held] < old[held])),
                    runs_total=len(story.confirm),
                    runs_affected=tuple(
                        r.name for r, a, b in zip(runs, old, new, strict=True) if b < 0.98 * a
                    ),
                    alternatives=named.rivals if named else (),
                    depends_on=claim.depends_on,
                    confidence=named.confidence if named else None,
                    parameters=_parameters(story, k) if named else {},
                    formulas=_stated(story, claim, samples),
                    form=claim.form.text if claim.form else "",
                ),
                _added(last, now, story.balance.runs),
                story,
                k,
                1.0 - squares(now, story.confirm).sum() / squares(last, story.confirm).sum(),
            )
        )
        last = now
    return found


def _stated(story: Story, claim: Claim, samples: float) -> tuple[Stated, ...]:
    """Return the formulas of a claim; the first is written, and its error is confirmed.

    A map is the last of a balance's claims, so the written model is the one with its formula.
    """
    found = claim.formulas
    if not found:
        return ()
    left = squares(story.written, story.confirm, at_rest=True).sum()
    confirmed = [float(np.sqrt(left / samples)), *(None for _ in found[1:])]
    return tuple(Stated(f.text, f.gain, e) for f, e in zip(found, confirmed, strict=True))


def _parameters(story: Story, place: int) -> dict[str, Value]:
    """Return the parameters of the effect that a claim adds."""
    before = [term for claim in story.claims[:place] for term in claim.part.terms]
    at = len(story.before.terms) + len(before)
    candidate, own = story.after.terms[at], story.values[at]
    units = {
        p.name: candidate.term.unit(p, story.balance.model.target)
        for p in candidate.term.parameters
    }
    return {name: Value(e.value, units[name], e.ci95) for name, e in own.items()}


def findings_of(causes: Sequence[Told], order: Sequence[str]) -> list[Finding]:
    """Return the findings to report: by balance in this order, in each as they were found."""
    ranked = sorted(causes, key=lambda told: (order.index(told.finding.balance), told.place))
    return [told.finding for told in ranked]


def echoes(causes: Sequence[Told]) -> dict[str, set[int]]:
    """Return the places of claims too small to be told from what a larger cause does elsewhere.

    What shakes the axis shows whatever the other balances lack: an inertia that nothing but a
    ripple makes visible is there, and is not what is wrong.
    """
    small: dict[str, set[int]] = {}
    for told in causes:
        shaken = told.finding.family in SHAKEN
        most, times = (SHAKEN_ECHO, SHAKEN_LARGER) if shaken else (ECHO, LARGER)
        if told.finding.verdict == "identified" and not shaken:
            most = PLAIN
        larger = [c for c in causes if c.finding.balance != told.finding.balance]
        named = [c for c in larger if c.finding.verdict == "identified"]
        echo = told.share < most and any(c.share > times * told.share for c in larger)
        if echo or (told.is_motion and any(c.share > told.share for c in named)):
            small.setdefault(told.finding.balance, set()).add(told.place)
    return small


def causes_of(stories: Mapping[str, Story]) -> list[Told]:
    """Return the findings of all balances, each cause once, where it explains the largest share."""
    found = [told for story in stories.values() for told in _findings(story)]
    # a named fault of a sensor speaks for what other balances only show
    found.sort(
        key=lambda told: (
            told.share < ECHO or not told.finding.family.startswith("sensor."),
            -told.share,
        )
    )
    kept: list[Told] = []
    for told in found:
        for k, first in enumerate(kept):
            shown = (first.finding.balance, *first.finding.also_in)
            behind = told.acts_behind(first)
            if told.finding.balance not in shown and (behind or first.is_cause_of(told)):
                lead = told if behind or told.is_surer_than(first) else first
                also = tuple(b for b in (*shown, told.finding.balance) if b != lead.finding.balance)
                kept[k] = replace(lead, finding=replace(lead.finding, also_in=also))
                break
        else:
            kept.append(told)
    return kept


def same_fault(first: Finding, second: Finding) -> bool:
    """Say whether a second balance shows a fault that the first one names.

    A sensor that both balances read, or a wave of as many periods a turn.
    """
    if not SENSORS.get(first.balance, set()) & SENSORS.get(second.balance, set()):
        return False
    if _same_sensor(first, second):
        return True
    rates = sorted(r for r in map(_periods_per_turn, (first, second)) if r is not None)
    if len(rates) < 2:
        return False
    times = rates[1] / rates[0]
    return round(times) <= HARMONICS and abs(times / round(times) - 1) < SAME_RATE


def _same_sensor(first: Finding, second: Finding) -> bool:
    """Say whether a second balance shows, by name or unnamed, the sensor's fault of the first."""
    alike = (first.family, UNKNOWN, *LIKE.get(first.family, ()))
    return first.family.startswith("sensor.") and second.family in alike


def _periods_per_turn(finding: Finding) -> float | None:
    """Return a wave's periods a turn of the spindle, or None for what is no wave."""
    order = finding.parameters.get("order")
    if order is None:
        return None
    return order.value * (GEAR_RATIO if "motor_angle" in finding.depends_on else 1.0)


def _added(last: Frozen, now: Frozen, runs: Sequence[Run]) -> Added:
    """Return what a claim changes in the estimate of each run, its mean removed.

    What the declared parameters had taken up of the effect is not part of it, so that one cause has
    one shape in every balance.
    """
    changes = {run.name: last.error(run, True) - now.error(run, True) for run in runs}
    return {name: change - change.mean() for name, change in changes.items()}


def _same_torque(first: Added, second: Added) -> bool:
    """Say whether two contributions are the same torque: alike in course, sign and size."""
    shared = [n for n in first if n in second and first[n].shape == second[n].shape]
    if not shared:
        return False
    one, other = (np.concatenate([part[n] for n in shared]) for part in (first, second))
    size = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if min(size) == 0:
        return False
    alike = float(one @ other) / (size[0] * size[1])
    return alike >= SAME_CAUSE and 1 / TWICE <= size[0] / size[1] <= TWICE


def moved(story: Story) -> dict[str, dict[str, float]]:
    """Return each declared amplitude before and after the findings."""
    moved: dict[str, dict[str, float]] = {}
    at = 0
    for term in story.before.terms:
        for parameter in term.effect.amplitudes:
            key = f"{term.id}.{parameter.name}"
            moved[key] = {
                "before": float(story.before.weights[at]),
                "after": float(story.after.weights[at]),
            }
            at += 1
    return moved
