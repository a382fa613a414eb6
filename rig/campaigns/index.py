"""An index of the recorded runs under a folder, kept in SQLite and made from the logs alone.

Each folder of logs is read again when the name, size or date of one of its files changed. The index
holds nothing that the logs do not: deleted or damaged, it is built again.
"""

import hashlib
import json
import os
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

LAYOUT = 2
"""Version of the tables; an index of another one is built again."""

ENDINGS = (".mcap", ".mcap.part")
DIAGNOSIS = Path("diagnosis") / "diagnosis.json"
"""Where a campaign's folder holds its latest diagnosis."""

CALIBRATION = "calibration of"
"""How the protocol of a calibration's raw logs begins."""

TABLES = f"""
PRAGMA user_version = {LAYOUT};
CREATE TABLE folders (folder TEXT PRIMARY KEY, signature TEXT, diagnosis TEXT);
CREATE TABLE runs (folder TEXT, run TEXT);
CREATE INDEX of_folder ON runs (folder);
"""


@dataclass(frozen=True)
class IndexedRun:
    """What the index holds of one run.

    Attributes:
        file: Name of the log.
        name: Name of the run.
        rig: Name of the rig.
        instrument: Identity of the instrument in words.
        date: When it was started, ISO 8601, UTC; empty if not recorded.
        protocol: Name of the protocol, or the calibration whose raw log it is.
        conditions: Name with unit to value.
        notes: Operator's notes.
        state: `complete`, or what is wrong with the log.
        samples: Samples in the log.
        lost: Samples expected and not in the log.
        duration_s: Planned duration, s, or None.
        excluded: Why the run does not count as evidence; empty if it does.
    """

    file: str
    name: str
    rig: str
    instrument: str
    date: str
    protocol: str
    conditions: Mapping[str, float | str]
    notes: str
    state: str
    samples: int
    lost: int
    duration_s: float | None
    excluded: str


@dataclass(frozen=True)
class IndexedCampaign:
    """A folder of logs.

    Attributes:
        folder: The folder.
        runs: Its runs; of several attempts at a run the one that counts.
        diagnosis: Its latest diagnosis, an object of `rig.diagnosis/1`, or None.
    """

    folder: Path
    runs: tuple[IndexedRun, ...]
    diagnosis: Mapping[str, Any] | None

    @property
    def is_calibration(self) -> bool:
        """Whether these are the raw logs of a calibration."""
        return any(run.protocol.startswith(CALIBRATION) for run in self.runs)


def default_index(root: Path) -> Path:
    """Return the index file of a folder of campaigns, in the person's cache."""
    base = os.environ.get("XDG_CACHE_HOME")
    cache = Path(base) if base else Path.home() / ".cache"
    key = hashlib.sha256(str(root.resolve()).encode()).hexdigest()[:16]
    return cache / "rig" / f"campaigns-{key}.sqlite"


def campaigns(
    root: Path,
    index: Path,
    rebuild: bool = False,
    on_folder: Callable[[Path], None] = lambda _: None,
) -> list[IndexedCampaign]:
    """Bring the index up to date and return its campaigns, the newest first.

    Args:
        root: Folder of the campaigns, searched at any depth.
        index: File of the index.
        rebuild: Read every log again.
        on_folder: Called with each folder that is read.

    Where the index cannot be written, it is made for this call alone, in memory.
    """
    with suppress(OSError):
        index.parent.mkdir(parents=True, exist_ok=True)
    if not os.access(index if index.exists() else index.parent, os.W_OK):
        return _up_to_date(root, Path(":memory:"), on_folder)
    if rebuild:
        index.unlink(missing_ok=True)
    try:
        return _up_to_date(root, index, on_folder)
    except sqlite3.DatabaseError:
        index.unlink(missing_ok=True)
        return _up_to_date(root, index, on_folder)


def _up_to_date(
    root: Path, index: Path, on_folder: Callable[[Path], None]
) -> list[IndexedCampaign]:
    with closing(sqlite3.connect(index)) as base, base:
        (layout,) = base.execute("PRAGMA user_version").fetchone()
        if layout != LAYOUT:
            base.executescript("DROP TABLE IF EXISTS folders; DROP TABLE IF EXISTS runs;" + TABLES)
        known = dict(base.execute("SELECT folder, signature FROM folders"))
        there = {str(folder): found for folder, found in _folders(root)}
        for folder in known.keys() - there.keys():
            _forget(base, folder)
        for folder, found in there.items():
            if known.get(folder) != found.signature:
                on_folder(Path(folder))
                _forget(base, folder)
                _learn(base, Path(folder), found)
        return _read(base)


@dataclass(frozen=True)
class _Found:
    logs: tuple[Path, ...]
    signature: str


def _folders(root: Path) -> Iterator[tuple[Path, _Found]]:
    """Yield every folder with logs, from a folder downwards, and a digest of each one's state."""
    waiting = [root]
    while waiting:
        folder = waiting.pop()
        logs, state = [], hashlib.sha256()
        with os.scandir(folder) as entries:
            for entry in sorted(entries, key=lambda e: e.name):
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(folder / entry.name)
                elif entry.name.endswith(ENDINGS):
                    stat = entry.stat()
                    logs.append(entry.name)
                    state.update(f"{entry.name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
        if logs:
            with suppress(FileNotFoundError):
                stat = (folder / DIAGNOSIS).stat()
                state.update(f"{stat.st_size} {stat.st_mtime_ns}".encode())
            yield folder, _Found(tuple(folder / name for name in logs), state.hexdigest())


def _forget(base: sqlite3.Connection, folder: str) -> None:
    base.execute("DELETE FROM folders WHERE folder = ?", (folder,))
    base.execute("DELETE FROM runs WHERE folder = ?", (folder,))


def _learn(base: sqlite3.Connection, folder: Path, found: _Found) -> None:
    """Read the logs of a folder and its diagnosis into the index."""
    # loaded when a log is read: a search alone needs no arrays and starts faster without them
    from rig.campaigns.reading import runs_in

    base.execute(
        "INSERT INTO folders VALUES (?, ?, ?)",
        (str(folder), found.signature, _diagnosis(folder / DIAGNOSIS)),
    )
    texts = [(str(folder), json.dumps(asdict(run))) for run in runs_in(found.logs)]
    base.executemany("INSERT INTO runs VALUES (?, ?)", texts)


def _diagnosis(path: Path) -> str | None:
    """Return the text of a diagnosis, or None where there is none that can be read."""
    try:
        text = path.read_text()
        return text if str(json.loads(text)["schema"]).startswith("rig.diagnosis/") else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _read(base: sqlite3.Connection) -> list[IndexedCampaign]:
    runs: dict[str, list[IndexedRun]] = {}
    for folder, text in base.execute("SELECT folder, run FROM runs"):
        runs.setdefault(folder, []).append(IndexedRun(**json.loads(text)))
    found = [
        IndexedCampaign(
            Path(folder),
            tuple(sorted(runs.get(folder, []), key=lambda run: (run.date, run.file))),
            json.loads(diagnosis) if diagnosis else None,
        )
        for folder, diagnosis in base.execute("SELECT folder, diagnosis FROM folders")
    ]
    return sorted(found, key=lambda c: (c.runs[0].date if c.runs else "", str(c.folder)))[::-1]
