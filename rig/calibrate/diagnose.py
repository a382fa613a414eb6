"""What a calibration's curve leaves, asked of the same diagnosis as everything else."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from calibration.fsr import FsrCurve
from calibration.fsr_memory import FsrMemory
from calibration.procedure import Measurement
from calibration.record import CalibrationRecord
from calibration.sessions.fsr import SMOOTH, FsrSession
from estimation.diagnosis.diagnose import diagnose
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.recording import Recording
from rig.calibrate.raw import read_raw
from rig.errors import UsageError

CALIBRATED, REFERENCE = "calibrated_n", "reference_n"
BALANCE = "calibration.fsr"


def diagnose_record(
    record: CalibrationRecord, seed: int = 0, on_stage: Callable[[str], None] = lambda _: None
) -> Diagnosis:
    """Return what a record's calibration lacks, on the raw logs it was made from.

    Args:
        record: A calibration of a force-sensing resistor.
        seed: Seed of the split and of everything random.
        on_stage: Told what begins.

    Raises:
        UsageError: The record is of another kind, or its raw logs are gone.
        EstimationError: Nothing can be decided; says why.
    """
    if record.kind != "fsr":
        raise UsageError(
            f"The record {record.content_hash} is of the kind {record.kind}.",
            "Only an fsr record keeps runs in which what is calibrated moves freely.",
            "A torque sensor, a gear or the drive are diagnosed on campaigns: `rig diagnose LOGS`.",
        )
    folders = {Path(file.path).parent for file in record.raw}
    if len(folders) != 1 or not all(Path(file.path).is_file() for file in record.raw):
        raise UsageError(f"The raw logs of {record.content_hash} are not where they were.")
    _, measurements, _ = read_raw(folders.pop())
    recordings = _presses(record, measurements)
    sealed = split(recordings, seed)
    return diagnose(recordings, [declared()], sealed, on_stage=on_stage)[0]


def declared() -> Model:
    """Return the model a calibration declares: the reference is what it gives."""
    terms = (
        Term(effect("motor.torque_constant"), 1, {"source": CALIBRATED}),
        Term(effect("sensor.offset"), 1),
    )
    return Model(
        "fsr",
        BALANCE,
        REFERENCE,
        terms,
        "Reference force from the calibrated force-sensing resistor.",
        SMOOTH,
        run_offsets=False,
        counted="all",
    )


def _presses(record: CalibrationRecord, measurements: Sequence[Measurement]) -> list[Recording]:
    curve, memory = fsr_of(record)
    session = FsrSession()
    made = []
    for run in session.pressed(measurements):
        volts = np.clip(run.fsr_v, curve.low_v, curve.high_v)
        made.append(
            Recording(
                run.name,
                run.time_s - run.time_s[0],
                {CALIBRATED: memory.force_n(curve, run.time_s, volts), REFERENCE: run.force_n},
                rig="force-sensing resistor",
            )
        )
    return made


def fsr_of(record: CalibrationRecord) -> tuple[FsrCurve, FsrMemory]:
    """Return the curve and the memory an fsr record holds."""
    values = record.fit.parameters
    powers = [name for name in values if name.startswith("c") and name[1:].isdigit()]
    coefficients = tuple(values[f"c{k}"] for k in range(len(powers)))
    low, high = record.validity.low, record.validity.high
    if low is None or high is None:
        raise UsageError(f"The record {record.content_hash} states no range of voltage.")
    memory = FsrMemory(
        gap_n=values.get("loading_gap_n", 0.0), creep_ratio=values.get("creep_ratio", 0.0)
    )
    return FsrCurve(coefficients, low, high), memory
