"""EMPS: a prismatic drive axis with a ball screw, whose undeclared effect its authors found.

A. Janot, M. Gautier, M. Brunot, *Data set and reference models of EMPS*, Workshop on Nonlinear
System Identification Benchmarks, 2019: the standard model (mass, viscous and Coulomb friction,
offset) has a residual of 4.083 % of the force. They found later that viscous friction differs by
direction, 166.7 and 240.4 N s/m; the error is then 3.112 %.

Every file `DATA_EMPS*.mat` is used: `t` (s), `qm` (m), `vir` (V), `gtau` (N/V). A lap is one period
of 6.24 s of the reference; a half lap goes one way and back within it. A millimetre is handed over
as a radian, since thresholds of standstill are in rad/s.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from benchmarks.diagnosis.case import MACHINE, SURE, Case, Judgement, Report
from benchmarks.diagnosis.machines.handover import Run, cut, errors, options, write

LAP = 6240
"""Samples of one period at 1 kHz."""

RAD_PER_M = 1000.0
ASYMMETRY = "friction.viscous_asymmetry"
TARGETS = ("drive_force_n", "motor_current_a")
HAND_OVERS = {"laps": LAP, "half laps": LAP // 2, "whole files": None}
REFERENCE = "published 4.083 -> 3.112 %"
WRONG = 0.5
"""Another single name with this confidence or more makes an answer wrong."""


def cases(folder: Path) -> Iterator[Case]:
    """Yield one case a hand-over and name of the target."""
    for how, samples in HAND_OVERS.items():
        for target in TARGETS:
            runs = read(folder, target, samples)
            yield Case(
                f"emps, {how}, {target}",
                MACHINE,
                partial(write, runs),
                partial(judge, runs, target),
                options=options(f"emps_{target}"),
            )


def read(folder: Path, target: str, samples: int | None) -> list[Run]:
    """Return the runs, each of so many samples; whole files when None."""
    runs = []
    for path in sorted(folder.glob("DATA_EMPS*.mat")):
        data = {k: np.ravel(v).astype(float) for k, v in loadmat(path).items() if k[0] != "_"}
        columns = {
            "motor_angle_rad": RAD_PER_M * data["qm"],
            target: data["gtau"] * data["vir"],
        }
        whole = Run(path.stem.lower(), np.arange(float(data["t"].size)) * 1e-3, columns)
        end = data["t"].size
        at = [0, end] if samples is None else list(range(0, end - samples // 2, samples))
        if samples is not None:
            at.append(min(at[-1] + samples, end))
        runs += cut(whole, at)
    return runs


def judge(runs: Sequence[Run], target: str, report: Report) -> Judgement:
    """Judge an answer: asymmetric viscous friction is named, or in the set, and nothing else is."""
    findings = report["findings"]
    named = any(ASYMMETRY in (f["family"], *f["alternatives"]) for f in findings)
    others = [
        f["confidence"] or 0.0
        for f in findings
        if f["verdict"] == "identified" and f["family"] != ASYMMETRY
    ]
    note = f"{errors(runs, target, report).percent()}; {REFERENCE}"
    wrong = [confidence for confidence in others if confidence > WRONG]
    return Judgement(named and not wrong, any(c >= SURE for c in wrong), len(others), note=note)
