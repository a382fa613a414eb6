"""Opening a table: the files at a path, read by their kind and cut into runs."""

import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from estimation.campaign import Campaign, Run
from estimation.copies import without_copies
from estimation.recording import UNDATED_NS, Recording
from rig.errors import DataError, UsageError
from rig.importers.derivatives import checked
from rig.importers.registry import or_excluded, unreadable
from rig.importers.table.arrays import read_mat, read_npy, read_npz, read_parquet
from rig.importers.table.channels import to_samples
from rig.importers.table.data import Layout
from rig.importers.table.delimited import read_delimited
from rig.importers.table.json_rows import read_json
from rig.importers.table.mapping import ColumnMapping
from rig.importers.table.raw import NoColumnError, Raw, Remark, is_number, with_samples
from rig.importers.table.runs import recordings
from rig.log.order import by_number

READERS: Mapping[str, Callable[[Path, Layout], Raw]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".lvm", ".gz"), read_delimited),
    ".parquet": read_parquet,
    ".mat": read_mat,
    ".npz": read_npz,
    ".npy": read_npy,
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), read_json),
}
"""Ending of a file's name to its reader; any other file is read as a text table."""


def open_table(path: Path, mapping: ColumnMapping, skip_bad: bool = False) -> Campaign:
    """Read the runs of a table, a file or a folder of files, into a campaign.

    A run that is there twice counts once. With `skip_bad` files and runs that cannot be read are
    excluded, with the reason, unless none can.

    Raises:
        UsageError: The path does not exist.
        DataError: A file cannot be read as the mapping states, no run is long enough, or a
            channel contradicts the one that is its derivative.
    """
    bad: list[Run] = []
    runs = []
    for run in read_runs(path, mapping, [], bad if skip_bad else None):
        try:
            runs.append(checked(run))
        except DataError as error:
            if not skip_bad:
                raise
            bad.append(unreadable(run.name, error))
    if bad and not runs:
        bad[0].load()
    require_runs(runs, path, mapping)
    return Campaign((*without_copies(Campaign.of(runs)).runs, *map(or_excluded, bad)))


def require_runs(runs: Sequence[Recording], path: Path, mapping: ColumnMapping) -> None:
    """Refuse a table of which no run is left (DataError)."""
    if runs:
        return
    rules = ", ".join(sorted(mapping.data.runs.model_fields_set))
    raise DataError(
        f"No run of {path} is long enough.",
        f"A run has two samples or more, and [data.runs] states {rules}."
        if rules
        else "A run has two samples or more.",
        f"Change {rules} ({mapping.where('runs')})." if rules else "Name files with more samples.",
    )


def read_runs(
    path: Path,
    mapping: ColumnMapping,
    remarks: list[Remark],
    bad: list[Run] | None = None,
    asks: bool = False,
) -> list[Recording]:
    """Return the runs of a table without the check of derivatives.

    Of files in several folders, the name of a run begins with those of its file: `monday-run1`.
    `remarks` gets a sentence on everything that was assumed, left out or filled in, and `bad` the
    files that cannot be read; without it the first of these is an error. With `asks` a file that
    is cut into many tiny parts is read, with a question. Where the clock has no date, the start of
    a run is known if no two runs are at one time of it: then it goes on from run to run.
    """
    runs = list(_each_run(path, mapping, remarks, bad, asks))
    starts = [r.started_at_ns for r in runs]
    if all(start is not None and start >= UNDATED_NS for start in starts) or _goes_on(runs):
        return runs
    if len(runs) > 1:
        clock = "no column holds the time" if None in starts else "the time begins again in a run"
        remarks.append((path.resolve().name, f"{clock}, so the pauses between runs are not known"))
    return [replace(r, started_at_ns=None) for r in runs]


