"""The whole way: declared models, discovery, naming, freezing, and the confirm runs opened once."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation.campaign import Campaign, with_campaign_time
from estimation.derived import GEAR_RATIO
from estimation.diagnosis.audit import audit
from estimation.diagnosis.balance import Balance, as_model, intervals, lay_out
from estimation.diagnosis.candidate import UNKNOWN, Candidate, pool
from estimation.diagnosis.design import DesignError, Run, covered, prepare
from estimation.diagnosis.formula import Formula, formulas
from estimation.diagnosis.frozen import (
    Frozen,
    Part,
    errors,
    freeze,
    samples_of,
    settled,
    squares,
)
from estimation.diagnosis.instruments import instruments
from estimation.diagnosis.instruments import projection as instrumented
from estimation.diagnosis.maps import CHANNELS, LOAD, Map, needed_channels, projection
from estimation.diagnosis.result import Diagnosis, Error, Finding, Stated, Value
from estimation.diagnosis.search import Discovery, Gates, Named, Search
from estimation.diagnosis.split import LEAST_TO_NAME, Sealed
from estimation.diagnosis.twin import Bootstrap, Twin
from estimation.effects import Parameter
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.model import Estimate, Model
from estimation.recording import FloatArray, Recording

Maker = Callable[[Model, Sequence[Recording]], Twin]
"""Fitted model and discovery runs to their simulated twin."""

Stage = Callable[[str], None]
"""Told what begins, in words."""

Added = Mapping[str, FloatArray]
"""Run to what a finding changes in the estimate at its valid samples, shape (n,)."""

SAME_CAUSE = 0.9
"""Two balances show one cause when what it adds to them correlates at least this well."""

SAME_RATE = 0.03
"""Two waves are one when their periods a turn differ by less than this share."""

_TORQUE = "proximal torque sensor"
SENSORS = {
    "motor": {"current sensor", _TORQUE, "motor encoder"},
    "gearbox": {_TORQUE, "motor encoder", "spindle encoder"},
    "cable": {_TORQUE, "distal torque sensor", "spindle encoder"},
    "stretch": {"distal torque sensor", "spindle encoder", "jaw encoder"},
}
"""What each balance reads: a sensor at fault shows in all that read it."""

LIKE = {"sensor.lag": ("sensor.delay",), "sensor.delay": ("sensor.lag",)}
"""Faults that two balances may name differently."""

TWICE = 2.0
"""And when the sizes differ by less than this factor."""


@dataclass(frozen=True)
class Claim:
    """One finding before it is confirmed.

    Attributes:
        part: What it adds.
        verdict: What is claimed.
        named: The effect, or None.
        depends_on: Variables.
        formulas: What stands for its map in a model, the one that is written first.
    """

    part: Part
    verdict: str
    named: Named | None
    depends_on: tuple[str, ...]
    formulas: tuple[Formula, ...] = ()

    @property
    def written(self) -> Part:
        """What a model file holds of it: a formula in place of a map; nothing without one."""
        if self.part.map is None:
            return self.part
        return Part(formula=self.formulas[0].terms) if self.formulas else Part()


@dataclass(frozen=True)
class Story:
    """All that a report needs about one balance.

    Attributes:
        balance: The balance on the runs that discover.
        discovery: What the search did.
        claims: Claims that the confirm runs bore out.
        refused: Claims they did not, in words.
        before: Declared model, frozen.
        after: Model with the claims, frozen.
        values: Parameters of `after`'s effects, in their order.
        written: What a model file holds: `after` with formulas in place of maps, frozen.
        written_values: Parameters of its effects, in their order.
        confirm: The confirm runs.
        candidates: Grid points tried.
        families: Families tried.
        unused: Runs without a usable sample in this balance.
    """

    balance: Balance
    discovery: Discovery
    claims: tuple[Claim, ...]
    refused: tuple[str, ...]
    before: Frozen
    after: Frozen
    values: tuple[Mapping[str, Estimate], ...]
    written: Frozen
    written_values: tuple[Mapping[str, Estimate], ...]
    confirm: tuple[Run, ...]
    candidates: int
    families: tuple[str, ...]
    unused: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """The fitted model with what was found: named effects, and formulas in place of maps."""
        return as_model(self.written.balance, self.written.terms, self.written_values)


def diagnose(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    *,
    gates: Gates | None = None,
    executor: Executor | None = None,
    twins: Mapping[str, Maker] | None = None,
    on_stage: Stage = lambda _: None,
    on_open: Callable[[], None] = lambda: None,
) -> tuple[Diagnosis, dict[str, Story]]:
    """Diagnose declared models on a campaign.

    Args:
        recordings: Runs that count as evidence.
        models: Declared models, one a balance.
        sealed: The split of these runs, from `estimation.diagnosis.split.split`.
        gates: What an effect must pass.
        executor: Runs work over runs and over twins in parallel; None works here.
        twins: Balance to a maker of simulated twins from the fitted model and the discovery runs.
        on_stage: Told what begins.
        on_open: Called once, just before the confirm runs are opened.

    Returns:
        The diagnosis, and the story behind each balance that could be decided.

    Raises:
        EstimationError: No balance could be decided; the first one's reason.
    """
    began = time.monotonic()
    gates = replace(gates or Gates(), balances=len(models))
    stories: dict[str, Story] = {}
    failed: dict[str, EstimationError] = {}
    starts = [recording.started_at_ns for recording in recordings]
    if starts and None not in starts:
        first_ns = min(start for start in starts if start is not None)
        recordings = [with_campaign_time(recording, first_ns) for recording in recordings]
        twins = {name: partial(_timed, make, first_ns) for name, make in (twins or {}).items()}
    for model in models:
        on_stage(f"searching what the {model.balance} balance lacks")
        try:
            maker = (twins or {}).get(model.balance)
            stories[model.balance] = _balance(recordings, model, sealed, gates, executor, maker)
        except EstimationError as error:
            failed[model.balance] = error
    if failed and not stories:
        raise next(iter(failed.values()))
    discovering = [r for r in recordings if r.name in sealed.discover]
    on_stage("opening the confirm runs")
    on_open()
    stories = {name: _confirmed(story, gates) for name, story in stories.items()}
    findings = _one_cause_one_finding(stories)
    found: dict[str, Error] = {
        name: errors(s.before, s.after, s.confirm, sealed.seed) for name, s in stories.items()
    }
    diagnosis = Diagnosis(
        findings=tuple(findings),
        errors=found,
        unit={name: s.balance.model.unit for name, s in stories.items()},
        noise_floor=dict.fromkeys(stories),
        moved={name: _moved(s) for name, s in stories.items()},
        sealed=sealed,
        undecided={name: str(error) for name, error in failed.items()},
        notes=(*audit(discovering), *_notes(sealed, twins, stories)),
        seconds=time.monotonic() - began,
    )
    return diagnosis, stories


def _timed(make: Maker, first_ns: int, model: Model, discover: Sequence[Recording]) -> Twin:
    """Return a twin whose runs have the campaign's time too."""
    return partial(_timed_runs, make(model, discover), first_ns)


