"""A diagnosis from a path: read the runs, seal the split, search, confirm, remember the look."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from estimation import model_file
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
from rig.diagnosis.twins import twins_of
from rig.errors import UsageError
from rig.importers.registry import open_campaign

Stage = Callable[[str], None]

REFERENCE_RIG = ("motor", "gearbox", "cable", "stretch")
"""Shipped models that together declare the reference rig, measured or simulated."""

WRIST = ("wrist_grasp", "wrist_pitch", "wrist_yaw")
"""Those that declare the kinematics of a grasper with three degrees of freedom."""


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


def rig_of(path: Path, format_name: str | None = None) -> tuple[str, ...]:
    """Return the shipped models of the rig that a path's recordings are of, told by its channels.

    Args:
        path: File, folder or archive of recordings.
        format_name: Importer to use; guessed when None.

    Raises:
        UsageError: The path does not exist.
        DataError: It cannot be read.
    """
    first = next(iter(open_campaign(path, format_name).evidence), None)
    wanted = (model_file.read(Path(name)).target for name in WRIST)
    return WRIST if first is not None and set(wanted) <= set(first.columns) else REFERENCE_RIG


def declared_models(
    path: Path | None, balance: str | None, shipped: Sequence[str] = REFERENCE_RIG
) -> list[Model]:
    """Return the declared models to diagnose.

    Args:
        path: A model file or the name of a shipped one; None for the shipped ones of a rig.
        balance: Only this balance.
        shipped: Names of that rig's models.

    Raises:
        UsageError: No model of that balance.
        ModelFileError: The file cannot be read.
    """
    if path is not None:
        models = [model_file.read(path)]
    else:
        models = [model_file.read(Path(name)) for name in shipped]
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
    models: list[Model],
    ledger: Ledger,
    *,
    seed: int = 0,
    format_name: str | None = None,
    executor: Executor | None = None,
    quick: bool = False,
    on_stage: Stage = lambda _: None,
) -> Diagnosed:
    """Diagnose declared models on the recordings of a path.

    Args:
        path: File, folder or archive of recordings.
        models: Declared models, one a balance.
        ledger: Remembers the look.
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
    on_stage("building the simulated twin of the declared models")
    twins = twins_of(models, [r for r in recordings if r.name in sealed.discover])
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