def _goes_on(runs: Sequence[Recording]) -> bool:
    """Whether runs are after one another on a clock, in any order: more than one of them."""
    spans = sorted((r.started_at_ns, r.duration_s) for r in runs if r.started_at_ns is not None)
    each = itertools.pairwise(spans)
    follow = all(start + 1e9 * length_s < after for (start, length_s), (after, _) in each)
    return len(spans) == len(runs) > 1 and spans[0][0] >= 0 and follow


def _each_run(
    path: Path,
    mapping: ColumnMapping,
    remarks: list[Remark],
    bad: list[Run] | None,
    asks: bool,
) -> Iterator[Recording]:
    taken: set[str] = set()
    files = files_at(path, mapping)
    several = len({file.parent for file in files}) > 1
    absent = tuple(_absent(files, mapping)) if path.is_dir() else ()
    for file in files:
        folders = file.relative_to(path).parts[:-1] if several else ()
        try:
            runs = _runs_of(file, mapping, remarks, asks)
        except DataError as error:
            if bad is None:
                if not isinstance(error, NoColumnError) or len(files) == 1:
                    raise
                kept = f"The files before it have it: give the column that name in {file.name}."
                fix = kept if taken else error.fix
                other = "" if mapping.data.files else _not_this(error, files)
                raise DataError(error.what, error.why, f"{fix}{other}") from error
            bad.append(unreadable("/".join((*folders, file.name)), error))
            continue
        for run in runs:
            name = "-".join([*folders, run.name])
            if name in taken:
                name += file.suffix.lower()
            taken.add(name)
            yield replace(run, name=name, doubts=(*run.doubts, *absent))


def _absent(files: Sequence[Path], mapping: ColumnMapping) -> Iterator[str]:
    """Yield the side files that have lines for recordings that are not there, as questions."""
    for folder in dict.fromkeys(file.parent for file in files):
        side = folder / mapping.data.side_file
        if not side.is_file():  # none is stated, or its absence is an error of each file
            continue
        there = {name for file in folder.iterdir() for name in (file.name, file.stem)}
        named = map(str, read_delimited(side, Layout()).columns.get("file", ()))
        if absent := [name for name in named if name not in there]:
            yield (
                f"{side.name} has a line for {', '.join(absent)}, and there is no such file; is a"
                " recording lost? If not, delete the line."
            )


def _not_this(error: NoColumnError, files: Sequence[Path]) -> str:
    """Return the remedy where a file of a folder is not a recording, after a space."""
    name, kind = error.raw.path.name, error.raw.path.suffix
    letters = zip(*(file.name for file in files if file.name != name), strict=False)
    shared = itertools.takewhile(lambda same: len(set(same)) == 1, letters)
    stem = "".join(same[0] for same in shared).rstrip("0123456789")
    pattern = f"{stem}*{kind}" if not name.startswith(stem) else "PATTERN"
    own = f"; if it states values of each file, side_file = {name!r}"
    own = own if "file" in error.raw.columns else ""
    return f" If {name} is not a recording, write files = {pattern!r} under [data]{own}."


def _runs_of(
    file: Path, mapping: ColumnMapping, remarks: list[Remark], asks: bool
) -> list[Recording]:
    samples = to_samples(read_raw(file, mapping), mapping)
    said = (*samples.raw.remarks, *samples.remarks)
    remarks += [(file.name, remark) for remark in said]
    return list(recordings(samples, remarks, asks))


def files_at(path: Path, mapping: ColumnMapping) -> list[Path]:
    """Return the files of a table in the order of their names, numbers in them by value.

    Raises:
        UsageError: The path does not exist, or holds no such file.
    """
    if not path.exists():
        raise UsageError(f"There is no file or folder {path}.", fix="Check the path.")
    if path.is_file():
        return [path]
    side = Path(mapping.data.side_file).name
    if pattern := mapping.data.files:
        found = [file for file in path.glob(pattern) if file.is_file() and file.name != side]
        why = f"The pattern is files, {mapping.where('files')}."
    else:
        known = [file for file in path.iterdir() if file.suffix.lower() in READERS]
        found = [file for file in known if file.name != side]
        why = f"Known kinds are {', '.join(READERS)}."
    if not found:
        raise UsageError(
            f"{path} has no file {pattern or 'of a known kind'}.",
            why,
            'Name a file, or state files in [data]; of files in folders, files = "*/*.csv".',
        )
    return sorted(found, key=lambda file: by_number(str(file.relative_to(path))))