def _timed_runs(twin: Twin, first_ns: int, seed: int) -> list[Recording]:
    return [with_campaign_time(recording, first_ns) for recording in twin(seed)]


def _balance(
    recordings: Sequence[Recording],
    model: Model,
    sealed: Sealed,
    gates: Gates,
    executor: Executor | None,
    maker: Maker | None,
) -> Story:
    """Fit the declared model and search, on the runs that discover; prepare those that confirm."""
    discover = [r for r in recordings if r.name in sealed.discover]
    confirm = [r for r in recordings if r.name in sealed.confirm]
    measured = sorted(set.intersection(*({*r.columns} for r in recordings)))
    fitted = fit(model, Campaign.of(discover), bootstrap=0)
    tried = pool(model, measured)
    wanted = [model.target, *model.channels, *needed_channels(measured)]
    wanted += [*instruments(measured), *(channel for c in tried for _, channel in c.channels)]
    wanted = list(dict.fromkeys(wanted))
    mapper = map if executor is None else executor.map
    runs, rested = _usable(discover, wanted, model)
    held, also = _usable(confirm, wanted, model)
    tried = covered(tried, runs)
    told = instrumented(runs, tried, fitted.target)
    balance = lay_out(fitted, [told(run) for run in runs], mapper)
    balance = replace(balance, terms=balance.refined(balance.terms))
    loaded = projection(balance)
    balance = replace(balance, runs=[loaded(run) for run in balance.runs])
    twin = None
    if maker is not None:
        source = maker(fitted, discover)
        twin = Bootstrap(source, fitted, tried, wanted, gates.chance, mapper).p_value
    discovery = Search(balance, tried, gates, sealed.seed, twin).run()
    claims = _claims(discovery, balance, gates, len(runs) >= LEAST_TO_NAME)
    beside = [c.part.candidate for c in claims if c.part.candidate is not None]
    claims = [
        c
        if c.part.map is None
        else replace(c, formulas=formulas(balance, [*balance.terms, *beside], c.part.map))
        for c in claims
    ]
    before = freeze(balance, [])
    return Story(
        balance=balance,
        discovery=discovery,
        claims=tuple(claims),
        refused=(),
        before=before,
        after=before,
        values=(),
        written=before,
        written_values=(),
        confirm=tuple(loaded(told(run)) for run in held),
        candidates=len(tried),
        families=tuple(dict.fromkeys(c.family for c in tried)),
        unused=(*rested, *also),
    )


