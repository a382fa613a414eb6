"""Which calibration a record or a folder of raw logs is, for the diagnosis."""

from pathlib import Path

from calibration.procedure import Measurement, Procedure, Result
from calibration.record import CalibrationRecord
from calibration.sessions.current import CurrentSession
from calibration.sessions.encoder import EncoderSession
from calibration.sessions.fsr import FsrSession
from calibration.sessions.ft import FtSession
from calibration.sessions.gearbox import GearboxSession
from calibration.sessions.torque import TorqueSession
from rig.calibrate.declared import MAKERS, Declared, declared_by
from rig.calibrate.raw import KIND, read_raw
from rig.errors import UsageError
from rig.log.check import looks_like_log
from rig.log.reader import read_log


def declared_by_record(record: CalibrationRecord) -> Declared:
    """Return the declared equation of a record, and the runs it was made from.

    Raises:
        UsageError: Its kind cannot be diagnosed, or its raw logs are gone.
    """
    folders = {Path(file.path).parent for file in record.raw}
    if len(folders) != 1 or not all(Path(file.path).is_file() for file in record.raw):
        raise UsageError(
            f"The raw logs of {record.content_hash} are not where they were.",
            "Only a session of `rig calibrate` keeps them; a certificate has none.",
            f"Kinds that can be diagnosed: {', '.join(MAKERS)}.",
        )
    kind, measurements, _ = read_raw(folders.pop())
    low, high = record.validity.low, record.validity.high
    return declared_by(
        kind, Result(record.channel, record.input, record.fit, low, high), measurements
    )


def declared_by_folder(folder: Path) -> Declared:
    """Return the declared equation of the simplest calibration from raw logs, and its runs.

    Plain is the force-sensing resistor's curve, the gear's stiffness, the encoder's line: what a
    session may add to these is then what the diagnosis finds.

    Raises:
        UsageError: The folder holds no raw logs of one calibration.
        BadDataError: They cannot carry a calibration.
    """
    kind, measurements, lines = read_raw(folder)
    first = _plain(kind, measurements).conclude(measurements, lines).results
    # an encoder's periodic error is in the second result, the comparison with the other encoder
    return declared_by(kind, first[-1] if kind == "encoder" else first[0], measurements)


def is_raw(path: Path) -> bool:
    """Return whether a path is a folder of raw logs that `rig calibrate` left."""
    if not path.is_dir():
        return False
    first = next(iter(sorted(path.glob("*.mcap"))), None)
    if first is None or not looks_like_log(first):
        return False
    run = read_log(first, topics=(), tolerant=True, checksums=False).run
    return run is not None and KIND in run.details


def _plain(kind: str, measurements: list[Measurement]) -> Procedure:
    said = {name: v for m in measurements for name, v in m.recording.conditions.items()}
    known: dict[str, Procedure] = {
        "torque": TorqueSession(sensor=str(said.get("sensor", "proximal"))),
        "current": CurrentSession(),
        "gearbox": GearboxSession(stiffness_only=True),
        "encoder": EncoderSession(encoder=str(said.get("encoder", "spindle")), line_only=True),
        "ft": FtSession(),
        "fsr": FsrSession(curve_only=True),
    }
    if kind not in known:
        raise UsageError(
            f"Unknown kind of calibration: {kind}.",
            f"Known: {', '.join(known)}.",
        )
    return known[kind]