def read_largest(path: Path, mapping: ColumnMapping) -> Raw:
    """Read the largest file of a table: that of a folder which has samples, not a side table."""
    return read_raw(max(files_at(path, mapping), key=lambda file: file.stat().st_size), mapping)


def read_raw(file: Path, mapping: ColumnMapping) -> Raw:
    """Read one file: its columns, and single values from it, its name and the side file.

    Raises:
        DataError: It cannot be read, or its name or the side file does not hold what is stated.
    """
    reader = READERS.get(file.suffix.lower(), read_delimited)
    try:
        raw = with_samples(reader(file, mapping.data))
    except OSError as error:
        raise DataError(f"{file} cannot be read: {error.strerror or error}.") from error
    fields = raw.fields | _named_in(file, mapping, raw.decimal) | _beside(file, mapping)
    return replace(raw, fields=fields)


def _named_in(file: Path, mapping: ColumnMapping, decimal: str) -> dict[str, float | str]:
    """Return the named groups of a file's name, or of that with its folder's before it.

    A number has a decimal point, or the decimal sign of the table.
    """
    pattern = mapping.data.file_name
    if not pattern:
        return {}
    where = mapping.where("file_name")
    try:
        names = file.name, f"{file.parent.name}/{file.name}"
        found = next((m for name in names if (m := re.search(pattern, name))), None)
    except re.error as error:
        raise UsageError(f"{where}: {pattern!r} is not a regular expression: {error}.") from error
    if found is None:
        raise DataError(
            f"{where}: the name {file.name!r} does not match {pattern!r}.",
            fix="Correct file_name, or choose files with files = PATTERN.",
        )
    sign = mapping.data.decimal or decimal or "."
    texts = {name: text for name, text in found.groupdict().items() if text is not None}
    numbers = {name: text.replace(sign, ".") for name, text in texts.items()}
    return {n: float(numbers[n]) if is_number(numbers[n]) else texts[n] for n in texts}


def side_file_of(file: Path) -> str:
    """Return the name of the table next to a file that has a line for it; empty without one."""
    for side in sorted(file.parent.glob("*.csv")):
        try:
            with side.open(encoding="utf-8-sig") as lines:
                if side == file or "file" not in next(lines, ""):
                    continue
            named = read_delimited(side, Layout()).columns.get("file", ())
        except (OSError, UnicodeDecodeError, DataError):
            continue
        if {file.name, file.stem} & {str(cell) for cell in named}:
            return side.name
    return ""


def _beside(file: Path, mapping: ColumnMapping) -> dict[str, float | str]:
    name = mapping.data.side_file
    if not name:
        return {}
    where, path = mapping.where("side_file"), file.parent / name
    if not path.is_file():
        raise UsageError(
            f"{where}: the file {path} does not exist.", fix="Put it next to the data."
        )
    side = read_delimited(path, Layout())
    if "file" not in side.columns:
        raise DataError(
            f"{path} has no column 'file'.", side.listing(), "Add one with the names of the files."
        )
    names = [str(cell) for cell in side.columns["file"]]
    lines = [k for k, one in enumerate(names) if one in (file.name, file.stem)]
    if len(lines) != 1:
        raise DataError(
            f"{path} has {len(lines)} lines for the file {file.name!r}.",
            fix="Write one line with this name in the column 'file'.",
        )
    values = {key: column[lines[0]] for key, column in side.columns.items() if key != "file"}
    return {k: float(v) if v.dtype.kind in "fiu" else str(v) for k, v in values.items()}
