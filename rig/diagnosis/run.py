"""A diagnosis from a path: read the runs, seal the split, search, confirm, remember the look."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from estimation import model_file
from estimation.arm.balances import balances_of
from estimation.arm.shared import shared_fit, with_links
from estimation.arm.twin import ArmTwin
from estimation.diagnosis.clock import steady
from estimation.diagnosis.diagnose import diagnose
from estimation.diagnosis.paths import PATHS, claim, path_of, split_paths
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import Sealed, evidence, split
from estimation.diagnosis.story import Story
from estimation.model import Model
from estimation.recording import Recording
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.noise import noise_floors
from rig.diagnosis.propose import propose
from rig.diagnosis.twins import Twins, twins_of
from rig.errors import UsageError
from rig.importers.registry import open_campaign

Stage = Callable[[str], None]

REFERENCE_RIG = ("motor", "gearbox", "cable", "stretch")
"""Shipped models that together declare the reference rig, measured or simulated."""


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what a report needs.

    Attributes:
        diagnosis: The answer.
        stories: Balance to the story behind it.
        recordings: The runs.
        sealed: The split.
        seen: Confirm runs that an earlier look held.
    """

    diagnosis: Diagnosis
    stories: dict[str, Story]
    recordings: tuple[Recording, ...]
    sealed: Sealed
    seen: tuple[str, ...]


def declared_models(
    path: Path | None, balance: str | None, recordings: Sequence[Recording] = ()
) -> list[Model]:
    """Return the declared models to diagnose.

    Args:
        path: A model file or the name of a shipped one; when None, the joints of an arm where the
            recordings hold one, else the balances of the reference rig.
        balance: Only this balance.
        recordings: What is diagnosed.

    Raises:
        UsageError: No model of that balance.
        ModelFileError: The file cannot be read.
    """
    arm = balances_of(recordings[0]) if recordings else None
    if path is not None:
        models = [model_file.read(path)]
    elif arm is not None:
        models = [*arm.models]
    else:
        models = [model_file.read(Path(name)) for name in REFERENCE_RIG]
    chosen = [model for model in models if balance in (None, model.balance)]
    if not chosen:
        known = ", ".join(dict.fromkeys(model.balance for model in models))
        raise UsageError(
            f"There is no declared model of the balance {balance!r}.",
            f"Declared: {known}.",
            "Name a model file with --model.",
        )
    return chosen


def run_diagnosis(
    path: Path,
    models: list[Model] | None,
    ledger: Ledger,
    *,
    balance: str | None = None,
    seed: int = 0,
    format_name: str | None = None,
    executor: Executor | None = None,
    quick: bool = False,
    on_stage: Stage = lambda _: None,
) -> Diagnosed:
    """Diagnose declared models on the recordings of a path.

    Args:
        path: File, folder or archive of recordings.
        models: Declared models, one a balance; those of what the recordings hold when None.
        ledger: Remembers the look.
        balance: Only this balance, where no models are given.
        seed: Seed of the split and of everything random.
        format_name: Importer to use; guessed when None.
        executor: Runs work in parallel.
        quick: A first answer, held against surrogates only, without simulated twins.
        on_stage: Told what begins.

    Raises:
        UsageError: The path does not exist.
        DataError: It cannot be read.
        EstimationError: Nothing can be decided; says why.
    """
    on_stage("reading the recordings")
    whole, lost = steady(evidence(open_campaign(path, format_name)))
    for reason in lost:
        on_stage(reason)
    known = ledger.known(whole)
    if len(whole) == PATHS:
        recordings, sealed = split_paths(whole, seed, known)
    else:
        recordings, sealed = whole, split(whole, seed, known)
    seen = tuple(name for name in sealed.confirm if path_of(name) in known)
    models = declared_models(None, balance, recordings) if models is None else models
    discover = [r for r in recordings if r.name in sealed.discover]
    arm = balances_of(recordings[0])
    on_stage("building the simulated twin of the declared models")
    if arm is None:
        twins = twins_of(models, discover)
    else:
        fitted = shared_fit(arm, discover)
        recordings = with_links(arm, recordings, fitted)
        twin = ArmTwin.of(arm, [r for r in recordings if r.name in sealed.discover], fitted)
        twins = Twins(None, dict.fromkeys((m.balance for m in models), lambda *_: twin))
    diagnosis, stories = diagnose(
        recordings,
        models,
        sealed,
        executor=executor,
        twins=None if quick else twins.makers,
        on_stage=on_stage,
        on_open=lambda: ledger.write(whole, sealed),
    )
    notes = (*lost, *diagnosis.notes)
    if len(whole) == PATHS:
        notes = (claim(sealed), *notes)
    if twins.note:
        notes = (*notes, twins.note)
    if seen:
        notes = (*notes, f"Exploratory: seen by an earlier diagnosis: {', '.join(seen)}.")
    on_stage("looking for the experiment that tells rivals apart")
    diagnosis = replace(
        diagnosis,
        exploratory=bool(seen),
        notes=notes,
        noise_floor=noise_floors(stories, recordings),
        next_experiment=propose(diagnosis, stories, recordings, twins.twin),
    )
    return Diagnosed(diagnosis, stories, tuple(recordings), sealed, seen)
