"""Validation errors of TOML files in words: which key, what is wrong, what was meant."""

import difflib
from collections.abc import Iterable

from pydantic import ValidationError


def explain(error: ValidationError, known: Iterable[str] = ()) -> str:
    """Return one sentence a problem: the key's path, the message, the nearest known key.

    Args:
        error: What pydantic found.
        known: Keys to suggest for one that does not exist.
    """
    sentences = []
    for problem in error.errors():
        path = ".".join(str(part) for part in problem["loc"]) or "the file"
        message = problem["msg"]
        if problem["type"] == "extra_forbidden":
            near = difflib.get_close_matches(str(problem["loc"][-1]), list(known), n=1)
            message = "there is no such key" + (f"; did you mean {near[0]!r}?" if near else "")
        sentences.append(f"{path}: {message}.")
    return " ".join(sentences)
