"""An index of the recorded runs under a folder, kept as a JSON file and made from the logs alone.

Each folder of logs is read again when the name, size or date of one of its files changed. The index
holds nothing that the logs do not: deleted or damaged, it is built again.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rig.configuration.folders import cache_folder

LAYOUT = 3
"""Version of the index; one of another version is built again."""

ENDINGS = (".mcap", ".mcap.part")
DIAGNOSIS = Path("diagnosis") / "diagnosis.json"
"""Where a campaign's folder holds its latest diagnosis."""

CALIBRATION = "calibration of"
"""How the protocol of a calibration's raw logs begins."""


@dataclass(frozen=True)
class IndexedRun:
    """What the index holds of one run."""

    file: str
    name: str
    rig: str
    instrument: str  # identity of the instrument in words
    date: str  # when it was started, ISO 8601, UTC; empty if not recorded
    protocol: str  # name of the protocol, or the calibration whose raw log it is
    conditions: Mapping[str, float | str]  # name with unit to value
    notes: str
    state: str  # `complete`, or what is wrong with the log
    samples: int
    lost: int  # samples expected and not in the log
    duration_s: float | None  # planned duration, s, or None
    excluded: str  # why the run does not count as evidence; empty if it does


@dataclass(frozen=True)
class IndexedCampaign:
    """A folder of logs."""

    folder: Path
    runs: tuple[IndexedRun, ...]  # its runs; of several attempts at a run the one that counts
    # its latest diagnosis, an object of `rig.diagnosis/1`, or None
    diagnosis: Mapping[str, Any] | None

    @property
    def is_calibration(self) -> bool:
        """Whether these are the raw logs of a calibration."""
        return any(run.protocol.startswith(CALIBRATION) for run in self.runs)


def default_index(root: Path) -> Path:
    """Return the index file of a folder of campaigns, in the person's cache."""
    key = hashlib.sha256(str(root.resolve()).encode()).hexdigest()[:16]
    return cache_folder() / f"campaigns-{key}.json"


def campaigns(
    root: Path,
    index: Path,
    rebuild: bool = False,
    on_folder: Callable[[Path], None] = lambda _: None,
) -> list[IndexedCampaign]:
    """Bring the index up to date and return the campaigns below a folder, the newest first.

    With `rebuild` every log is read again; `on_folder` is called with each folder that is read.
    Where the index cannot be written, it is made for this call alone.
    """
    known = {} if rebuild else _read(index)
    now: dict[str, Any] = {}
    for folder, logs, signature in _folders(root):
        entry = known.get(str(folder))
        if entry is None or entry["signature"] != signature:
            on_folder(folder)
            entry = {"signature": signature, **_learnt(folder, logs)}
        now[str(folder)] = entry
    if now != known:
        with suppress(OSError):
            index.parent.mkdir(parents=True, exist_ok=True)
            part = index.with_name(f".{index.name}.{os.getpid()}.part")
            part.write_text(json.dumps({"layout": LAYOUT, "folders": now}))
            part.replace(index)
    listed = [_campaign(Path(folder), entry) for folder, entry in now.items()]
    return sorted(listed, key=lambda c: (c.runs[0].date if c.runs else "", str(c.folder)))[::-1]


def _read(index: Path) -> dict[str, Any]:
    """Return the entry of each folder in an index; none of one that is damaged or not there."""
    try:
        content = json.loads(index.read_bytes())
        return dict(content["folders"]) if content["layout"] == LAYOUT else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _campaign(folder: Path, entry: Mapping[str, Any]) -> IndexedCampaign:
    runs = (IndexedRun(**run) for run in entry["runs"])
    ordered = tuple(sorted(runs, key=lambda run: (run.date, run.file)))
    return IndexedCampaign(folder, ordered, entry["diagnosis"])


def _folders(root: Path) -> Iterator[tuple[Path, list[Path], str]]:
    """Yield every folder with logs, from a folder downwards, its logs and a digest of its state."""
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
                    logs.append(folder / entry.name)
                    state.update(f"{entry.name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
        if logs:
            with suppress(FileNotFoundError):
                stat = (folder / DIAGNOSIS).stat()
                state.update(f"{stat.st_size} {stat.st_mtime_ns}".encode())
            yield folder, logs, state.hexdigest()


def _learnt(folder: Path, logs: Sequence[Path]) -> dict[str, Any]:
    # loaded when a log is read: a search alone needs no arrays and starts faster without them
    from rig.campaigns.reading import runs_in

    runs = [asdict(run) for run in runs_in(logs)]
    return {"diagnosis": _diagnosis(folder / DIAGNOSIS), "runs": runs}


def _diagnosis(path: Path) -> Any:
    try:
        content = json.loads(path.read_text())
        return content if str(content["schema"]).startswith("rig.diagnosis/") else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
