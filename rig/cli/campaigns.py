"""`rig campaigns`: find recordings again, open their diagnosis, compare them, diagnose again."""

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from rig.cli.options import SchedulerOption, WorkersOption, complete_campaign, complete_model
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, remarks, results
from rig.output.table import TextTable

if TYPE_CHECKING:
    from rig.campaigns.index import IndexedCampaign, IndexedRun

LONGEST = 40
"""Letters of a note or a list of conditions that a row shows."""


def campaigns(
    terms: Annotated[
        list[str] | None,
        Argument(
            help="Words, and comparisons: 'frequency_hz>=0.5', verdict=one_of.",
            autocompletion=complete_campaign,
        ),
    ] = None,
    root: Annotated[Path, Option(help="Folder of the campaigns.")] = Path("logs"),
    runs: Annotated[bool, Option("--runs", help="One row a run.")] = False,
    open_: Annotated[
        bool, Option("--open", help="Open the page of the one campaign found.")
    ] = False,
    compare: Annotated[
        bool, Option("--compare", help="Show the campaigns found side by side.")
    ] = False,
    diagnose: Annotated[
        bool, Option("--diagnose", help="Diagnose the campaigns found, and keep the pages.")
    ] = False,
    refit: Annotated[
        str | None,
        Option(
            "--refit",
            metavar="MODEL",
            help="Fit a model on each campaign found, and show how its parameters change.",
            autocompletion=complete_model,
        ),
    ] = None,
    workers: WorkersOption = 1,
    scheduler: SchedulerOption = None,
    most: Annotated[int, Option("--most", min=1, help="Rows of a table, the newest first.")] = 40,
    rebuild: Annotated[
        bool, Option("--rebuild", help="Read every log again into the index.")
    ] = False,
    json: JsonFlag = False,
) -> None:
    """List recorded campaigns, or search them by words and by values of their conditions.

    The index behind it is made from the logs and follows them by itself. With --open, --compare or
    --diagnose, names of folders select these alone.
    """
    from rig.campaigns import search

    whole = _indexed(root, rebuild)
    by_name = {str(campaign.folder.relative_to(root)): campaign for campaign in whole}
    if (diagnose or open_ or compare) and terms and all(term in by_name for term in terms):
        found = [by_name[term] for term in terms]
    else:
        found = search.search(whole, terms or [])
    recorded = [campaign for campaign in found if campaign.runs]
    if refit is not None or (diagnose and len(recorded) > (0 if json else 1)):
        from rig.cli.campaigns_each import show_diagnoses, show_refit

        if refit is not None:
            show_refit(recorded, root, refit, workers, scheduler, json)
        else:
            show_diagnoses(recorded, root, workers, scheduler, json)
        return
    if diagnose:
        from rig.cli.diagnose import diagnose as diagnose_one

        diagnose_one(_only(found).folder)
        return
    if open_:
        _open(_only(found))
        return
    beside = [_side_by_side(found, root)] if compare and found else None
    shown = beside or _listed(found, root, runs, most, len(whole))
    present(json, {"campaigns": found}, *shown)


def _indexed(root: Path, rebuild: bool) -> "Sequence[IndexedCampaign]":
    """Return all campaigns of a folder, from the index; what is new there is read."""
    from rig.campaigns.index import campaigns as all_campaigns
    from rig.campaigns.index import default_index

    if not root.is_dir():
        raise UsageError(
            f"There is no folder {root}.",
            "Recordings are listed from there.",
            "Name the folder with --root, or record a campaign: rig record.",
        )
    working = remarks()
    return all_campaigns(
        root, default_index(root), rebuild, lambda folder: working.print(f"reading {folder} ...")
    )


def _listed(
    found: Sequence["IndexedCampaign"], root: Path, runs: bool, most: int, of: int
) -> "list[str | TextTable]":
    count = sum(len(campaign.runs) for campaign in found)
    shown: list[str | TextTable] = []
    if found:
        table = _by_run(found, root, most) if runs else _by_campaign(found[:most], root)
        shown.append(table)
        if len(table.rows) < (count if runs else len(found)):
            shown.append(f"Older ones are not shown; --most shows more than {most} rows.")
    return [*shown, f"{len(found)} of {of} campaigns, {count} runs."]


