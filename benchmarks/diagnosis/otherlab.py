"""Cases of a simulator that shares no line with this project, given by the path of its folder.

The folder holds `cases.py` (`ALL`: cases with `name`, `kind`, `args` and the accepted answers),
`rigsim.py` (`make_case(folder, **args)` writes the text logs of a case) and `score.py`
(`judge(case, report)` returns a row with `ok`, `extra` and `confidence`).
"""

import importlib
import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from benchmarks.diagnosis.case import SURE, Case, Judgement, Report

KINDS = {
    "pair": "pair",
    "off": "outside",
    "cond": "some_runs",
    "confounded": "confounded",
    "control": "clean",
}
NO_EFFECT = {"ea": "none", "aa": 0.0, "eb": "none", "ab": 0.0}


def cases(path: Path) -> Iterator[Case]:
    """Yield the cases, those of different groups in turn.

    A group is the first word of a case's name; of the clean ones, the second too.
    """
    groups: dict[tuple[str, ...], list[Any]] = {}
    for one in listed(path):
        words = one["name"].split("-")
        groups.setdefault(tuple(words[: 1 + (one["kind"] == "control")]), []).append(one)
    simulator, scorer = map(importlib.import_module, ("rigsim", "score"))
    for turn in itertools.zip_longest(*groups.values()):
        yield from (_case(one, simulator, scorer) for one in turn if one is not None)


def listed(path: Path) -> list[dict[str, Any]]:
    """Return the cases as the simulator lists them."""
    if str(path) not in sys.path:
        sys.path.insert(0, str(path))
    found: list[dict[str, Any]] = importlib.import_module("cases").ALL
    return found


def _case(one: dict[str, Any], simulator: ModuleType, scorer: ModuleType) -> Case:
    def write(folder: Path) -> None:
        simulator.make_case(str(folder), **one["args"])

    def write_without(folder: Path) -> None:
        simulator.make_case(str(folder), **one["args"] | NO_EFFECT)

    single = "strong" if one["name"].startswith("s-") else "weak"
    kind = KINDS.get(one["kind"], single)
    return Case(
        one["name"],
        kind,
        write,
        lambda report: _judged(one, scorer.judge(one, report), report),
        None if kind == "clean" else write_without,
    )


def _judged(one: dict[str, Any], row: dict[str, Any], report: Report) -> Judgement:
    """Return the score of an answer by the simulator's own scorer.

    Sure and wrong is a case that is not right although its first finding was stated surely, and
    in a pair is neither of the two effects.
    """
    findings = report["findings"]
    true = {*one["accept"], *(one["pair"] or [])}
    half = bool(one["pair"]) and any(f["family"] in true for f in findings[:1])
    anywhere = bool(one["pair"]) or one["balance"] == "any"
    equations = {
        f["balance"]
        for f in findings
        if f["family"] in true and (anywhere or f["balance"] == one["balance"])
    }
    return Judgement(
        bool(row["ok"]),
        sure_and_wrong=not row["ok"] and not half and (row["confidence"] or 0.0) >= SURE,
        extra=int(row["extra"]),
        equations=tuple(sorted(equations)) if row["ok"] and not one["confused"] else (),
        note=str(row["why"]),
    )
