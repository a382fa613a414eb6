"""A diagnosis of a campaign: read the runs, seal the split, search, confirm.

The caller writes the files it was asked for, then calls `remember`, then shows the result: the
held-out runs count as used once there is a result to see, and not before.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from estimation.arm.balances import balances_of
from estimation.arm.twin import laid_out
from estimation.campaign import Campaign
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
from rig.diagnosis.traces import EquationTraces, traces
from rig.diagnosis.twins import Twins, twins_of

Stage = Callable[[str], None]


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what a report needs.

    Attributes:
        diagnosis: The answer.
        stories: Balance to the story behind it.
        recordings: The runs.
        sealed: The split.
        seen: Confirm runs that an earlier look held.
        looked_at: All runs as they were read, for the ledger.
    """

    diagnosis: Diagnosis
    stories: dict[str, Story]
    recordings: tuple[Recording, ...]
    sealed: Sealed
    seen: tuple[str, ...]
    looked_at: tuple[Recording, ...]

    def traces(self) -> dict[str, EquationTraces]:
        """Return the signals of each equation's runs, for a page to draw."""
        return {
            name: traces(self.recordings, self.sealed, story.declared_model, story.model)
            for name, story in self.stories.items()
        }


def remember(done: Diagnosed, ledger: Ledger) -> None:
    """Write the runs of a diagnosis into the ledger: a later one on them is exploratory.

    Raises:
        LedgerError: The ledger cannot be read or written.
    """
    ledger.write(done.looked_at, done.sealed)


def run_diagnosis(
    campaign: Campaign,
    models: Sequence[Model],
    ledger: Ledger,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    quick: bool = False,
    on_stage: Stage = lambda _: None,
) -> Diagnosed:
    """Diagnose declared models on a campaign.

    Args:
        campaign: The recordings.
        models: Declared models, one a balance.
        ledger: Names the runs that earlier diagnoses used; it is not written here.
        seed: Seed of the split and of everything random.
        executor: Runs work in parallel.
        quick: A first answer, held against surrogates only, without simulated twins.
        on_stage: Told what begins.

    Raises:
        LedgerError: The ledger cannot be read or written.
        DataError: A recording cannot be read.
        EstimationError: Nothing can be decided; says why.
    """
    ledger.check()
    on_stage("reading the recordings")
    whole, lost = steady(evidence(campaign))
    for reason in lost:
        on_stage(reason)
    known = ledger.known(whole)
    if len(whole) == PATHS:
        recordings, sealed = split_paths(whole, seed, known)
    else:
        recordings, sealed = whole, split(whole, seed, known)
    seen = tuple(name for name in sealed.confirm if path_of(name) in known)
    arm = balances_of(recordings[0])
    if arm is None:
        on_stage("building the simulated twin of the declared models")
        twins = twins_of(models, [r for r in recordings if r.name in sealed.discover])
    else:
        on_stage("fitting the links that all joints share")
        recordings, twin = laid_out(arm, recordings, sealed.discover)
        twins = Twins(None, dict.fromkeys((m.balance for m in models), lambda *_: twin))
    diagnosis, stories = diagnose(
        recordings,
        models,
        sealed,
        executor=executor,
        twins=None if quick else twins.makers,
        on_stage=on_stage,
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
    return Diagnosed(diagnosis, stories, tuple(recordings), sealed, seen, tuple(whole))
