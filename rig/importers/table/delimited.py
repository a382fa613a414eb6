"""Text tables: CSV, TSV and other separators."""

import csv
import gzip
import re
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from rig.errors import DataError
from rig.importers.table.data import Layout
from rig.importers.table.raw import Raw, Values, is_number, numbers_or_text

COMPRESSED = b"\x1f\x8b"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
MAX_BYTES = 1 << 31
MARKS = ("#", "%")
"""What lines before a head begin with, where no comment sign is stated."""

LEAST_LINES, MOST_NOTES = 4, 200
"""Lines from which notes above a head are distinguished from samples, and the most notes."""

BRACKETS = " []()"
"""What a unit below the head may stand in."""

SEPARATORS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "space"}
"""Signs between columns, those first that stand in a line for nothing else."""

THOUSANDS = re.compile(
    r"[-+]?[1-9]\d{0,2}(?:(?P<sign>[.,' ])\d{3})(?:(?P=sign)\d{3})*(?:(?!(?P=sign))[.,]\d*)?"
)
"""A number with signs between thousands: 1.234,50 or 1,234.50 or 1'234."""

TRUTHS = {"true": "1", "false": "0"}


def read_delimited(path: Path, layout: Layout) -> Raw:
    """Read a text table.

    What the layout does not state follows from the file's first lines and is remarked on.

    Raises:
        DataError: It is not text, is empty, or a line has another number of fields than the first.
    """
    text = _text(path)
    lines = _without_last(text.splitlines(), layout)
    start = layout.skip_lines
    while start < len(lines) and _is_blank(lines[start], layout.comment):
        start += 1
    if start < len(lines) and (said := re.fullmatch("sep=(.)", lines[start])):
        sign = layout.separator or said[1]  # stated by a spreadsheet
        layout = layout.model_copy(update={"separator": sign})
        start += 1
    start, remarks = _after_notes(path, lines, start, layout)
    start, more = _above_samples(path, lines, start, layout)
    remarks += more
    if start >= len(lines):
        raise DataError(f"{path} has no rows.", fix="Name a file with a head and samples.")
    separator = _separator(path, lines[start], layout)
    if separator in lines[start] and not layout.separator:
        remarks.append(f"columns are separated by a {SEPARATORS[separator]}")
    try:
        every = _cells(lines, start, separator, layout.comment)
        rows = [row for row in every if any(map(str.strip, row[1]))]
    except csv.Error as error:
        raise DataError(f"{path} cannot be read as a text table: {error}.") from error
    is_cut = not text.endswith(("\n", "\r"))
    if is_cut and not layout.skip_last_lines:
        remarks.append("the last line has no line end, so it may be cut off")
    decimal = layout.decimal or _decimal(rows, separator)
    if decimal == "," and not layout.decimal:
        remarks.append("numbers have a decimal comma")
    has_head = layout.header
    if has_head is None:
        has_head = any(not _is_number(cell, decimal) for cell in rows[0][1])
        if not has_head:
            remarks.append("the first line holds numbers, so columns are named 1, 2, 3 and so on")
    first = [cell.strip() for cell in rows[0][1]]
    if not has_head:
        first = [str(k + 1) for k in range(len(first))]
    names = _unique(first)
    body = rows[1:] if has_head else rows
    units, units_line = dict[str, str](), 0
    if has_head and _holds_units(body, decimal):
        units_line, cells = body.pop(0)
        held = ", ".join(cell.strip() or "nothing" for cell in cells)
        remarks.append(f"line {units_line} below the head is taken as units: it holds {held}")
        stated = [cell.strip(BRACKETS) for cell in cells]
        units = {name: unit for name, unit in zip(names, stated, strict=False) if unit.strip("-")}
    _check_widths(path, body, len(names), is_cut)
    words = TRUTHS | dict.fromkeys((text.strip().lower() for text in layout.missing), "")
    columns = {
        name: _column(
            [words.get(cells[place].strip().lower(), cells[place]) for _, cells in body], decimal
        )
        for place, name in enumerate(names)
    }
    first_line = body[0][0] if body else 0
    repeated = {name: first.count(name) for name in first if name and first.count(name) > 1}
    return Raw(path, columns, {}, tuple(remarks), first_line, units, units_line, decimal, repeated)


def _without_last(lines: list[str], layout: Layout) -> list[str]:
    """Return the lines up to the last sample."""
    if not layout.skip_last_lines:
        return lines
    own = [k for k, line in enumerate(lines) if not _is_blank(line, layout.comment)]
    return lines[: own[-layout.skip_last_lines]] if layout.skip_last_lines <= len(own) else []


