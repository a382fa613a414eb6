"""The calibration store: a folder where records are only ever added.

`records/` holds one JSON file a record, its hash in its name. `active/` holds one numbered file
each time somebody chose a record; the last choice of a kind, channel and instrument is the active
one. A file is written under a temporary name, synced, and linked to its own: the link fails where
the name is taken, so nothing is overwritten even by two people at once.
"""

import itertools
import json
import os
import re
import tempfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from calibration.errors import CalibrationError, UnknownNameError
from calibration.linear import CalibrationSet
from calibration.record import LINE, CalibrationRecord
from estimation.files import sync_folder


class StoreError(CalibrationError):
    """The store is damaged, or has no such record."""


class NoRecordError(StoreError, UnknownNameError):
    """No record, or more than one, is of that name."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One choice of an active record.

    Attributes:
        at: When it was chosen, ISO 8601.
    """

    record: str
    at: str
    by: str


def own_folder() -> Path:
    """Return the folder of a person's configurations: `$XDG_CONFIG_HOME/rig` or `~/.config/rig`."""
    base = os.environ.get("XDG_CONFIG_HOME")
    return (Path(base) if base else Path.home() / ".config") / "rig"


def default_folder() -> Path:
    """Return the store's folder: `$RIG_CALIBRATIONS`, else `calibrations` in a person's own."""
    named = os.environ.get("RIG_CALIBRATIONS")
    return Path(named) if named else own_folder() / "calibrations"


def simulated_folder(folder: Path) -> Path:
    """Return the separate folder of a simulated rig's calibrations, next to the real ones."""
    return folder.with_name(f"{folder.name}-simulated")


class CalibrationStore:
    """Records and choices in a folder, which is made at the first record."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, record: CalibrationRecord) -> str:
        """Keep a record and return its hash; adding the same one again changes nothing."""
        day = f"{record.made:%Y-%m-%d}"
        name = f"{day}-{record.kind}-{record.channel}-{record.content_hash}.json"
        path = self.folder / "records" / name
        if not _create(path, record.to_json()):
            self.get(record.content_hash)  # the same content is there already, and whole
        return record.content_hash

    def records(self) -> list[CalibrationRecord]:
        """Return every record, oldest first.

        Raises:
            StoreError: The content of a record does not match its name.
        """
        found = [_read(path) for path in sorted((self.folder / "records").glob("*.json"))]
        return sorted(found, key=lambda record: (record.made, record.content_hash))

    def get(self, start: str) -> CalibrationRecord:
        """Return the record whose hash begins with `start`.

        Raises:
            NoRecordError: None or several do.
            StoreError: It is damaged.
        """
        if not re.fullmatch(r"[0-9a-f]{1,16}", start):
            raise NoRecordError(
                f"{start!r} is not the beginning of a hash.", fix="Type rig calibrate list."
            )
        paths = sorted((self.folder / "records").glob(f"*-{start}*.json"))
        paths = [path for path in paths if path.stem.rpartition("-")[2].startswith(start)]
        if len(paths) != 1:
            names = ", ".join(path.stem for path in paths)
            raise NoRecordError(
                f"{len(paths)} records begin with {start!r}."
                if paths
                else f"No record begins with {start!r}.",
                names or f"The store is {self.folder}.",
                "Type `rig calibrate list` for the hashes.",
            )
        return _read(paths[0])

    def use(self, start: str, at: str, by: str) -> CalibrationRecord:
        """Make a record, named by the beginning of its hash, the active one.

        It is that of its kind, channel and instrument. `at` is in ISO 8601.
        """
        record = self.get(start)
        text = json.dumps(asdict(Choice(record.content_hash, at, by)), indent=1) + "\n"
        last = max((int(path.stem) for path in self._choice_paths()), default=0)
        for number in itertools.count(last + 1):
            if _create(self.folder / "active" / f"{number:06d}.json", text):
                return record
        raise AssertionError("unreachable: the numbers do not end")  # pragma: no cover

    def choices(self) -> list[Choice]:
        """Return every choice ever made, oldest first."""
        return [_read_choice(path) for path in self._choice_paths()]

    def active(self) -> dict[tuple[str, str, str], CalibrationRecord]:
        """Return the active record of every kind, channel and instrument."""
        by_key = {}
        for choice in self.choices():
            record = self.get(choice.record)
            by_key[record.key] = record
        return by_key

    def _choice_paths(self) -> list[Path]:
        return sorted((self.folder / "active").glob("[0-9]*.json"), key=lambda p: int(p.stem))


def active_lines(
    store: CalibrationStore, instrument: str | None = None
) -> dict[str, CalibrationRecord]:
    """Return the line that a session takes for each channel which has an active one.

    A record for this instrument, a serial number, goes before one for any; among kinds the newest
    record wins.
    """
    lines = [one for one in store.active().values() if one.fit.form == LINE]
    ours = [one for one in lines if one.instrument in ("", instrument)]

    def best(channel: str) -> CalibrationRecord:
        own = (one for one in ours if one.channel == channel)
        return max(own, key=lambda one: (bool(one.instrument), one.made, one.content_hash))

    return {channel: best(channel) for channel in dict.fromkeys(one.channel for one in ours)}


def compose(base: CalibrationSet, records: Iterable[CalibrationRecord]) -> CalibrationSet:
    """Return a set in which records replace the base's lines; the same set where there are none.

    The base covers every channel of the rig; the records are lines, one per channel.

    Raises:
        CalibrationError: A record reads another raw field than the base's line of that channel.
    """
    lines = {record.channel: record.line() for record in records}
    if not lines:
        return base
    for name, line in lines.items():
        known = base.channels.get(name)
        if known is None or known.counts != line.counts:
            has = f"reads {known.counts!r}" if known else "does not exist"
            raise CalibrationError(
                f"A record gives {name} from {line.counts!r}.",
                f"In the set {base.name!r} that channel {has}.",
                "Choose another record with `rig calibrate use`.",
            )
    return CalibrationSet(f"{base.name}+store", {**base.channels, **lines})


def _read(path: Path) -> CalibrationRecord:
    try:
        record = CalibrationRecord.from_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, CalibrationError) as error:
        raise StoreError(f"The record {path} cannot be read.", str(error)) from error
    if record.content_hash != path.stem.rpartition("-")[2]:
        raise StoreError(
            f"The record {path.name} was changed after it was made.",
            f"Its content has the hash {record.content_hash}.",
            "Restore the file from a backup, or move it out of the store.",
        )
    return record


def _read_choice(path: Path) -> Choice:
    try:
        return Choice(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise StoreError(f"The choice {path} cannot be read.", str(error)) from error


def _create(path: Path, text: str) -> bool:
    """Create a file whole, or not at all; return False where the name is taken."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".new-", dir=path.parent)
        part = Path(name)
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            part.chmod(0o444)
            path.hardlink_to(part)
        finally:
            part.unlink(missing_ok=True)
        sync_folder(path.parent)
    except FileExistsError:
        return False
    except OSError as error:
        raise StoreError(
            f"{path} cannot be written.",
            str(error),
            "The store needs a folder you may write, on a file system with hard links.",
        ) from error
    return True
