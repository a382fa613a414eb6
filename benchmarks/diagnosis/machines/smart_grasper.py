"""A motorised surgical smart grasper (University of Washington, ISMR 2021).

Y. Sosnovskaya et al.'s force calibrations of two dates: sweeps of constant PWM 30 to 225 (0 to
400 mA, 8 bits) at one jaw distance, a load cell inside (10 bits), one at the jaw (counts), and an
encoder (pulses). The files have no time: samples are put 10 ms apart. Counts of the jaw's cell are
handed over as 1e-4 N each, the inner cell's as its share of full scale in the place of the torque
at the spindle, a thousand pulses as a radian: only shapes matter here.

Nobody knows the answer. On one sweep a quadratic in PWM has a residual of .56 to 1.5 % of the range
of the jaw's force, a line in the inner cell .87 to 1.5 %.
"""

import csv
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.case import MACHINE, Case, Judgement, Report
from benchmarks.diagnosis.machines.handover import Run, cut, errors, options, write

STEP_S = 0.01
FULL_CURRENT_A = 0.4
TARGET = "jaw_force_n"
MODELS = ("smart_grasper_current", "smart_grasper_cell")
PARTS = {"sweeps": 1, "half sweeps": 2}


def cases(folder: Path) -> Iterator[Case]:
    """Yield one case a hand-over and declared model."""
    sweeps = [sweep for path in sorted(folder.glob("Force_*.csv")) for sweep in read(path)]
    for how, parts in PARTS.items():
        runs = [part for sweep in sweeps for part in _parts(sweep, parts)]
        for model in MODELS:
            yield Case(
                f"{model.replace('_', ' ')}, {how}",
                MACHINE,
                partial(write, runs),
                partial(judge, runs),
                options=options(model),
            )


def read(path: Path) -> list[Run]:
    """Return the sweeps of one file: PWM falls back where the next one begins."""
    with path.open() as lines:
        rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(lines))[1:]])
    _, distance_mm, pwm, inner, jaw, pulses = rows.T
    columns = {
        "motor_current_a": FULL_CURRENT_A * pwm / 255.0,
        "proximal_torque_n_m": inner / 1023.0,
        "motor_angle_rad": -1e-3 * pulses,
        TARGET: 1e-4 * jaw,
    }
    whole = Run(
        path.stem.lower().replace("force_calibration_", "date_"),
        STEP_S * np.arange(float(len(rows))),
        columns,
        {"jaw_distance_m": 1e-3 * float(distance_mm[0]), "date": path.stem[18:28]},
    )
    return cut(whole, [0, *(np.flatnonzero(np.diff(pwm) < 0) + 1).tolist(), len(rows)])


def _parts(run: Run, count: int) -> list[Run]:
    return cut(run, np.linspace(0, run.time_s.size, count + 1).astype(int).tolist())


def judge(runs: Sequence[Run], report: Report) -> Judgement:
    """Return the errors; nobody knows what the model lacks."""
    return Judgement(None, note=errors(runs, TARGET, report).percent())
