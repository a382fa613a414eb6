"""`rig import`: a table of samples, of any layout, becomes recordings."""

import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from estimation.files import write_text_atomic
from rig.cli.options import complete_machine, machine_names
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, remarks
from rig.output.table import TextTable, listed

if TYPE_CHECKING:
    from estimation.plant import Plant
    from estimation.recording import Recording
    from rig.importers.table.mapping import ColumnMapping
    from rig.importers.table.preview import Preview
    from rig.importers.table.raw import Raw

MOST_RUNS = 12
"""Runs listed on the screen; more are counted."""

FIRST, MOST_CELL = 5, 30
"""Values shown of a column that is not mapped, and characters of each."""

Flag = tuple[tuple[str, ...], Any, str]
"""A place in a mapping, its entry, and the words of the command line that state it."""

Words = list[str] | None

ColumnOption = Annotated[
    list[str] | None,
    Option(help="CHANNEL=COLUMN[:UNIT], such as motor_angle_rad=q1:deg; may be repeated."),
]
ConditionOption = Annotated[
    list[str] | None,
    Option(help="NAME=COLUMN[:UNIT], what is constant in a run; may be repeated."),
]
RunsOption = Annotated[
    list[str] | None,
    Option(
        help="Where runs begin: gap_s=1, lap_s=6.24, changes=COLUMN, falls=COLUMN,"
        " mark=COLUMN, resets=true; may be repeated."
    ),
]
SetOption = Annotated[
    list[str] | None,
    Option("--set", help="Another key of [data], such as even_rate_hz=100; may be repeated."),
]


