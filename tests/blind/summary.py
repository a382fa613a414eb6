"""The tables of a blind study: what came of each class, and textbook methods on the same cases."""

import itertools
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from rig.output.table import TextTable
from tests.blind.generate import CLASSES
from tests.blind.score import OUTCOMES, wilson
from tests.blind.truths import TRUTHS

SURE = (0.0, 0.5, 0.8, 0.95, 0.99, 1.01)
"""Bounds of confidence in the table of how often a name was right."""


def tables(state: Mapping[str, Any]) -> list[TextTable]:
    """Return the summary of what has been scored: classes, and textbook methods where they ran."""
    rows = []
    for kind in CLASSES:
        done = [r for r in state.values() if r["kind"] == kind]
        if not done:
            continue
        good, wrong = (sum(map(test, done)) for test in (lambda r: r["right"], _harmful))
        counts = [str(sum(r["outcome"] == name for r in done)) for name in OUTCOMES]
        seconds = sorted(r["seconds"] for r in done)[len(done) // 2]
        rows.append(
            [
                kind,
                str(len(done)),
                _share(good, len(done)),
                _share(wrong, len(done)),
                *counts,
                _median([r["ratio"] for r in done if r.get("ratio") is not None]),
                f"{seconds:.1f}",
            ]
        )
    columns = ["class", "cases", "right (95 %)", "wrong (95 %)", *OUTCOMES, "error", "median s"]
    note = "Right: named; confounded: the whole set and a next experiment; outside: the right "
    note += "variables and no name; control: nothing. Wrong: a confident wrong name or, in a "
    note += (
        "control, any finding. Intervals are Wilson's. Error: on the confirm runs, over that of "
    )
    note += (
        "the true structure fitted by its own optimiser, median of the named cases (their number)."
    )
    found = [TextTable("Diagnosis of undeclared effects", columns, rows, note)]
    sure = _sureness(list(state.values()))
    if sure.rows:
        found.append(sure)
    picked = [(r, one) for r in state.values() for one in r.get("baselines", [])]
    if picked:
        found.append(_textbook(picked))
    return found


def _sureness(done: Sequence[Any]) -> TextTable:
    """Return how often a name was right among the findings that were so sure of it."""
    said: list[tuple[float, bool]] = []
    for result in done:
        truths = [TRUTHS[name] for name in result["hidden"]]
        for _, balance, family, confidence, also_in in result["found"]:
            if confidence is not None:
                shown = {balance, *also_in}
                true = any(t.names(family) and shown & t.balances for t in truths)
                said.append((confidence, true))
    rows = []
    for low, high in itertools.pairwise(SURE):
        within = [true for confidence, true in said if low <= confidence < high]
        if within:
            rows.append([f"{low:g} to {min(high, 1.0):g}", _share(sum(within), len(within))])
    note = (
        "Findings that name an effect, first names of `one_of` too, by the confidence they state."
    )
    return TextTable("How sure, and how often right", ["confidence", "right (95 %)"], rows, note)


def _textbook(picked: Sequence[tuple[Any, Any]]) -> TextTable:
    own = {id(result): (result, _named(result)) for result, _ in picked}
    rows = [_method("rig diagnose", list(own.values()))]
    for method in dict.fromkeys(one["method"] for _, one in picked):
        rows.append(_method(method, [(r, one) for r, one in picked if one["method"] == method]))
    note = "On all four balances, the catalogue at every point of its grid as library; of rig "
    note += (
        "diagnose what it says is identified. Seconds of the textbook methods are without making "
    )
    note += "the columns."
    return TextTable(
        "Beside textbook methods",
        ["method", "right names (95 %)", "false names a case", "s a case"],
        rows,
        note,
    )


def _method(name: str, said: Sequence[tuple[Any, Any]]) -> list[str]:
    hidden = sum(len(result["hidden"]) for result, _ in said)
    hits = sum(one["right"] for _, one in said)
    false = sum(one["false"] for _, one in said) / len(said)
    seconds = sum(one["seconds"] for _, one in said) / len(said)
    return [name, _share(hits, hidden), f"{false:.2f}", f"{seconds:.1f}"]


def _named(result: Any) -> dict[str, Any]:
    """Return what a diagnosis called identified, counted as the textbook methods' names are."""
    families = [family for verdict, _, family, *_ in result["found"] if verdict == "identified"]
    return counted(families, result["hidden"]) | {"seconds": result["seconds"]}


def counted(families: Sequence[str], hidden: Sequence[str]) -> dict[str, int]:
    """Return how many hidden effects are among some names, and how many names are none of them."""
    truths = [TRUTHS[name] for name in hidden]
    return {
        "right": sum(any(truth.names(family) for family in families) for truth in truths),
        "false": sum(not any(truth.names(family) for truth in truths) for family in families),
    }


def _median(ratios: Sequence[float]) -> str:
    return f"{median(ratios):.2f} ({len(ratios)})" if ratios else "-"


def _harmful(result: Mapping[str, Any]) -> bool:
    return result["outcome"] in ("wrong name", "false finding")


def _share(hits: int, total: int) -> str:
    low, high = wilson(hits, total)
    return f"{hits}/{total} ({100 * low:.0f}-{100 * high:.0f} %)"
