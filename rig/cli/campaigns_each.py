"""`rig campaigns --diagnose` and `--refit MODEL`: the same work on each campaign found."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from estimation.model_file import read, to_toml
from rig.campaigns.drift import changes
from rig.campaigns.index import IndexedCampaign
from rig.campaigns.refit import Refit, refit_all
from rig.campaigns.work import engine
from rig.diagnosis.ledger import default_ledger
from rig.output.console import counting, present
from rig.output.table import TextTable
from rig.reports.diagnosed import FolderDiagnosis, diagnose_all


def show_diagnoses(
    found: Sequence[IndexedCampaign], root: Path, workers: int, scheduler: str | None, json: bool
) -> None:
    """Diagnose campaigns, without next experiments, and print what each lacks, oldest first."""
    folders = [one.folder for one in reversed(found)]  # the newest come first
    new: list[Path] = []
    with counting("campaigns", len(folders)) as advance:

        def count(folder: Path, _: FolderDiagnosis) -> None:
            new.append(folder)
            advance()

        done = diagnose_all(folders, default_ledger(), partial(engine, workers, scheduler), count)
    rows = [
        {"folder": folder, "failed": one.failed, "diagnosis": one.result or None}
        for folder, one in done.items()
    ]
    said = [
        f"{folder.relative_to(root)}: {line}"
        for folder, one in done.items()
        for line in (*filter(None, [one.failed]), *one.sentences)
    ]
    failed = sum(bool(one.failed) for one in done.values())
    total = (
        f"{len(new) - failed} campaigns diagnosed, {len(done) - len(new)} had a diagnosis newer"
        f" than their logs, {failed} could not be diagnosed. All: rig campaigns --root {root}"
    )
    present(json, {"campaigns": rows}, *said, total)


def show_refit(
    found: Sequence[IndexedCampaign],
    root: Path,
    model: str,
    workers: int,
    scheduler: str | None,
    json: bool,
) -> None:
    """Fit a model on campaigns and print its parameters from the oldest to the newest."""
    declared = to_toml(read(Path(model)))
    dates = {one.folder: one.runs[0].date for one in reversed(found)}  # the newest come first
    with counting("campaigns") as advance:
        fitted = refit_all(list(dates), declared, partial(engine, workers, scheduler), advance)
    good = {folder: fit for folder, fit in fitted.items() if not fit.failed}
    moved = _changes(good, dates, root)
    rows = [{"folder": folder, "date": dates[folder], "fit": one} for folder, one in fitted.items()]
    failed = {folder: one.failed for folder, one in fitted.items() if one.failed}
    present(
        json,
        {"campaigns": rows, "changes": moved},
        *(f"{folder.relative_to(root)}: {why}" for folder, why in failed.items()),
        *([_table(good, moved)] if good else []),
        f"{len(good)} of {len(fitted)} campaigns fitted.",
    )


def _changes(
    good: Mapping[Path, Refit], dates: Mapping[Path, str], root: Path
) -> dict[str, list[dict[str, Any]]]:
    folders = list(good)
    return {
        name: [
            {
                "since": str(folders[one.first].relative_to(root)),
                "date": dates[folders[one.first]],
                "before": one.before,
                "after": one.after,
            }
            for one in moved
        ]
        for name in (next(iter(good.values())).values if good else ())
        if (moved := changes([one.values[name] for one in good.values()]))
    }


def _table(
    good: Mapping[Path, Refit], moved: Mapping[str, Sequence[Mapping[str, Any]]]
) -> TextTable:
    fits = list(good.values())
    rows = []
    for name, unit in fits[0].units.items():
        values = [one.values[name] for one in fits]
        words = "; ".join(
            f"{one['before']:.3g} to {one['after']:.3g} since {one['since']}"
            for one in moved.get(name, [])
        )
        span = f"{min(values):.4g} to {max(values):.4g}"
        rows.append([name, unit, f"{values[0]:.4g}", f"{values[-1]:.4g}", span, words])
    return TextTable("", ["parameter", "unit", "oldest", "newest", "range", "changes"], rows)
