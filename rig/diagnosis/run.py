"""A diagnosis of a campaign: read the runs, split them, search, and open the test runs.

The caller writes the requested files, then calls `remember`, then shows the result: the held-out
runs count as used once there is a result to see, and not before.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from estimation.arm.balances import balances_of
from estimation.arm.shared import laid_out
from estimation.campaign import Campaign
from estimation.causes.equations import on_one_clock
from estimation.causes.verdict import Answer, answer
from estimation.diagnosis.audit import steady
from estimation.diagnosis.paths import PATHS, claim, path_of, split_few, split_paths
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import Sealed, evidence
from estimation.model import Model
from estimation.recording import Recording
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.noise import noise_floors
from rig.diagnosis.propose import propose

Stage = Callable[[str], None]


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis with what a report needs.

    Attributes:
        diagnosis: The result.
        answer: The equations, hypotheses and models behind it.
        recordings: The runs, with the campaign's time.
        sealed: The split.
        seen: Test runs that an earlier diagnosis used.
        looked_at: All runs as they were read, for the access log.
    """

    diagnosis: Diagnosis
    answer: Answer
    recordings: tuple[Recording, ...]
    sealed: Sealed
    seen: tuple[str, ...]
    looked_at: tuple[Recording, ...]


def remember(done: Diagnosed, ledger: Ledger) -> None:
    """Write the runs of a diagnosis into the access log: a later one on them is exploratory.

    Raises:
        LedgerError: The log cannot be read or written.
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
        models: Declared models, one an equation.
        ledger: Log of the runs that earlier diagnoses used; it is not written here.
        seed: Seed of the split and of intervals.
        executor: Plays the experiments that may be proposed in parallel.
        quick: Propose no next experiment.
        on_stage: Called with what begins, in words.

    Raises:
        LedgerError: The log cannot be read or written.
        DataError: A recording cannot be read.
        EstimationError: Nothing can be decided; the reason is in the message.
    """
    ledger.check()
    on_stage("reading the recordings")
    whole, lost = steady(evidence(campaign))
    for reason in lost:
        on_stage(reason)
    known = ledger.known(whole)
    choose = split_paths if len(whole) == PATHS else split_few
    recordings, sealed = choose(whole, seed, known)
    seen = tuple(name for name in sealed.confirm if path_of(name) in known)
    of_arm = any(model.balance.startswith("joint.") for model in models)
    arm = balances_of(recordings[0]) if of_arm else None
    if arm is not None:
        on_stage("fitting the links that all joints share")
        recordings = laid_out(arm, recordings, sealed.discover)
    recordings = on_one_clock(recordings)
    found = answer(recordings, models, sealed, on_stage=on_stage)
    proposed = None
    if not quick:
        on_stage("choosing the experiment that separates the alternatives")
        proposed = propose(found, recordings, executor)
    notes = [*lost, *found.diagnosis.notes]
    if limit := claim(sealed):
        notes.insert(0, limit)
    if seen:
        notes.append(f"Exploratory: used by an earlier diagnosis: {', '.join(seen)}.")
    diagnosis = replace(
        found.diagnosis,
        exploratory=bool(seen),
        notes=tuple(notes),
        noise_floor=noise_floors(found.refits, recordings),
        next_experiment=proposed,
    )
    return Diagnosed(diagnosis, found, tuple(recordings), sealed, seen, tuple(whole))
