"""Diagnosing published recordings of other people's machines with their machine files."""

import math
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from estimation.campaign import Campaign
from estimation.causes.verdict import Answer
from estimation.errors import EstimationError
from estimation.model import Model
from estimation.recording import Recording
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.subject import Subject
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table, read_runs
from rig.machines.recordings import with_motion
from rig.machines.shipped import equations_of, place_of
from rig.output.provenance import Provenance
from rig.reports.diagnosis_words import advice, sentences
from rig.studies.machines.published import Published, by_direction, standard


@dataclass(frozen=True)
class Case:
    """One machine, or one part of it."""

    name: str
    machine: str  # shipped machine
    # folder of its recordings in the data, or `machine-FOLDER.tar.xz`; also the name of the page
    # that says what is declared, published and suspected
    folder: str
    published: str  # published error, in words
    files: str = ""  # pattern of the files in the folder; all when empty
    equation: str = ""  # only this equation; all when empty
    # condition to the value that a run must have
    only: Mapping[str, float] = field(default_factory=dict)

    def wants(self, recording: Recording) -> bool:
        """Whether a run belongs to the case."""
        return all(
            abs(float(recording.conditions.get(name, float("nan"))) - value) < 1e-3 * value
            for name, value in self.only.items()
        )


_SERVO = "position error in simulation .0309 to .0323 rad, six friction models, parts cut out"
_JOINT = "none for a joint alone"

CASES = (
    Case("EMPS", "emps", "emps", "4.083 % of the force; by direction 3.112 %"),
    Case("smart grasper", "smart_grasper", "smart-grasper", "none stated"),
    Case(
        "STS3215, 1.168 kg at .1 m",
        "sts3215",
        "sts3215",
        _SERVO,
        only={"pendulum_mass_kg": 1.1682, "pendulum_length_m": 0.1},
    ),
    Case(
        "STS3215, .969 kg at .15 m",
        "sts3215",
        "sts3215",
        _SERVO,
        only={"pendulum_mass_kg": 0.969, "pendulum_length_m": 0.15},
    ),
    Case("UR10e, joint 6", "ur10e", "ur10e", _JOINT, "*joint_6.csv", "joint_6"),
    Case("UR10e, joint 1", "ur10e", "ur10e", _JOINT, "*joint_1.csv", "joint_1"),
)


@contextmanager
def unpacked(data: Path, folder: str) -> Iterator[Path | None]:
    """Yield the folder of a machine's recordings, from its archive if need be; None without."""
    archive = data / f"machine-{folder}.tar.xz"
    if (data / folder).is_dir():
        yield data / folder
    elif archive.is_file():
        with tempfile.TemporaryDirectory(prefix="machine-") as place:
            with tarfile.open(archive) as content:
                content.extractall(place, filter="data")
            yield Path(place) / folder
    else:
        yield None


@dataclass(frozen=True)
class Row:
    """One equation of a machine."""

    case: str
    equation: str
    published: str  # published error, in words
    card: str  # page of the machine
    runs: tuple[int, int]  # runs that trained, and that were held out
    # error of the declared model on the held-out runs, % of the root mean square of the target
    # there
    declared_percent: float
    found_percent: float  # the same with the effects that were found
    findings: tuple[str, ...]  # what the diagnosis says of the equation, a sentence each
    checks: tuple[str, ...]  # what a technician would check, one for each named effect


@dataclass(frozen=True)
class MachineStudy:
    """The study."""

    rows: tuple[Row, ...]
    # the published estimates of EMPS made again; empty without its data
    reproduced: tuple[tuple[str, Published], ...]
    # machines without data, and equations that could not be diagnosed, in words
    skipped: tuple[str, ...]
    seconds: float
    provenance: Provenance


def run_study(
    data: Path, seed: int = 0, on_stage: Callable[[str], None] = lambda _: None
) -> MachineStudy:
    """Diagnose every machine that has a folder or an archive of recordings in a folder.

    Raises:
        DataError: Recordings cannot be read as the machine's file states.
    """
    began = time.monotonic()
    rows: list[Row] = []
    skipped: list[str] = []
    reproduced: list[tuple[str, Published]] = []
    for case in CASES:
        with unpacked(data, case.folder) as folder:
            if folder is None:
                skipped.append(f"{case.name}: no recordings in {case.folder}.")
                continue
            on_stage(case.name)
            if case.machine == "emps":
                reproduced += _published(folder)
            try:
                rows += _rows(case, _opened(case, folder), seed)
            except EstimationError as error:
                skipped.append(f"{case.name}: not decided. {error}")
    seconds, made = time.monotonic() - began, Provenance.now(seed)
    return MachineStudy(tuple(rows), tuple(reproduced), tuple(skipped), seconds, made)


def _opened(case: Case, folder: Path) -> Campaign:
    mapping = read_mapping(place_of(Path(case.machine)), ())
    paths = sorted(folder.glob(case.files)) if case.files else [folder]
    runs = [run for path in paths for run in open_table(path, mapping).evidence]
    return Campaign.of([run for run in runs if case.wants(run)])


def _published(folder: Path) -> list[tuple[str, Published]]:
    mapping = read_mapping(place_of(Path("emps")), [(("runs",), {}, "whole files")])
    models = {"standard model": standard, "friction by direction": by_direction}
    runs = read_runs(folder, mapping, [])
    return [(f"{run.name}, {name}", fit(run)) for run in runs for name, fit in models.items()]


def _rows(case: Case, campaign: Campaign, seed: int) -> list[Row]:
    whole = equations_of(Path(case.machine))
    models = [model for model in whole if case.equation in ("", model.balance)]
    campaign = with_motion(campaign, models)
    with tempfile.TemporaryDirectory(prefix="study-") as place:
        looks = Ledger(Path(place) / "looks.jsonl")
        answer, _ = run_diagnosis(Subject(campaign, models), looks, seed=seed, quick=True)
    return [_row(case, model, answer) for model in models if model.balance in answer.refits.of]


def _row(case: Case, model: Model, answer: Answer) -> Row:
    name, found = model.balance, answer.diagnosis
    runs = [answer.refits.of[name].recordings[run] for run in found.sealed.confirm]
    held_out = [run[model.target][run.valid] for run in runs]
    size = math.sqrt(float(np.mean(np.concatenate(held_out) ** 2)))
    error = found.errors[name]
    before, after = (
        (error.before, error.after)
        if model.run_offsets
        else (error.with_means_before, error.with_means_after)
    )
    own = [f for f in found.findings if f.balance == name]
    words = [line for line in sentences(found) if line.startswith(f"{name}:")]
    return Row(
        case=case.name,
        equation=name,
        published=case.published,
        card=case.folder,
        runs=(len(found.sealed.discover), len(found.sealed.confirm)),
        declared_percent=100.0 * before / size,
        found_percent=100.0 * after / size,
        findings=tuple(words) or (f"{name}: no unmodelled effect found.",),
        checks=tuple(f"{f.family}: {text}" for f in own if (text := advice(f.family))),
    )
