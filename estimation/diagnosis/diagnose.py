"""The whole way: declared models, discovery, naming, freezing, and the confirm runs opened once."""

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

from estimation.campaign import Campaign, with_campaign_time
from estimation.diagnosis.audit import audit
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.candidate import pool
from estimation.diagnosis.claims import claims_of
from estimation.diagnosis.confirm import confirmed, without
from estimation.diagnosis.design import DesignError, Run, covered, prepare
from estimation.diagnosis.endogeneity import own_share
from estimation.diagnosis.findings import causes_of, echoes, findings_of, moved
from estimation.diagnosis.forms import formed
from estimation.diagnosis.formula import formulas
from estimation.diagnosis.frozen import errors, freeze
from estimation.diagnosis.gates import Gates
from estimation.diagnosis.instruments import instruments, stand_in
from estimation.diagnosis.instruments import projection as instrumented
from estimation.diagnosis.limits import limits
from estimation.diagnosis.naming import searched
from estimation.diagnosis.result import Diagnosis, Error
from estimation.diagnosis.search import Search
from estimation.diagnosis.shared_sensors import Fault, denied
from estimation.diagnosis.some_runs import IN_NO_MODEL, missing_in_some_runs
from estimation.diagnosis.split import LEAST_TO_NAME, Sealed
from estimation.diagnosis.story import Story
from estimation.diagnosis.twin import Bootstrap, Twin
from estimation.diagnosis.variables import needed_channels, projection
from estimation.effects.roles import MOTOR_LOAD
from estimation.errors import EstimationError
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording, shared_columns

Maker = Callable[[Model, Sequence[Recording]], Twin]
"""Fitted model and discovery runs to their simulated twin."""

Stage = Callable[[str], None]
"""Told what begins, in words."""


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
    for model in models:
        if faults := denied(stories).get(model.balance):
            on_stage(f"searching the {model.balance} balance without what other balances deny")
            maker = (twins or {}).get(model.balance)
            stories[model.balance] = _balance(
                recordings, model, sealed, gates, executor, maker, faults
            )
    discovering = [r for r in recordings if r.name in sealed.discover]
    on_stage("opening the confirm runs")
    on_open()
    stories = {name: confirmed(story, gates) for name, story in stories.items()}
    causes = causes_of(stories)
    if small := echoes(causes):
        for name, places in small.items():
            stories[name] = confirmed(without(stories[name], places), gates)
        causes = causes_of(stories)
    findings = findings_of(causes, list(stories))
    notes = (*audit(discovering), *limits(sealed, twins, stories, gates))
    measured = shared_columns(recordings)
    if not findings and (only := missing_in_some_runs(stories, gates, measured)) is not None:
        findings = [only]
        notes = (*notes, f"{only.balance}: {IN_NO_MODEL}")
    found: dict[str, Error] = {
        name: errors(s.before, s.after, s.confirm, sealed.seed) for name, s in stories.items()
    }
    diagnosis = Diagnosis(
        findings=tuple(findings),
        errors=found,
        unit={name: s.balance.model.unit for name, s in stories.items()},
        noise_floor=dict.fromkeys(stories),
        moved={name: moved(s) for name, s in stories.items()},
        sealed=sealed,
        undecided={name: str(error) for name, error in failed.items()},
        notes=notes,
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
    without: Collection[Fault] = (),
) -> Story:
    """Fit the declared model and search, on the runs that discover; prepare those that confirm.

    Candidates for the faults in `without` are left out.
    """
    discover = [r for r in recordings if r.name in sealed.discover]
    confirm = [r for r in recordings if r.name in sealed.confirm]
    measured = shared_columns(recordings)
    fitted = fit(model, Campaign.of(discover), bootstrap=0)
    tried = pool(model, measured)
    wanted = [model.target, *model.channels, *needed_channels(model.balance, measured)]
    wanted += [*instruments(measured), *(channel for c in tried for _, channel in c.channels)]
    wanted = list(dict.fromkeys(wanted))
    mapper = map if executor is None else executor.map
    runs, rested = _usable(discover, wanted, model)
    held, also = _usable(confirm, wanted, model)
    tried = [
        c
        for c in covered(tried, runs)
        if not any((c.family, channel) in without for _, channel in c.channels)
    ]
    standing = stand_in(runs, fitted.target)
    if MOTOR_LOAD not in wanted:  # live, the motor has to do with its own nominal load
        runs, held = [standing(run) for run in runs], [standing(run) for run in held]
    balance = lay_out(fitted, runs, mapper)
    balance = replace(balance, terms=balance.refined(balance.terms))
    loaded = projection(balance)
    balance = replace(balance, runs=[loaded(run) for run in balance.runs])
    # names are found with regressors free of noise, what is reported and run reads the sensors
    told = instrumented(runs, tried, fitted.target)
    seen = replace(balance, runs=[told(standing(run)) for run in balance.runs], tables_of={})
    twin = None
    if maker is not None:
        source = maker(fitted, discover)
        twin = Bootstrap(source, fitted, tried, wanted, gates, mapper).p_value
    discovery = searched(Search(seen, tried, gates, sealed.seed, twin))
    share = own_share(seen)
    claims = claims_of(discovery, seen, gates, len(runs) >= LEAST_TO_NAME, share >= gates.told)
    if not gates.akin:  # else every parameter counts
        claims = formed(claims, balance, tried, gates, sealed.seed)
    beside = [term for c in claims for term in c.part.terms]
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
        confirm=tuple(loaded(run) for run in held),
        candidates=len(tried),
        families=tuple(dict.fromkeys(c.family for c in tried)),
        unused=(*rested, *also),
        own_share=share,
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
