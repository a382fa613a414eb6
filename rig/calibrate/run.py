"""A whole calibration: measure, conclude, and only then keep the raw logs and the records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calibration.linear import CalibrationSet
from calibration.procedure import Conclusion, Measurement, Procedure
from calibration.record import CalibrationRecord, RawFile, Validity
from calibration.store import CalibrationStore
from rig import __version__
from rig.calibrate.raw import whole_folder, write_raw
from rig.output.figures import scattered
from rig.output.provenance import now_utc


@dataclass(frozen=True, kw_only=True)
class Signature:
    """The text fields of a record."""

    operator: str  # who made it
    days: float | None = None  # days after which it is stale; None if never
    instrument: str = ""  # serial number of the instrument it holds for; empty for any
    serials: Mapping[str, str]
    notes: str = ""


@dataclass(frozen=True, eq=False)
class Kept:
    """A calibration that was kept: its records by hash, the folder of its raw logs."""

    records: dict[str, CalibrationRecord]
    folder: Path
    conclusion: Conclusion


def keep(
    procedure: Procedure,
    measurements: Sequence[Measurement],
    lines: CalibrationSet,
    signature: Signature,
    store: CalibrationStore,
    folder: Path,
) -> Kept:
    """Conclude, then write the raw logs and add the records; nothing is left where that fails.

    Raises:
        BadDataError: The measurements cannot carry a calibration; nothing was written.
        UsageError: The folder is there already.
    """
    conclusion = procedure.conclude(measurements, lines)
    left = conclusion.residuals
    figure = scattered(left.series, left.label, left.unit, f"Residuals over {left.label}")
    made_at = now_utc()
    with whole_folder(folder) as part:
        files = [RawFile.of(path) for path in write_raw(part, procedure.kind, measurements, lines)]
    # the folder has its name now, and the records name the files in it
    raw = tuple(replace(f, path=str(folder.resolve() / Path(f.path).name)) for f in files)
    said = "; ".join(f"{name}: {value}" for name, value in conclusion.found.items())
    details = measurements[0].details
    records = [
        CalibrationRecord(
            kind=procedure.kind,
            channel=result.channel,
            input=result.input,
            made_at=made_at,
            operator=signature.operator,
            fit=result.fit,
            validity=Validity(result.low, result.high, signature.days),
            instrument=signature.instrument,
            serials=signature.serials,
            firmware_hash=str(details.get("firmware_build", "")),
            raw=raw,
            code_version=__version__,
            tared=result.tared,
            figure_svg=figure,
            notes="; ".join(part for part in (said, signature.notes) if part),
        )
        for result in conclusion.results
    ]
    return Kept({store.add(record): record for record in records}, folder, conclusion)
