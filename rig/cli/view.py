"""`rig view`: recordings as one page in a browser."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from estimation.errors import EstimationError
from estimation.files import write_text_atomic
from rig.cli import options
from rig.errors import DataError, UsageError
from rig.output.console import JsonFlag, present, remarks
from rig.output.table import counted

if TYPE_CHECKING:
    from estimation.campaign import Campaign


def view(
    path: options.RecordingsArgument,
    run: Annotated[
        list[str] | None, Option(help="Only this run, in more points; may be repeated.")
    ] = None,
    model: options.ReplayModel = None,
    machine: options.MachineOption = None,
    format_: options.FormatOption = None,
    skip_bad: options.SkipBad = False,
    out: Annotated[
        Path | None, Option("--out", "-o", help="Page to write; by default NAME.view.html.")
    ] = None,
    open_: Annotated[bool, Option("--open/--no-open", help="Open the page in a browser.")] = True,
    json: JsonFlag = False,
) -> None:
    """Show recordings in a browser: every channel over time, run by run.

    The page is one file that needs no network. An estimate is drawn on its sensor, with the
    residual below.
    """
    import webbrowser

    from rig.machines.recordings import open_recordings
    from rig.output.provenance import Provenance
    from rig.reports.recordings import page

    whole = open_recordings(path, machine, format_, skip_bad)
    options.say_left_out(path, whole)
    shown = whole.evidence if skip_bad else whole
    campaign = with_model(chosen_runs(shown, run or []), model)
    name = path.resolve().name
    target = out or Path(f"{name}.view.html")
    write_text_atomic(target, page(campaign, f"Recordings: {name}", Provenance.now(0)))
    opened = open_ and not json and webbrowser.open(target.resolve().as_uri())
    said = [f"{counted(len(campaign), 'run')}: {target}"]
    if not opened:
        said.append(f"Open it: {target.resolve().as_uri()}")
    present(json, {"page": target, "runs": campaign.names}, *said)


def chosen_runs(campaign: "Campaign", names: list[str]) -> "Campaign":
    """Return the named runs of a campaign, all without a name; without runs it is a DataError."""
    if not len(campaign):
        raise DataError("The recordings hold no runs.", "There is nothing to show.")
    for name in names:
        if name not in campaign.names:
            raise UsageError(
                f"There is no run {name!r}.",
                f"There are: {', '.join(campaign.names)}.",
                f"Type --run {campaign.names[0]}",
            )
    return campaign.select(names) if names else campaign


def with_model(campaign: "Campaign", model: Path | None) -> "Campaign":
    """Return a campaign whose recordings have the estimate of a model's file.

    None is the model in use for each recording's rig, where there is one and it can estimate that
    recording.

    Raises:
        EstimationError: The named model cannot estimate a recording.
    """
    from estimation.campaign import Campaign, Run
    from estimation.recording import Recording
    from rig.configuration.model_in_use import model_in_use
    from rig.live.estimator import with_estimates

    def load(run: Run) -> Recording:
        recording = run.load()
        path = model or model_in_use(recording.rig)
        if path is None:
            return recording
        try:
            return with_estimates(recording, path)
        except EstimationError as error:
            if model is not None:
                raise
            remarks().print(f"{run.name} is without an estimate of {path.name}: {error.what}")
            return recording

    return Campaign(tuple(replace(run, load=partial(load, run)) for run in campaign.runs))
