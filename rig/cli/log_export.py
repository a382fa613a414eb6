"""`rig log export`: a log, or a campaign as one table, in other formats."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from rig.cli.options import say_left_out
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, remarks
from rig.output.table import counted

if TYPE_CHECKING:
    from calibration.linear import CalibrationSet
    from rig.log.export import ExportFormat


def export(
    path: Annotated[Path, Argument(help="A log; or a folder, for one table of all its runs.")],
    format_name: Annotated[
        str, Option("--format", help="csv or parquet; of a single log npz, too; mcap with --model.")
    ] = "csv",
    topic: Annotated[str | None, Option(help="Only this topic.")] = None,
    out: Annotated[
        Path | None,
        Option(
            "--out",
            "-o",
            help="Folder; or, with its ending, the file of one topic or of a campaign's table. By"
            " default next to the recordings.",
        ),
    ] = None,
    force: Annotated[bool, Option("--force", help="Overwrite files.")] = False,
    calibration: Annotated[
        str | None, Option(help="Apply this set instead: a TOML file, or a shipped set's name.")
    ] = None,
    record: Annotated[
        list[str] | None, Option(help="Apply this record of the store, by hash; may be repeated.")
    ] = None,
    store: Annotated[Path | None, Option(help="Folder of the store of --record.")] = None,
    model: Annotated[
        Path | None, Option(help="Add the estimate of this model file as estimated_* columns.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Export a log, one file for each topic; or a campaign as one table.

    The table of a campaign (a folder or an archive of any format that is known) has a row a sample,
    with its run and conditions. Parquet holds units, instrument, calibrations and notes as
    metadata; for a CSV they are written to NAME.csv.json. With --model and --format mcap, logs with
    the estimate next to the sensor are written into a folder, for Foxglove and PlotJuggler.
    """
    from rig.cli.import_ import write_logs
    from rig.cli.view import with_model
    from rig.importers.registry import open_campaign
    from rig.importers.tidy import write_tidy
    from rig.log.export import ExportFormat, export_log

    if model or path.is_dir() or not path.name.endswith((".mcap", ".part")):
        if topic or calibration or record:
            raise UsageError("--topic, --calibration and --record are of a single log as it is.")
        whole = open_campaign(path)
        say_left_out(path, whole)
        campaign = with_model(whole.evidence, model) if model else whole.evidence
        if model and format_name == "mcap":
            written = write_logs(list(campaign), out or Path(f"{path.resolve().name}.estimated"))
        else:
            known = _known(format_name, "A campaign", (ExportFormat.CSV, ExportFormat.PARQUET))
            name = f"{path.resolve().name}.{format_name}"
            target = out or path.resolve().with_name(name)
            is_folder = target.is_dir() or not target.suffix
            target = target / name if is_folder else target
            written = [write_tidy(campaign, target, known, force)]
        where = written[0] if len(written) == 1 else written[0].parent
        data = {"written": written, "runs": campaign.names}
        present(json, data, f"wrote {where}: {counted(len(campaign), 'run')}")
        return
    known = _known(format_name, "A log", ExportFormat)
    applied = _other_calibrations(path, calibration, record or [], store)
    written = export_log(path, known, out, topic, force=force, calibrations=applied)
    names = None if applied is None else {applied.name: applied.content_hash}
    found = {"written": written, "calibrations": names}
    present(json, found, *(f"wrote {file}" for file in written))


def _known(name: str, what: str, formats: "Iterable[ExportFormat]") -> "ExportFormat":
    known = {one.value: one for one in formats}
    if name not in known:
        fix = f"Choose one of {', '.join(known)}."
        raise UsageError(f"{what} is not exported as {name!r}.", fix=fix)
    return known[name]


def _other_calibrations(
    path: Path, calibration: str | None, records: list[str], store: Path | None
) -> "CalibrationSet | None":
    """Return the set an export is to be made with; None for the one it was recorded with."""
    if calibration is None and not records:
        return None
    from calibration.linear import load_calibration_set, shipped_calibration_set
    from calibration.rules import judge_range, refuse_errors
    from calibration.store import CalibrationStore, compose, default_folder
    from rig.log.reader import read_log
    from rig.log.recalibrate import carried_calibrations
    from rig.log.streams import COUNTS

    log = read_log(path, topics=(COUNTS,))
    if calibration is None:
        base = carried_calibrations(log)
    elif calibration.endswith(".toml"):
        base = load_calibration_set(Path(calibration))
    else:
        base = shipped_calibration_set(calibration)
    kept = CalibrationStore(store or default_folder())
    found = [kept.get(start) for start in records]
    made = compose(base, found)
    if COUNTS in log.topics:
        rows = log.topics[COUNTS].rows
        verdicts = [v for r in found for v in judge_range(r, rows[r.input])]
        for verdict in refuse_errors(verdicts):
            remarks().print(f"{verdict.channel}: {verdict.message}")
    return made