def _usable(
    recordings: Sequence[Recording], wanted: Sequence[str], model: Model
) -> tuple[list[Run], list[str]]:
    """Prepare runs; name those that have no usable sample, as one that only rests.

    Raises:
        DesignError: No run is usable.
    """
    runs: list[Run] = []
    unused: list[str] = []
    for recording in recordings:
        try:
            runs.append(prepare(recording, wanted, model))
        except DesignError:
            if not runs and recording is recordings[-1]:
                raise
            unused.append(recording.name)
    return runs, unused


def _claims(discovery: Discovery, balance: Balance, gates: Gates, may_name: bool) -> list[Claim]:
    """Return what is claimed, and no more than that."""
    claims: list[Claim] = []
    for named in discovery.named:
        if named.veto is not None:
            continue  # the map of what is left then speaks for it
        if may_name:
            sure = not named.rivals and named.confidence >= gates.sure
            verdict = "identified" if sure else "one_of"
            claims.append(Claim(Part(named.candidate), verdict, named, _variables(named)))
        else:
            claims.append(Claim(Part(named.candidate), "something_missing", named, ()))
    left = discovery.left_map
    told = {n.candidate.effect.any_function_of for n in discovery.named if n.veto is None}
    if left is not None and left.p <= gates.level and left.variables not in told:
        worth = left.gain * _share_left(claims, balance)
        # also what a named effect's form leaves of its own cause is no second cause
        if worth >= gates.map_floor and left.agree <= gates.agree:
            claims.append(_map_claim(left, may_name))
        elif worth >= gates.map_floor and not claims:
            claims.append(Claim(Part(map=left), "something_missing", None, ()))
    vetoes = [named.veto for named in discovery.named if named.veto is not None]
    if not claims and vetoes:
        # the effect is proved; that its name fell to this map makes it no smaller
        claims.append(_map_claim(vetoes[0], may_name))
    last = discovery.steps[-1] if discovery.steps else None
    if not claims and last is not None and last.stands_out(gates):
        claims.append(Claim(Part(last.candidates[0]), "something_missing", None, ()))
    return claims


def _map_claim(found: Map, may_name: bool) -> Claim:
    if not may_name:
        return Claim(Part(map=found), "something_missing", None, ())
    return Claim(Part(map=found), "depends_on", None, found.variables)


def _share_left(claims: Sequence[Claim], balance: Balance) -> float:
    """Return the share of the declared model's squared error that the claims leave."""
    found = [c.part.candidate for c in claims if c.part.candidate is not None]
    return balance.loss([*balance.terms, *found]) / max(balance.loss(balance.terms), 1e-300)