def _text(path: Path) -> str:
    content = path.read_bytes()
    if content.startswith(COMPRESSED):
        content = _inflated(path)
    if not content.strip():
        raise DataError(f"{path} is empty.", fix="Name a file with a head and samples.")
    if content.startswith(UTF_16):
        with suppress(ValueError):
            return content.decode("utf-16")
    if b"\0" not in content[:4096]:
        with suppress(ValueError):
            return content.decode("utf-8-sig")
        text = content.decode("latin-1")  # older spreadsheets write accented letters so
        if not any(c < " " and c not in "\t\r\n\f" for c in text[:4096]):
            return text
    raise DataError(
        f"{path} is not a text table.",
        f"It begins with the bytes {content[:8]!r}.",
        "Name a CSV, TSV, Parquet, .mat, .npy, .npz or JSON file.",
    )


def _inflated(path: Path) -> bytes:
    try:
        with gzip.open(path) as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"{path} cannot be decompressed: {error}.") from error
    if len(content) > MAX_BYTES:
        raise DataError(f"{path} has more than {MAX_BYTES >> 30} GB when it is decompressed.")
    return content


def _after_notes(path: Path, lines: list[str], start: int, layout: Layout) -> tuple[int, list[str]]:
    """Return the line of the head, below lines that begin with a mark, and remarks on these.

    The last of them is the head where it has as many fields as the samples, with the mark or
    without it.
    """
    below = start
    while below < len(lines) and (not lines[below].strip() or lines[below].startswith(MARKS)):
        below += 1
    if below in (start, len(lines)) or layout.comment or layout.header is not None:
        return start, []
    separator = _separator(path, lines[below], layout)
    last = max(k for k in range(start, below) if lines[k].strip())
    bare = lines[last].lstrip("".join(MARKS)).lstrip()
    as_it_is, without_mark, wanted = (
        len(_split(line, separator)) if line else 0 for line in (lines[last], bare, lines[below])
    )
    if without_mark == wanted != as_it_is:
        lines[last] = bare
        return last, [f"line {last + 1} is the head"]
    head = last if as_it_is == wanted else below
    return head, ["lines that begin with # or % are left out"] if head > start else []


def _above_samples(
    path: Path, lines: list[str], start: int, layout: Layout
) -> tuple[int, list[str]]:
    """Return the line of the head, directly above the samples, and remarks on what is above it.

    The samples are the lines with as many fields as the last one, and a number or nothing where
    that has a number. A table whose first line has as many fields has its head there.
    """
    own = [k for k in range(start, len(lines)) if not _is_blank(lines[k], layout.comment)]
    if layout.skip_lines or layout.header is not None or len(own) < LEAST_LINES:
        return start, []
    last = lines[own[-2]]  # the very last one may be cut off
    separator = _separator(path, last, layout)
    cells = _split(last, separator)
    decimal = layout.decimal or _decimal([(0, [""]), (1, cells)], separator)
    held = [c for c, cell in enumerate(cells) if _is_number(cell, decimal)]
    width = len(cells)
    if width < 2 or not held or len(_split(lines[own[0]], separator)) == width:
        return start, []

    def holds(k: int) -> set[str]:
        """What a line has where the samples have numbers; nothing if it has another width."""
        cells = _split(lines[own[k]], separator)
        return {
            "number" if _is_number(cells[c], decimal) else "text" if cells[c].strip() else "nothing"
            for c in held
            if len(cells) == width
        }

    head = min(len(own) - 2, MOST_NOTES)
    while head and holds(head - 1) in ({"number"}, {"number", "nothing"}):
        head -= 1
    is_text = head > 0 and holds(head - 1) in ({"text"}, {"text", "nothing"})
    if is_text and head > 1 and holds(head - 2) == {"text"}:
        head -= 2  # names, and below them units
    elif is_text and holds(head - 1) == {"text"}:
        head -= 1
    again = next((k for k in own[:head] if lines[k].strip() == lines[own[head]].strip()), None)
    if again is not None:
        raise DataError(
            f"{path}, line {own[head] + 1}: the names of the columns are there again.",
            f"They are in line {again + 1}, and samples in between would be left out.",
            f"Delete line {own[head] + 1}, or what is above it.",
        )
    return own[head], [f"the {own[head] - start} lines above line {own[head] + 1} are left out"]


def _is_blank(line: str, comment: str) -> bool:
    return not line.strip() or bool(comment and line.lstrip().startswith(comment))


def _separator(path: Path, line: str, layout: Layout) -> str:
    """Return the sign between the columns of a line: as stated, else the first that is there."""
    there = (one for one in SEPARATORS if one != layout.decimal and one in line)
    usual = "\t" if path.suffix.lower() == ".tsv" else ","
    return layout.separator or next(there, usual)


def _cells(
    lines: list[str], start: int, separator: str, comment: str
) -> list[tuple[int, list[str]]]:
    """Return the fields of each line and its number, from 1."""
    kept = [k for k in range(start, len(lines)) if not _is_blank(lines[k], comment)]
    if separator == " ":
        return [(k + 1, lines[k].split()) for k in kept]
    reader = csv.reader((lines[k] for k in kept), delimiter=separator, skipinitialspace=True)
    return [(kept[reader.line_num - 1] + 1, cells) for cells in reader]


