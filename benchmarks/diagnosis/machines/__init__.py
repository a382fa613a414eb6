"""Machines that other people built: their published recordings, handed over to `rig diagnose`.

The authors' own files are read by the shipped mappings of `rig.machines.examples`, cut and named in
some ways, and handed over as logs with a declared model. No recording is part of this project; the
folder of them is given by path.

- EMPS: a prismatic drive axis (Janot, Gautier, Brunot 2019). The standard model has a residual of
  4.083 % of the force. Its authors found later that viscous friction differs by direction, 166.7
  and 240.4 N s/m; the error is then 3.112 %. A lap is one period of the reference, a half lap goes
  there and back within it. The target has a name of its own, or that of a motor current.
- Smart grasper: sweeps of constant PWM at one jaw distance (Sosnovskaya et al. 2021). Nobody knows
  the answer; on one sweep a quadratic in PWM has a residual of .56 to 1.5 % of the range of the
  jaw's force, a line in the inner cell .87 to 1.5 %.
- STS3215: a servo with a pendulum. Its owners fitted six friction models, .0323 to .0309 rad of
  mean position error, after cutting out stretches by hand; nobody knows the whole answer.
- UR10e: joint 6 moved alone (Mamedov 2020). A quick fit has a residual of 1.1 % of the squared
  current, 6 % of which are the first two harmonics of the angle.
"""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis.case import (
    MACHINE,
    SURE,
    Case,
    Judgement,
    Report,
    write_recordings,
)
from estimation.diagnosis.split import path_of
from estimation.recording import Recording
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import read_runs
from rig.machines.shipped import place_of

MODELS = Path(__file__).parent
ASYMMETRY = "friction.viscous_asymmetry"
WRONG = 0.5
"""Another single name with this confidence or more makes an answer wrong."""


@dataclass(frozen=True)
class HandOver:
    """One way to hand a machine's recordings over.

    Attributes:
        machine: Name of the shipped mapping.
        model: Name of the declared model.
        target: Channel that the model explains.
        changes: Entries of the mapping that differ, by their path below `[data]`.
        renamed: Channel to another name.
        only: Conditions of the runs that are taken.
        known: Family of the effect that is known to be undeclared, or none.
    """

    name: str
    machine: str
    model: str
    target: str
    changes: Mapping[tuple[str, ...], Any] = field(default_factory=dict)
    renamed: Mapping[str, str] = field(default_factory=dict)
    only: Mapping[str, float] = field(default_factory=dict)
    known: str = ""
    note: str = ""


def _emps() -> Iterator[HandOver]:
    laps = {"laps": 6.24, "half laps": 3.12, "whole files": 1e3}
    for how, lap_s in laps.items():
        changes = {("runs", "lap_s"): lap_s, ("runs", "least_s"): 1.0}
        for target, model in (
            ("drive_force_n", "emps"),
            ("motor_current_a", "emps_motor_current_a"),
        ):
            yield HandOver(
                f"emps, {how}, {target}",
                "emps",
                model,
                target,
                changes,
                renamed={"drive_force_n": target},
                known=ASYMMETRY,
                note="published 4.083 -> 3.112 %",
            )


def _smart_grasper() -> Iterator[HandOver]:
    parts: dict[str, dict[tuple[str, ...], Any]] = {
        "sweeps": {},
        "half sweeps": {("runs", "lap_s"): 11.4},
    }
    for how, changes in parts.items():
        for model in ("smart_grasper_current", "smart_grasper_cell"):
            name = f"{model.replace('_', ' ')}, {how}"
            yield HandOver(name, "smart_grasper", model, "jaw_force_ratio", changes)


def _sts3215() -> Iterator[HandOver]:
    for mass_kg, length_m in ((1.1682, 0.1), (0.969, 0.15)):
        only = {"pendulum_mass_kg": mass_kg, "pendulum_length_m": length_m}
        name = f"sts3215, {mass_kg:g} kg at {length_m:g} m"
        yield HandOver(name, "sts3215", "sts3215", "drive_ratio", only=only)


def _ur10e() -> Iterator[HandOver]:
    changes = {("files",): "*-joint_6.csv"}
    note = "quick fit 1.1 % of the squared current"
    yield HandOver("ur10e, joint 6", "ur10e", "ur10e", "joint_6_current_a", changes, note=note)


MACHINES = {
    "emps": _emps,
    "smart-grasper": _smart_grasper,
    "sts3215": _sts3215,
    "ur10e": _ur10e,
}
"""Folder of each machine's recordings, and its hand-overs."""


def cases(path: Path) -> Iterator[Case]:
    """Yield the cases of every machine whose folder is there; the others are named on stderr."""
    for name, hand_overs in MACHINES.items():
        if (path / name).is_dir():
            yield from (case(path / name, hand_over) for hand_over in hand_overs())
        else:
            sys.stderr.write(f"{name} skipped: no folder {path / name}\n")


def case(folder: Path, hand_over: HandOver) -> Case:
    """Return a case of the recordings in a folder."""
    runs = read(folder, hand_over)
    return Case(
        hand_over.name,
        MACHINE,
        partial(write_recordings, recordings=runs),
        partial(judge, runs, hand_over),
        options=["--model", str(MODELS / f"{hand_over.model}.model.toml")],
    )


def read(folder: Path, hand_over: HandOver) -> list[Recording]:
    """Return the runs of a folder as a hand-over cuts and names them."""
    flags = [(path, value, str(value)) for path, value in hand_over.changes.items()]
    mapping = read_mapping(place_of(Path(hand_over.machine)), flags)
    names = hand_over.renamed
    runs = []
    for run in read_runs(folder, mapping, []):
        if all(run.conditions.get(key) == value for key, value in hand_over.only.items()):
            columns = {names.get(name, name): values for name, values in run.columns.items()}
            runs.append(replace(run, columns=columns))
    return runs


def judge(runs: Sequence[Recording], hand_over: HandOver, report: Report) -> Judgement:
    """Judge an answer: a known effect is named, or in the set, and nothing else is surely."""
    note = "; ".join(filter(None, (_errors(runs, hand_over.target, report), hand_over.note)))
    if not hand_over.known:
        return Judgement(None, note=note)
    findings = report["findings"]
    named = any(hand_over.known in (f["family"], *f["alternatives"]) for f in findings)
    others = [
        f["confidence"] or 0.0
        for f in findings
        if f["verdict"] == "identified" and f["family"] != hand_over.known
    ]
    wrong = [confidence for confidence in others if confidence > WRONG]
    sure = any(confidence >= SURE for confidence in wrong)
    return Judgement(named and not wrong, sure, len(others), note=note)


def _errors(runs: Sequence[Recording], target: str, report: Report) -> str:
    """Return the errors of the test runs that an answer states, in percent of the target there."""
    names = {path_of(name) for name in report["runs"]["confirm"]}  # of parts, the whole recordings
    test = [run[target] for run in runs if run.name in names]
    size = math.sqrt(float(np.mean(np.concatenate(test) ** 2)))
    stated = [report[f"rmse_with_means_{when}"].get("motor") for when in ("before", "after")]
    known = [100 * error / size for error in stated if error is not None]
    if len(known) < 2 or math.isnan(sum(known)):  # a test run without a sample in motion
        return "no error stated"
    return f"{known[0]:.2f} -> {known[1]:.2f} %"