def _only(found: Sequence["IndexedCampaign"]) -> "IndexedCampaign":
    """Return the single campaign of a search; none and several are refused."""
    if len(found) == 1:
        return found[0]
    names = ", ".join(str(campaign.folder) for campaign in found[:5])
    raise UsageError(
        f"{len(found)} campaigns match; one is needed." if found else "No campaign matches.",
        f"They are: {names}{', ...' if len(found) > 5 else ''}." if found else "",
        "Add a word that only one of them has, such as a part of its folder's name.",
    )


def _open(campaign: "IndexedCampaign") -> None:
    import webbrowser

    from rig.campaigns.index import DIAGNOSIS

    page = (campaign.folder / DIAGNOSIS).with_suffix(".html")
    if not page.is_file():
        raise UsageError(
            f"{campaign.folder} has no page of a diagnosis.",
            fix=f"Make it: rig diagnose {campaign.folder}",
        )
    results(json=False).print(str(page))
    webbrowser.open(page.resolve().as_uri())


def _by_campaign(found: Sequence["IndexedCampaign"], root: Path) -> "TextTable":
    rows = []
    for campaign in found:
        facts = _facts(campaign)
        name = str(campaign.folder.relative_to(root))
        rows.append([name, *(_short(text) for text in facts.values())])
    columns = ["campaign", *(_facts(found[0]))]
    kept = [k for k in range(len(columns)) if any(row[k] for row in rows)]
    return TextTable("", [columns[k] for k in kept], [[row[k] for k in kept] for row in rows])


def _facts(campaign: "IndexedCampaign") -> dict[str, str]:
    """Return the cells of a campaign by heading."""
    from rig.campaigns.search import families, verdict

    runs = campaign.runs
    whole = sum(run.state == "complete" and not run.lost for run in runs)
    names = [family for family in families(campaign) if family != "unknown"]
    said = verdict(campaign).replace("_", " ")
    return {
        "date": runs[0].date[:16].replace("T", " "),
        "instrument": _together(run.instrument or run.rig for run in runs),
        "protocol": _together(run.protocol for run in runs),
        "runs": str(len(runs)) if whole == len(runs) else f"{whole} of {len(runs)} complete",
        "lost": str(lost) if (lost := sum(run.lost for run in runs)) else "",
        "conditions": _conditions(runs),
        "verdict": f"{said}: {', '.join(names)}" if names else said,
        "notes": _together(run.notes for run in runs),
    }


def _together(texts: Any) -> str:
    return ", ".join(dict.fromkeys(text for text in texts if text))


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _conditions(runs: Sequence["IndexedRun"]) -> str:
    """Return the conditions that differ between runs, each with its range."""
    values: dict[str, list[float]] = {}
    for run in runs:
        for name, value in run.conditions.items():
            if not isinstance(value, str):
                values.setdefault(name, []).append(value)
    return ", ".join(
        f"{name} {min(own):g} to {max(own):g}" if len(set(own)) > 1 else f"{name} {own[0]:g}"
        for name, own in values.items()
    )


def _by_run(found: Sequence["IndexedCampaign"], root: Path, most: int) -> "TextTable":
    pairs = ((campaign, run) for campaign in found for run in campaign.runs)
    rows = []
    for campaign, run in islice(pairs, most):
        name, rig = str(campaign.folder.relative_to(root) / run.file), run.instrument or run.rig
        lost = str(run.lost) if run.lost else ""
        state, conditions, notes = map(_short, (run.state, _conditions([run]), run.notes))
        rows.append([name, run.date[:16].replace("T", " "), rig, state, lost, conditions, notes])
    columns = ["run", "date", "instrument", "state", "lost", "conditions", "notes"]
    return TextTable("", columns, rows)


def _side_by_side(found: Sequence["IndexedCampaign"], root: Path) -> "TextTable":
    """Return campaigns as columns, with the errors of their diagnoses."""
    facts = [_facts(campaign) for campaign in found]
    rows = [[name, *(one[name] for one in facts)] for name in (facts[0] if facts else ())]
    diagnoses = [campaign.diagnosis or {} for campaign in found]
    equations = dict.fromkeys(name for d in diagnoses for name in d.get("rmse_before", {}))
    for equation in equations:
        cells = []
        for d in diagnoses:
            before, after = (
                d.get(f"rmse_{side}", {}).get(equation) for side in ("before", "after")
            )
            known = before is not None and after is not None
            unit = d.get("unit", {}).get(equation, "")
            cells.append(f"{before:.3g} to {after:.3g} {unit}" if known else "")
        rows.append([f"error of {equation}", *cells])
    return TextTable("", ["", *(str(c.folder.relative_to(root)) for c in found)], rows)
