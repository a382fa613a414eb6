"""Metadata of a run before and after recording, and their form in a log.

Both are MCAP metadata records: one text per field, each of them JSON, and a checksum, since MCAP
has none there and a flipped bit in a condition would go unnoticed. `rig.run` is written first, so
that a killed recorder does not lose it. `rig.end` is written last; its absence means that the
recorder did not close the file.
"""

import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from estimation.recording import Flag, Instrument, Mark, Stretch
from rig.errors import DataError
from rig.log.schema import CHECKSUM_KEY

CONFIG = "config.json"
"""Attachment of the configuration that a run was recorded with."""
SIMULATED = "simulated"
"""Key of a run's details, true where a converted recording is of a simulated rig."""


@dataclass(frozen=True)
class RunInfo:
    """Metadata at the start of a recording."""

    name: str  # name of the run, unique in its campaign
    rig: str = ""
    instrument: Instrument = field(default_factory=Instrument)
    # constant conditions, SI numbers with the unit in the name, or words
    conditions: Mapping[str, float | str] = field(default_factory=dict)
    notes: str = ""
    # start of the run, ns since the Unix epoch, or None when not known
    started_at_ns: int | None = None
    duration_s: float | None = None  # planned duration, s, or None when open-ended
    # calibration name to content hash
    calibrations: Mapping[str, str] = field(default_factory=dict)
    # sensor zeros taken before the run, name with unit to value
    zeros_before: Mapping[str, float] = field(default_factory=dict)
    source: str = ""  # source of the data, when it was not recorded here
    excluded: str | None = None  # why the run is left out of evidence, or None
    # anything else that JSON can hold, such as the protocol and software versions
    details: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RunEnd:
    """Metadata at the end of a recording."""

    clean: bool = True  # whether the run went as planned to its end
    reason: str = ""  # why it did not, in words; empty when it did
    # topic to the number of samples the recorder should have received
    expected_samples: Mapping[str, int] = field(default_factory=dict)
    # counters of the link, such as `crc_errors` and `lost_frames`
    counters: Mapping[str, int] = field(default_factory=dict)
    # sensor zeros taken after the run, name with unit to value
    zeros_after: Mapping[str, float] = field(default_factory=dict)
    # zero after minus zero before, name with unit to value
    drift: Mapping[str, float] = field(default_factory=dict)
    drift_verdict: str = ""  # verdict on the drift, in words; empty when not judged
    # why the run is left out of evidence, when that was found at its end
    excluded: str | None = None
    details: Mapping[str, Any] = field(default_factory=dict)  # anything else that JSON can hold


Record = RunInfo | RunEnd | Mark | Stretch
KINDS: dict[str, type[Record]] = {
    "rig.run": RunInfo,
    "rig.end": RunEnd,
    "rig.mark": Mark,
    "rig.stretch": Stretch,
}
"""Name of a metadata record to what it holds."""
NAMES = {kind: name for name, kind in KINDS.items()}


def to_metadata(record: Record) -> tuple[str, dict[str, str]]:
    """Return a record as MCAP metadata: its name, and field name to JSON text.

    Raises:
        DataError: A value is not finite or cannot be written as JSON.
    """
    metadata = {}
    for item in fields(record):
        try:
            value = getattr(record, item.name)
            metadata[item.name] = json.dumps(value, allow_nan=False, default=_plain)
        except (TypeError, ValueError) as error:
            raise DataError(
                f"{item.name} of the run cannot be written: {error}.",
                "Metadata holds text, finite numbers, lists and tables of them.",
                "Leave out what is not known instead of writing NaN.",
            ) from None
    return NAMES[type(record)], metadata | {CHECKSUM_KEY: _checksum(metadata)}


def _checksum(metadata: Mapping[str, str]) -> str:
    """Return the CRC-32 of all entries but the checksum itself, eight hexadecimal digits."""
    items = sorted(item for item in metadata.items() if item[0] != CHECKSUM_KEY)
    return f"{zlib.crc32(json.dumps(items).encode()):08x}"


def from_metadata(name: str, metadata: Mapping[str, str]) -> Record:
    """Return the record that `to_metadata` wrote, by its name; unknown fields are ignored.

    Raises:
        DataError: The record does not match its checksum, or a value is of the wrong kind.
    """
    kind = KINDS[name]
    if metadata.get(CHECKSUM_KEY) != _checksum(metadata):
        raise DataError(f"The {kind.__name__} record of the log does not match its checksum.")
    try:
        known = {item.name for item in fields(kind)}
        values = {name: json.loads(text) for name, text in metadata.items() if name in known}
        if "instrument" in values:
            values["instrument"] = Instrument(**values["instrument"])
        if "flag" in values:
            values["flag"] = Flag(values["flag"])
        record = kind(**values)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"The {kind.__name__} record of the log is damaged: {error}.",
            fix="Run `rig log check` on the file.",
        ) from None
    _check_types(record)
    return record


def _check_types(record: Record) -> None:
    """Refuse a value whose kind differs from the field's default."""
    for item in fields(record):
        value = getattr(record, item.name)
        wanted: type = type(item.default)
        if callable(item.default_factory):
            wanted = type(item.default_factory())
        if wanted in (dict, str, bool, Instrument) and not isinstance(value, wanted):
            raise DataError(
                f"{item.name} in the log's metadata is {value!r}, not a {wanted.__name__}."
            )


def _plain(value: Any) -> Any:
    """Return as plain types what JSON does not know."""
    if isinstance(value, Instrument):
        return asdict(value)
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):  # NumPy scalars and arrays
        return value.tolist()
    raise TypeError(f"a {type(value).__name__} is not JSON")