def _split(line: str, separator: str) -> list[str]:
    return _cells([line], 0, separator, "")[0][1]


def _is_number(cell: str, decimal: str) -> bool:
    return is_number(cell.replace(decimal, "."))


def has_thousands(cell: str, decimal: str) -> bool:
    """Whether a number has another sign than the decimal one where one between thousands stands."""
    found = THOUSANDS.fullmatch(cell.strip())
    return found is not None and found["sign"] != decimal


def _column(cells: list[str], decimal: str) -> Values:
    """Return cells as numbers, or as text where one is none or where points are of thousands.

    With a decimal comma `1.500` is 1500 or 1.5. A column that has `1.5` or `0.500`, too, has
    decimal points.
    """
    pointed = [cell for cell in cells if "." in cell] if decimal == "," else []
    if pointed and all(has_thousands(cell, decimal) for cell in pointed):
        return np.array([cell.strip() for cell in cells])
    return numbers_or_text(cells, decimal)


def _decimal(rows: list[tuple[int, list[str]]], separator: str) -> str:
    """Return the decimal sign of the first numbers below a head and a line of units."""
    cells = [cell for _, cells in rows[1:4] for cell in cells]
    with_comma = any(_is_number(cell, ",") and not _is_number(cell, ".") for cell in cells)
    with_point = any(
        "." in cell and _is_number(cell, ".") and not has_thousands(cell, ",") for cell in cells
    )
    return "," if separator != "," and with_comma and not with_point else "."


def _holds_units(body: list[tuple[int, list[str]]], decimal: str) -> bool:
    """Return whether the first line below the head has no number and the second one has."""
    has_number = [any(_is_number(cell, decimal) for cell in cells) for _, cells in body[:2]]
    return has_number == [False, True]


def _unique(names: list[str]) -> list[str]:
    """Return the names with a number after each that was there before: Time, Time.2."""
    before = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [
        f"{name or 'column'}.{count}" if count > 1 or not name else name
        for name, count in zip(names, before, strict=True)
    ]


def _check_widths(path: Path, body: list[tuple[int, list[str]]], width: int, is_cut: bool) -> None:
    wrong = [place for place, (_, cells) in enumerate(body) if len(cells) != width]
    if not wrong:
        return
    (line, cells), count = body[wrong[0]], len(body) - wrong[0]
    fix = f"Delete line {line} or save the file again." if count == 1 else f"Correct line {line}."
    raise DataError(
        f"{path}, line {line}: {len(cells)} fields, not {width} as in the first line.",
        "The file ends in the middle of this line."
        if is_cut and count == 1 and len(cells) < width
        else "",
        f"{fix} {_not_samples(count)}" if count == len(wrong) <= MOST_NOTES else fix,
    )


def _not_samples(count: int) -> str:
    lines = (
        "the last line is not a sample" if count == 1 else f"the last {count} lines are not samples"
    )
    return f"If {lines}, write skip_last_lines = {count} under [data]."


def after_samples(raw: Raw, fits: Sequence[bool], first: int) -> str:
    """Return the remedy where no cell of a column from one on fits; nothing where one does.

    These are probably lines after the samples.
    """
    count = len(fits) - first
    if not raw.decimal or not first or count > MOST_NOTES or any(fits[first:]):
        return ""
    return _not_samples(count)


def bad_cell(raw: Raw, name: str) -> tuple[str, str]:
    """Return where a text column's first cell that is not a number is, with it, and the remedy."""
    cells = [str(cell).strip() for cell in raw.columns[name]]
    sign = raw.decimal or "."
    fits = [_is_number(cell, sign) and not has_thousands(cell, sign) for cell in cells]
    index = next((k for k, cell in enumerate(cells) if cell and not fits[k]), None)
    if index is None:
        return f"{raw.row(cells.index(''))} is empty", "Map another column."
    cell = cells[index]
    what = f"{raw.row(index)} holds {cell[:30]!r}"
    if has_thousands(cell, sign) and (found := THOUSANDS.fullmatch(cell)):
        bare = cell.replace(found["sign"], "")
        meant = f"Save the file without the sign between thousands, such as {bare}"
        if _is_number(cell, sign):  # a point, in a table with a decimal comma
            meant += f"; if the point is a decimal one, with a comma, {cell.replace('.', ',')}"
        return what, f"{meant}."
    if len(raw) == 1:
        return what, "It is the only line below the head: name a file with samples."
    if not raw.decimal:
        return what, "Correct the file, or map another column."
    if _is_number(cell, ","):
        return what, "If numbers have a decimal comma, write decimal = ',' under [data]."
    meant = f"If {cell!r} means that nothing was read, write missing = [{cell!r}] under [data]."
    if cell == name:
        meant = "The name of the column is there again: delete that line."
    return what, " ".join(filter(None, (after_samples(raw, fits, index), meant)))