def import_(
    path: Annotated[
        Path, Argument(help="CSV, TSV, Parquet, .mat, .npz, JSON, JSON lines, or a folder.")
    ],
    machine: Annotated[
        Path | None,
        Option(
            "--machine",
            help="Machine file whose [data] maps the columns, or one of"
            f" {', '.join(machine_names())}.",
            autocompletion=complete_machine,
        ),
    ] = None,
    column: ColumnOption = None,
    condition: ConditionOption = None,
    runs: RunsOption = None,
    rate: Annotated[
        float | None, Option(help="Sample rate, Hz, where no column holds the time.")
    ] = None,
    set_: SetOption = None,
    preview: Annotated[
        bool, Option("--preview", help="Show what would be imported; write no recording.")
    ] = False,
    plots: Annotated[Path | None, Option(help="Page of every channel (HTML).")] = None,
    out: Annotated[
        Path | None, Option("--out", "-o", help="Folder of the recordings, one log a run.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Import a table of any layout by a mapping of its columns, or preview it.

    The mapping is `[data]` of a machine file or options of this command, which come first. Nothing
    is guessed: a column without a unit is in the SI unit that the channel's name ends in.
    """
    from rig.importers.table.channels import NotMappedError
    from rig.importers.table.open import read_largest, read_runs, require_runs
    from rig.importers.table.preview import preview as look
    from rig.importers.table.raw import Remark

    _require_a_table(path)
    if not preview and out is None:
        raise UsageError(
            "Nothing states where the recordings are to be written.",
            fix="Add --out FOLDER, or look at the table first with --preview.",
        )
    flags = _flags(column, condition, runs, set_, rate)
    mapping = _mapping(path, machine, flags)
    said: list[Remark] = []
    try:
        recordings = read_runs(path, mapping, said, asks=preview)
    except NotMappedError:
        if not preview:
            raise
        present_columns(read_largest(path, mapping), path, json)
        return
    require_runs(recordings, path, mapping)
    found = look(recordings, said, None if machine is None else _plant_of(machine))
    written = [] if preview or out is None else write_logs(recordings, out)
    lines = [f"Note: {line}." for line in found.remarks]
    lines += [] if found.questions else ["Nothing looks wrong."]
    lines += [] if plots is None else [_plotted(recordings, plots)]
    lines += [f"wrote {len(written)} recordings to {out}"] if written else []
    whole = None if preview and flags else machine  # a file that maps the table alone
    lines.append(f"Next: {_next(path, None if preview else out, whole)}")
    for line in found.questions:
        remarks().print(f"Check: {line}")
    data = {"preview": found, "written": written, "plots": plots}
    present(json, data, *_tables(found, mapping), *lines)


def _mapping(path: Path, machine: Path | None, flags: list[Flag]) -> "ColumnMapping":
    """Return the mapping of a machine's file, of its channels' names, or of the command line."""
    from rig.importers.table.mapping import read_mapping
    from rig.machines.recordings import mapping_of
    from rig.machines.shipped import place_of

    if machine is None:
        return read_mapping(None, flags)
    file = place_of(machine)
    return (None if flags else mapping_of(path, file)) or read_mapping(file, flags)


def _plant_of(machine: Path) -> "Plant | None":
    """Return the machine of a file; None of one that maps the table alone."""
    from estimation.plant_file import PlantFileError
    from rig.machines.shipped import read_machine

    with suppress(PlantFileError):
        return read_machine(machine)
    return None


def _flags(
    column: Words, condition: Words, runs: Words, set_: Words, rate: float | None
) -> list[Flag]:
    """Return the part of a mapping that each option states."""
    return [
        *_entries("--column", column, "columns"),
        *_entries("--condition", condition, "conditions"),
        *_entries("--runs", runs, "runs"),
        *_entries("--set", set_),
        *([] if rate is None else [(("sample_rate_hz",), rate, f"--rate {rate:g}")]),
    ]


def _next(path: Path, out: Path | None, machine: Path | None) -> str:
    """Return the next command for a table, or for the recordings that were written of it.

    The machine is None where it does not map the table alone.
    """
    if machine is not None:
        return shlex.join(["rig", "machine", "check", str(machine), str(out or path)])
    if out is None:
        return "the same with --out FOLDER in place of --preview"
    return shlex.join(["rig", "view", str(out)])


def _require_a_table(path: Path) -> None:
    """Refuse recordings of this program."""
    from rig.log.check import looks_like_log
    from rig.recording.campaign import MANIFEST

    if (path / MANIFEST).is_file() or looks_like_log(path):
        raise UsageError(
            f"{path} is a recording of this program already; nothing is to be mapped.",
            fix=f"Give it to a command as it is, such as `rig log info {path}`.",
        )


def _plotted(recordings: "list[Recording]", plots: Path) -> str:
    """Write the page of every channel, and return the line that names it."""
    from estimation.campaign import Campaign
    from rig.output.provenance import Provenance
    from rig.reports.recordings import page

    write_text_atomic(plots, page(Campaign.of(recordings), "Imported table", Provenance.now(0)))
    return f"Plots: {plots}"


def present_columns(raw: "Raw", path: Path, json: bool) -> None:
    """Show the columns of a table of which nothing is mapped, and how they are mapped."""
    first = {name: values[:FIRST].tolist() for name, values in raw.columns.items()}
    cells = [(name, *map(_cell, values)) for name, values in first.items()]
    numbers = map(str, range(1, 1 + max(map(len, first.values()))))
    new = shlex.join(["rig", "machine", "new", "FILE", "--axis", "motor:rad", "--from", str(path)])
    lines = [f"Single value {name}: {_cell(value)}" for name, value in raw.fields.items()]
    lines += [f"Note: {remark}." for remark in raw.remarks]
    lines += [
        "Nothing is mapped yet. Write a line for each channel into a machine file"
        f" ({new}), or --column CHANNEL=COLUMN:UNIT:",
        "[data.columns]",
        'time_s = "COLUMN:UNIT"',
        'motor_angle_rad = "COLUMN:UNIT"',
        "The name of a channel ends in its SI unit. UNIT is that of the column, such as ms, deg or"
        " mA; without :UNIT the column is in SI units. See docs/your-own-machine.md.",
    ]
    table = TextTable(f"Columns of {raw.path.name}", ("column", *numbers), cells)
    found = {"columns": first, "single_values": raw.fields, "remarks": raw.remarks}
    present(json, {"preview": None, "written": [], "plots": None, **found}, table, *lines)


def _cell(value: float | str) -> str:
    return value[:MOST_CELL] if isinstance(value, str) else f"{value + 0.0:.10g}"  # no -0


def _entries(option: str, words: Words, *part: str) -> Iterator[Flag]:
    """Yield an option's entries in a part of a mapping, each with the words that state it."""
    for word in words or []:
        name, _, value = word.partition("=")
        if not (name and value):
            raise UsageError(
                f"{option} {word} is not NAME=VALUE.", fix=f"Write {option} NAME=VALUE."
            )
        entry = _rule(name, value) if option == "--runs" else value
        yield (*part, name.strip()), entry, f"{option} {word}"


def _rule(name: str, value: str) -> Any:
    """Return the value of a rule for runs: names of columns, times, a switch or a number."""
    if name == "changes":
        return value.split(",")
    if name == "at_s":
        return [float(one) for one in value.split(",")]
    if name == "resets":
        return value == "true"
    return value


def write_logs(recordings: "list[Recording]", out: Path) -> list[Path]:
    """Write the runs as logs, all or none."""
    from rig.importers.derivatives import checked
    from rig.log.convert import write_recording

    for recording in recordings:
        checked(recording)
    paths = [out / f"{recording.name}.mcap" for recording in recordings]
    there = [path for path in paths if path.exists()]
    if there:
        raise UsageError(
            f"{there[0]} is there already.", fix="Choose another folder; nothing was written."
        )
    out.mkdir(parents=True, exist_ok=True)
    return [write_recording(p, recording) for p, recording in zip(paths, recordings, strict=True)]


def _tables(found: "Preview", mapping: "ColumnMapping") -> "list[TextTable]":
    runs = []
    for run in found.runs[:MOST_RUNS]:
        rate = f"{run.rate_hz:.6g}" if run.rate_hz else "-"
        sizes = (str(run.samples), f"{run.duration_s:.4g}", rate, str(run.flagged))
        runs.append((run.name, *sizes, listed(run.conditions)))
    note = f"{len(found.runs)} runs in all" if len(found.runs) > MOST_RUNS else ""
    channels = [
        (
            c.name,
            _source(mapping, c.name),
            *(f"{v + 0.0:.5g}" for v in (c.least, c.greatest, c.mean)),
        )
        for c in found.channels
    ]
    cells = [[name, *(f"{v + 0.0:.6g}" for v in row)] for name, row in found.first.items()]
    numbers = map(str, range(1, len(found.first["time_s"]) + 1))
    return [
        TextTable("Runs", ("run", "samples", "s", "Hz", "flagged", "conditions"), runs, note),
        TextTable("Channels, SI units", ("channel", "from", "least", "greatest", "mean"), channels),
        TextTable(f"First samples of {found.runs[0].name}", ("channel", *numbers), cells),
    ]


def _source(mapping: "ColumnMapping", name: str) -> str:
    """Return where a channel comes from, in words."""
    data = mapping.data
    if name in data.formulas:
        return data.formulas[name]
    source = data.columns.get(name)
    if source is None:
        return name
    unit = f" in {source.unit}" if source.unit else ""
    gain = "" if source.gain == 1.0 else f" times {source.gain}"
    zero = f" from {source.zero:g}" if source.zero else ""
    return f"{source.column}{zero}{gain}{unit}"
