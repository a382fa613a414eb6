"""Holding a diagnosis against the answer, and counting with Wilson's intervals."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from tests.blind.generate import Answer
from tests.blind.truths import TRUTHS, Truth

OUTCOMES = (
    "right name",
    "one of",
    "depends on",
    "something missing",
    "nothing found",
    "wrong name",
    "false finding",
    "failed",
)
"""What a diagnosis can come to. A wrong name counts whatever else was right."""


def outcome(answer: Answer, diagnosis: Mapping[str, Any] | None) -> str:
    """Return which of `OUTCOMES` a diagnosis is.

    Args:
        answer: What is hidden.
        diagnosis: The command's JSON, or None when it gave none.
    """
    if diagnosis is None:
        return "failed"
    findings = diagnosis["findings"]
    if answer.kind == "control":
        return "false finding" if findings else "nothing found"
    if not findings:
        return "nothing found"
    truths = [TRUTHS[effect.name] for effect in answer.effects]
    if any(_wrong(finding, truths, answer.either) for finding in findings):
        return "wrong name"
    if answer.kind == "confounded":
        sets = [{f["family"], *f["alternatives"]} for f in findings if f["verdict"] == "one_of"]
        whole = any(set(answer.either) <= named for named in sets)
        proposed = diagnosis.get("next_experiment") is not None
        return "one of" if whole and proposed else "something missing"
    levels = [_level(truth, findings) for truth in truths]
    return max(levels, key=OUTCOMES.index)  # of a pair the lesser


def right(answer: Answer, result: str) -> bool:
    """Say whether an outcome is what the case asks for."""
    if answer.kind == "control":
        return result == "nothing found"
    if answer.kind == "outside":
        return result == "depends on"
    return result == ("one of" if answer.kind == "confounded" else "right name")


def _shows(finding: Mapping[str, Any], truth: Truth) -> bool:
    return bool({finding["balance"], *finding["also_in"]} & truth.balances)


def _wrong(finding: Mapping[str, Any], truths: Sequence[Truth], either: Sequence[str]) -> bool:
    if finding["verdict"] != "identified":
        return False
    family = finding["family"]
    if either:  # on these runs any single name is more than can be known
        return True
    return not any(truth.names(family) and _shows(finding, truth) for truth in truths)


def _level(truth: Truth, findings: Sequence[Mapping[str, Any]]) -> str:
    """Return the best that was said of one effect."""
    said = {"nothing found"}
    for finding in findings:
        if not _shows(finding, truth):
            continue
        families = {finding["family"], *finding["alternatives"]}
        named = finding["verdict"] in ("identified", "one_of")
        if named and all(map(truth.names, families)):
            said.add("right name")  # rivals that no sensor tells apart are one name
        elif finding["verdict"] == "one_of" and any(map(truth.names, families)):
            said.add("one of")
        elif finding["verdict"] == "depends_on" and (
            not truth.depends_on or truth.variables_right(finding["depends_on"])
        ):
            said.add("depends on")
        elif finding["verdict"] in ("depends_on", "something_missing"):
            said.add("something missing")
    return min(said, key=OUTCOMES.index)


def wilson(hits: int, total: int, z: float = 1.959964) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson, JASA 22, 1927); (0, 1) for no case."""
    if total == 0:
        return 0.0, 1.0
    share, weight = hits / total, z * z / total
    middle = (share + weight / 2) / (1 + weight)
    half = z * math.sqrt(share * (1 - share) / total + weight / (4 * total)) / (1 + weight)
    return max(middle - half, 0.0), min(middle + half, 1.0)
