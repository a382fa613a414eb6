"""`rig campaigns --diagnose` of several campaigns: each diagnosed once, its page kept."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rig.output.console import emit_json, progress, results

if TYPE_CHECKING:
    from rig.campaigns.index import IndexedCampaign
    from rig.reports.diagnosed import FolderDiagnosis


def show_diagnoses(
    found: Sequence["IndexedCampaign"],
    root: Path,
    workers: int,
    scheduler: str | None,
    json: bool,
) -> None:
    """Diagnose campaigns, without next experiments, and print what each lacks, oldest first.

    Raises:
        LedgerError: The access log cannot be read or written.
        UsageError: No scheduler answers.
    """
    from functools import partial

    from rig.diagnosis.ledger import default_ledger
    from rig.diagnosis.work import engine
    from rig.reports.diagnosed import diagnose_all

    folders = [one.folder for one in reversed(found)]  # the newest come first
    new: list[Path] = []
    with progress() as bar:
        task = bar.add_task("campaigns", total=len(folders))

        def count(folder: Path, _: "FolderDiagnosis") -> None:
            new.append(folder)
            bar.advance(task)

        done = diagnose_all(folders, default_ledger(), partial(engine, workers, scheduler), count)
    if json:
        rows = [
            {"folder": folder, "failed": one.failed, "diagnosis": one.result or None}
            for folder, one in done.items()
        ]
        emit_json({"campaigns": rows})
        return
    screen = results(json)
    for folder, one in done.items():
        name = folder.relative_to(root)
        if one.failed:
            screen.print(f"{name}: {one.failed}", markup=False)
        for line in one.sentences:
            screen.print(f"{name}: {line}", markup=False)
    failed = sum(bool(one.failed) for one in done.values())
    screen.print(
        f"{len(new) - failed} campaigns diagnosed, {len(done) - len(new)} had a diagnosis newer"
        f" than their logs, {failed} could not be diagnosed. All: rig campaigns --root {root}"
    )
