"""Validation errors of TOML files in words: which key, what is wrong, what was meant."""

import difflib
import re
from collections.abc import Iterable, Sequence

from pydantic import ValidationError

from estimation.channels import UnknownUnitError, unit_of

HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(#.*)?$")
"""The line that begins a table of TOML, or one of an array of tables."""

KEY = re.compile(r"\s*([\w\"'.\s-]+?)\s*=")
"""The beginning of a line that gives a key its value."""


def explain(error: ValidationError, known: Iterable[str] = (), text: str = "") -> str:
    """Return one line a problem: where it stands, the message, the nearest known key.

    With the TOML that was read each problem names its line.
    """
    sentences = []
    for problem in error.errors():
        path = ".".join(str(part) for part in problem["loc"]) or "the file"
        message = problem["msg"]
        if problem["type"] == "extra_forbidden":
            near = difflib.get_close_matches(str(problem["loc"][-1]), list(known), n=1)
            message = "there is no such key" + (f"; did you mean {near[0]!r}?" if near else "")
        elif problem["loc"] and isinstance(problem["input"], (int, float)):
            message += f", given {problem['input']}{_unit(str(problem['loc'][-1]))}"
        number = line_of(text, problem["loc"])
        place = f"line {number}, {path}" if number else path
        sentences.append(f"{place}: {message}" + ("" if message.endswith("?") else "."))
    return "\n".join(sentences)


def line_of(text: str, path: Sequence[int | str]) -> int | None:
    """Return the line of TOML text where a key stands, from 1; of a missing key its table's.

    The path is the keys from the top, a number for each place in an array of tables. A key inside
    an inline table stands where that table does. None where nothing is there.
    """
    table: list[int | str] = []
    arrays: dict[tuple[int | str, ...], int] = {}
    nearest, depth = None, 0
    for number, line in enumerate(text.splitlines(), start=1):
        if header := HEADER.match(line):
            table = [part.strip(" \"'") for part in header[2].split(".")]
            if len(header[1]) == 2:
                arrays[tuple(table)] = arrays.get(tuple(table), -1) + 1
                table.append(arrays[tuple(table)])
            own = table
        elif key := KEY.match(line):
            own = [*table, *(part.strip(" \"'") for part in key[1].split("."))]
        else:
            continue
        if own == list(path[: len(own)]) and len(own) > depth:
            nearest, depth = number, len(own)
    return nearest


def _unit(key: str) -> str:
    try:
        return f" {unit_of(key)}"
    except UnknownUnitError:
        return ""