def _variables(named: Named) -> tuple[str, ...]:
    """Return the variables of an effect, from the channels it reads."""
    by_channel: dict[str, str] = {}
    for variable, channel in CHANNELS.items():
        by_channel[channel] = variable  # of two on one channel the last but history
    by_channel["spindle_angle_rad"] = "spindle_angle"
    by_channel[LOAD] = "load"
    by_channel["distal_torque_n_m"] = "load"
    family = named.candidate.family
    found = [by_channel[c] for _, c in named.candidate.channels if c in by_channel]
    signs = family.startswith("friction.") and family.split(".")[1] not in ("viscous", "drag")
    found = ["velocity_sign" if signs and v == "velocity" else v for v in found]
    if family.startswith("hysteresis."):
        found.append("history")
    return tuple(dict.fromkeys(found))


def _confirmed(story: Story, gates: Gates) -> Story:
    """Freeze, open the confirm runs, and keep the claims they bear out."""
    kept: list[Claim] = []
    refused: list[str] = []
    last = story.before
    for claim in story.claims:
        trial = freeze(story.balance, [*(c.part for c in kept), claim.part])
        reason = _refusal(last, trial, story.confirm, gates)
        if reason is None:
            kept.append(claim)
            last = trial
        else:
            what = claim.named.candidate.family if claim.named else UNKNOWN
            refused.append(f"{what}: {reason}")
    values = tuple(intervals(story.balance, last.terms, seed=0))
    story = replace(story, claims=tuple(kept), refused=tuple(refused), after=last, values=values)
    return _written(story, gates)


def _written(story: Story, gates: Gates) -> Story:
    """Say what a model file holds; a formula that the confirm runs do not bear out is left out."""
    if all(claim.part.map is None for claim in story.claims):
        return replace(story, written=story.after, written_values=story.values)
    kept: list[Claim] = []
    refused = list(story.refused)
    last = story.before
    for claim in story.claims:
        parts = [c.written for c in (*kept, claim)]
        trial = (settled if claim.formulas else freeze)(story.balance, parts)
        reason = _refusal(last, trial, story.confirm, gates) if claim.formulas else None
        if reason is not None:
            refused.append(f"the formula {claim.formulas[0].text}: {reason}")
            kept.append(replace(claim, formulas=()))
            continue
        if claim.formulas:
            best, *others = claim.formulas
            claim = replace(claim, formulas=(best.settled(trial.terms, trial.weights), *others))
        kept.append(claim)
        last = trial
    values = tuple(intervals(last.balance, last.terms, seed=0))
    return replace(
        story, claims=tuple(kept), refused=tuple(refused), written=last, written_values=values
    )


def _refusal(before: Frozen, after: Frozen, confirm: Sequence[Run], gates: Gates) -> str | None:
    """Return why the confirm runs do not bear out what was added, or None where they do."""
    old, new = squares(before, confirm), squares(after, confirm)
    change = 100 * (new.sum() / old.sum() - 1)
    if new.sum() > (1 - gates.floor) * old.sum():
        return f"on the confirm runs the squared error changed by {change:+.1f} %"
    better = int(np.count_nonzero(new < old))
    if better < len(confirm) / 2:
        return f"it helps in {better} of {len(confirm)} confirm runs"
    whole = [squares(f, confirm, at_rest=True).sum() for f in (before, after)]
    if whole[1] > whole[0]:
        return (
            f"on the confirm runs in motion the squared error changed by {change:+.1f} %, but over"
            f" all samples by {100 * (whole[1] / whole[0] - 1):+.1f} %"
        )
    return None


def _findings(story: Story) -> list[tuple[Finding, Added]]:
    """Return the findings of one balance, each with what it changes in the estimate."""
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
            (
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
                    parameters=_parameters(story, named.candidate) if named else {},
                    formulas=_stated(story, claim, samples),
                ),
                _added(last, now, story.balance.runs),
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


