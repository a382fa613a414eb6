"""Samples as JSON: one object a line, a list of objects, or an object that holds such a list."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rig.errors import DataError
from rig.importers.table.data import Layout
from rig.importers.table.raw import Raw, Values, nested, numbers_or_text


def read_json(path: Path, layout: Layout) -> Raw:
    """Read samples that are objects; an object inside one is called `outer.inner`.

    Values around a list of samples are single values of the file.

    Raises:
        DataError: It is not JSON, or no list of samples is in it.
    """
    try:
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(f"{path} is not text, so it is not JSON.") from error
    if not text.strip():
        raise DataError(f"{path} is empty.", fix="Name a file with samples.")
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as error:
        if path.suffix.lower() == ".json" and error.msg != "Extra data":
            raise DataError(
                f"{path}, line {error.lineno}: {error.msg}.",
                "The file is cut off or not JSON. Nothing of it was imported.",
                "Copy or save it again.",
            ) from error
        return _of_lines(path, text)
    if isinstance(whole, list):
        return _of_rows(path, whole, {})
    if not isinstance(whole, dict):
        raise DataError(f"{path} holds no samples.", "Objects with one key a column are expected.")
    lists = {k: v for k, v in nested(whole) if isinstance(v, list) and v}
    key = layout.rows or _only(path, lists)
    if key not in lists:
        raise DataError(
            f"{path} has no list {key!r}.", f"Its lists are {', '.join(lists) or 'none'}."
        )
    fields = {
        k: v if isinstance(v, str) else float(v)
        for k, v in nested(whole)
        if isinstance(v, int | float | str)
    }
    if isinstance(lists[key][0], dict):
        return _of_rows(path, lists[key], fields)
    return Raw(path, {k: _column([str(c) for c in v]) for k, v in lists.items()}, fields)


def _only(path: Path, lists: Mapping[str, list[Any]]) -> str:
    """Return the key of the only list of objects, or of any list where none holds objects."""
    of_objects = [key for key, value in lists.items() if isinstance(value[0], dict)]
    if len(of_objects) > 1 or not lists:
        raise DataError(
            f"{path} has {len(of_objects)} lists of samples.",
            f"They are {', '.join(of_objects)}." if of_objects else "Objects are expected.",
            "State which one with rows, in [data] of the machine's file." if of_objects else "",
        )
    return (of_objects or list(lists))[0]


def _of_lines(path: Path, text: str) -> Raw:
    rows = []
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    for number, line in lines:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError as error:
            raise DataError(
                f"{path}, line {number}: {error.msg}.",
                "The file ends in the middle of this line." if number == lines[-1][0] else "",
                f"Delete line {number} or save the file again.",
            ) from error
    return _of_rows(path, rows, {}, lines[0][0])


def _of_rows(path: Path, rows: list[Any], fields: dict[str, Any], first_line: int = 0) -> Raw:
    if not all(isinstance(row, dict) for row in rows):
        raise DataError(f"{path}: a sample is not a JSON object with one key a column.")
    flat = [dict(_spread(row)) for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    columns = {name: _column([row.get(name, "") for row in flat]) for name in names}
    return Raw(path, columns, fields, first_line=first_line)


def _column(cells: list[Any]) -> Values:
    return numbers_or_text([_text(cell) for cell in cells])


def _text(cell: Any) -> str:
    if isinstance(cell, bool):
        return str(int(cell))
    return "" if cell is None else str(cell)


def _spread(row: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the values of a sample; a list becomes `q.1`, `q.2` and so on."""
    for name, value in nested(row):
        if isinstance(value, list):
            yield from ((f"{name}.{k + 1}", one) for k, one in enumerate(value))
        else:
            yield name, value
