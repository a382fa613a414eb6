"""A diagnosis of every campaign found, each kept with its logs as `rig diagnose` keeps it.

A campaign whose diagnosis is newer than its logs is not diagnosed again, so a call that was
interrupted goes on where it stopped.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from rig.campaigns.index import DIAGNOSIS, ENDINGS
from rig.campaigns.work import Start, for_each
from rig.diagnosis.ledger import Ledger, Look
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.subject import subject
from rig.errors import RigError
from rig.reports.diagnosis import page_of
from rig.reports.diagnosis_words import sentences


@dataclass(frozen=True)
class FolderDiagnosis:
    """The diagnosis of a folder."""

    sentences: tuple[str, ...] = ()  # what it found, in words; empty of a kept one
    # the result as JSON; empty where it failed
    result: Mapping[str, Any] = field(default_factory=dict)
    page: str = ""  # the page as HTML; empty where it failed, and of a kept one
    look: Look | None = None  # what the access log has to hold; None of a kept one
    failed: str = ""  # why the campaign could not be diagnosed; empty otherwise


def diagnose_all(
    folders: Sequence[Path],
    ledger: Path,
    start: Start,
    on_done: Callable[[Path, FolderDiagnosis], None] = lambda *_: None,
) -> dict[Path, FolderDiagnosis]:
    """Diagnose each folder's campaign, or take the kept result.

    Page and result are written before the access log, and nothing is returned that it lacks.
    `start` starts what the work is given to: processes, a cluster, or None for this process;
    `on_done` is called with each folder that was diagnosed.

    Raises:
        LedgerError: The access log cannot be read or written.
        BrokenExecutor: Processes end again and again.
        OSError: A result cannot be written.
    """
    looks = Ledger(ledger)
    looks.check()

    def keep(folder: Path, done: FolderDiagnosis) -> None:
        if done.look is not None:
            place = folder / DIAGNOSIS
            write_text_atomic(place.with_suffix(".html"), done.page)
            write_text_atomic(place, json.dumps(done.result, indent=2, allow_nan=False) + "\n")
            looks.enter(done.look)
        on_done(folder, done)

    return for_each(folders, _kept, partial(diagnose_folder, ledger), start, keep)


def diagnose_folder(ledger: Path, folder: Path) -> FolderDiagnosis:
    """Return the diagnosis of a folder's campaign, or why it could not be made."""
    try:
        asked = subject(folder, skip_bad=True)
        done, look = run_diagnosis(asked, Ledger(ledger), quick=True)
    except (EstimationError, RigError) as error:
        return FolderDiagnosis(failed=str(error))
    return FolderDiagnosis(
        tuple(sentences(done.diagnosis)),
        done.diagnosis.to_json(),
        page_of(done, done.diagnosis.sealed.seed),
        look,
    )


def _kept(folder: Path) -> FolderDiagnosis | None:
    place = folder / DIAGNOSIS
    logs = [path for path in folder.iterdir() if path.name.endswith(ENDINGS)]
    try:
        if place.stat().st_mtime_ns < max(path.stat().st_mtime_ns for path in logs):
            return None
        return FolderDiagnosis(result=json.loads(place.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return None