def _parameters(story: Story, candidate: Candidate) -> dict[str, Value]:
    own = story.values[story.after.terms.index(candidate)]
    units = {p.name: candidate.term.unit(p, story.balance.model.target) for p in _all(candidate)}
    return {name: Value(e.value, units[name], e.ci95) for name, e in own.items()}


def _all(candidate: Candidate) -> tuple[Parameter, ...]:
    return candidate.term.parameters


def _one_cause_one_finding(stories: Mapping[str, Story]) -> list[Finding]:
    """Report a cause seen in several balances once, where it explains the largest share."""
    found = [pair for story in stories.values() for pair in _findings(story)]
    # a named fault of a sensor speaks for what other balances only show
    found.sort(
        key=lambda pair: (
            not pair[0].family.startswith("sensor."),
            pair[0].rmse_after / max(pair[0].rmse_before, 1e-300),
        )
    )
    kept: list[tuple[Finding, Added]] = []
    for finding, added in found:
        for k, (first, other) in enumerate(kept):
            if finding.balance in (first.balance, *first.also_in):
                continue
            units = [stories[name].balance.model.unit for name in (first.balance, finding.balance)]
            if _same_cause(other, added, units[0] == units[1]) or _same_fault(first, finding):
                kept[k] = (replace(first, also_in=(*first.also_in, finding.balance)), other)
                break
        else:
            kept.append((finding, added))
    order = list(stories)
    ranked = sorted(kept, key=lambda pair: order.index(pair[0].balance))
    return [finding for finding, _ in ranked]


def _same_fault(first: Finding, second: Finding) -> bool:
    """Say whether a second balance shows a fault that the first one names.

    A sensor that both balances read, or a wave of as many periods a turn.
    """
    if not SENSORS.get(first.balance, set()) & SENSORS.get(second.balance, set()):
        return False
    if first.family.startswith("sensor."):
        akin = second.family.startswith("sensor.") or second.family == UNKNOWN
        return akin and (second.family in (first.family, UNKNOWN, *LIKE.get(first.family, ())))
    rates = [_periods_per_turn(finding) for finding in (first, second)]
    return None not in rates and abs(rates[0] / rates[1] - 1) < SAME_RATE  # type: ignore[operator]


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


def _same_cause(first: Added, second: Added, same_unit: bool) -> bool:
    """Say whether two contributions are the same torque: alike in course, sign and size.

    Balances of different units are compared by their course alone.
    """
    shared = [n for n in first if n in second and first[n].shape == second[n].shape]
    if not shared:
        return False
    one, other = (np.concatenate([part[n] for n in shared]) for part in (first, second))
    size = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if min(size) == 0:
        return False
    alike = float(one @ other) / (size[0] * size[1])
    if not same_unit:
        return abs(alike) >= SAME_CAUSE
    return alike >= SAME_CAUSE and 1 / TWICE <= size[0] / size[1] <= TWICE


def _moved(story: Story) -> dict[str, dict[str, float]]:
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


def _notes(
    sealed: Sealed, twins: Mapping[str, object] | None, stories: Mapping[str, Story]
) -> list[str]:
    """Return what the diagnosis cannot tell, in words."""
    notes = []
    if not sealed.may_name:
        notes.append(
            f"{len(sealed.discover)} runs discover; with fewer than {LEAST_TO_NAME} no effect is"
            " named."
        )
    if not twins:
        notes.append(
            "The search was held against shuffled residuals only, not against simulated twins of"
            " the declared model: artefacts of filters and feedback are not ruled out that way."
        )
    for name, story in stories.items():
        used = sum(int(run.used.sum()) for run in story.confirm)
        valid = sum(int(run.valid.sum()) for run in story.confirm)
        if story.unused:
            notes.append(f"{name}: without a usable sample: {', '.join(story.unused)}.")
        if used < valid:
            notes.append(
                f"{name}: reported errors count all samples; {1 - used / valid:.0%} of the confirm"
                " samples are at rest, where friction holds any torque: no fit, search or decision"
                " uses them."
            )
    notes += [
        f"{name}: not borne out by the confirm runs: {what}."
        for name, story in stories.items()
        for what in story.refused
    ]
    return notes
