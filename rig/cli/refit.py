"""`rig campaigns --refit MODEL`: one model on each campaign found, and when parameters changed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.output.console import emit_json, progress, results, show_table

if TYPE_CHECKING:
    from rig.campaigns.index import IndexedCampaign
    from rig.diagnosis.refit import Refit
    from rig.output.table import TextTable


def show_refit(
    found: Sequence["IndexedCampaign"],
    root: Path,
    model: str,
    workers: int,
    scheduler: str | None,
    json: bool,
) -> None:
    """Fit a model on campaigns and print its parameters from the oldest to the newest.

    Raises:
        UsageError: The model names an estimator, or no scheduler answers.
        ModelFileError: There is no such model.
    """
    from functools import partial

    from estimation.model_file import read, to_toml
    from rig.diagnosis.refit import refit_all
    from rig.diagnosis.work import engine

    declared = to_toml(read(Path(model)))
    dates = {one.folder: one.runs[0].date for one in reversed(found)}  # the newest come first
    with progress() as bar:
        task = bar.add_task("campaigns", total=None)
        fitted = refit_all(
            list(dates), declared, partial(engine, workers, scheduler), lambda _: bar.advance(task)
        )
    good = {folder: fit for folder, fit in fitted.items() if not fit.failed}
    moved = _changes(good, dates, root)
    if json:
        rows = [
            {"folder": folder, "date": dates[folder], "fit": one} for folder, one in fitted.items()
        ]
        emit_json({"campaigns": rows, "changes": moved})
        return
    screen = results(json)
    for folder, one in fitted.items():
        if one.failed:
            screen.print(f"{folder.relative_to(root)}: {one.failed}", markup=False)
    if good:
        show_table(screen, _table(good, moved))
    screen.print(f"{len(good)} of {len(fitted)} campaigns fitted.")


def _changes(
    good: Mapping[Path, "Refit"], dates: Mapping[Path, str], root: Path
) -> dict[str, list[dict[str, Any]]]:
    """Return the changes of each parameter that has any."""
    from rig.campaigns.drift import changes

    folders = list(good)
    found = {}
    for name in next(iter(good.values())).values if good else ():
        moved = changes([one.values[name] for one in good.values()])
        if moved:
            found[name] = [
                {
                    "since": str(folders[one.first].relative_to(root)),
                    "date": dates[folders[one.first]],
                    "before": one.before,
                    "after": one.after,
                }
                for one in moved
            ]
    return found


def _table(
    good: Mapping[Path, "Refit"], moved: Mapping[str, Sequence[Mapping[str, Any]]]
) -> "TextTable":
    from rig.output.table import TextTable

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
