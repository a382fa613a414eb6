"""Validation errors of TOML files in words: which key, what is wrong, what was meant."""

import difflib
from collections.abc import Iterable

from pydantic import ValidationError

from estimation.channels import UnknownUnitError, unit_of


def explain(error: ValidationError, known: Iterable[str] = ()) -> str:
    """Return one sentence a problem: the key's path, the message, the nearest known key.

    Args:
        error: Error of pydantic.
        known: Keys to suggest for one that does not exist.
    """
    sentences = []
    for problem in error.errors():
        path = ".".join(str(part) for part in _path(problem["loc"])) or "the file"
        message = problem["msg"]
        if problem["type"] == "extra_forbidden":
            near = difflib.get_close_matches(str(problem["loc"][-1]), list(known), n=1)
            message = "there is no such key" + (f"; did you mean {near[0]!r}?" if near else "")
        elif problem["loc"] and isinstance(problem["input"], (int, float)):
            message += f", given {problem['input']}{_unit(str(problem['loc'][-1]))}"
        sentences.append(f"{path}: {message}" + ("" if message.endswith("?") else "."))
    return " ".join(sentences)


def _path(location: tuple[int | str, ...]) -> Iterable[int | str]:
    """Return where a key stands in the file, without the kind of limits pydantic chose there."""
    return (
        (part for k, part in enumerate(location) if k != 1 or location[0] != "limits")
        if len(location) > 2
        else location
    )


def _unit(key: str) -> str:
    """Return the unit a key's name ends in, with a space before it; nothing where it has none."""
    try:
        return f" {unit_of(key)}"
    except UnknownUnitError:
        return ""
