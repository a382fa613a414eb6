"""Judging an answer about a simulated campaign by what was hidden in it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from benchmarks.diagnosis.case import SURE, Judgement, Report

OUTCOMES = (
    "right name",
    "one of",
    "depends on",
    "something missing",
    "nothing found",
    "wrong name",
    "false finding",
)
"""What an answer can come to. A wrong name counts whatever else was right."""

RIGHT = {"clean": "nothing found", "outside": "depends on", "confounded": "one of"}
"""The outcome that a kind of case asks for; of the other kinds the first one."""

OFF = 1
"""So many runs may be misjudged where an effect is in some runs only: it may be invisible in
one."""


@dataclass(frozen=True)
class Hidden:
    """One hidden effect, as an answer is held against it.

    Attributes:
        families: Its family, and those that no sensor of the rig distinguishes from it.
        equations: Equations in which it shows.
        variables: For what no catalogue holds: groups of variables that mean the same on one rig;
            each must be named, and no other.
    """

    families: Collection[str]
    equations: Collection[str]
    variables: Sequence[Collection[str]] = ()


@dataclass(frozen=True)
class Truth:
    """What is hidden in a case.

    Attributes:
        hidden: The effects; none in a clean case.
        runs: Names of the runs that have them.
        either: In a confounded case: families that its runs cannot distinguish; else empty.
    """

    kind: str
    hidden: Sequence[Hidden]
    runs: Collection[str]
    either: Collection[str] = ()


def judge(truth: Truth, report: Report) -> Judgement:
    """Judge an answer."""
    findings = report["findings"]
    wrong = [f for f in findings if _wrong(f, truth)]
    reached = outcome(truth, report)
    right = reached == RIGHT.get(truth.kind, OUTCOMES[0])
    if right and truth.kind == "some_runs":
        off = min(len({*truth.runs} ^ {*f["runs_affected"]}) for f in findings)
        right = off <= OFF
        reached += f", {off} runs wrong"
    named = {f["balance"] for f in findings if any(_shows(f, h) for h in truth.hidden)}
    return Judgement(
        right,
        sure_and_wrong=any((f["confidence"] or 0.0) >= SURE for f in wrong),
        extra=0 if truth.kind == "clean" else len(wrong),
        equations=tuple(sorted(named)) if right and not truth.either else (),
        note=reached,
    )


def judge_next(truth: Truth, report: Report) -> Judgement:
    """Judge an answer about a confounded case after the runs that should settle it."""
    best = _best(truth, report)
    single = all(f["verdict"] == "identified" for f in report["findings"])
    return Judgement(best == OUTCOMES[0] and single, note=best)


def outcome(truth: Truth, report: Report) -> str:
    """Return which of `OUTCOMES` an answer is."""
    findings = report["findings"]
    if truth.kind == "clean":
        return "false finding" if findings else "nothing found"
    if any(_wrong(finding, truth) for finding in findings):
        return "wrong name"
    if truth.either:
        sets = [{f["family"], *f["alternatives"]} for f in findings if f["verdict"] == "one_of"]
        whole = any({*truth.either} <= named for named in sets)
        proposed = report.get("next_experiment") is not None
        return "one of" if whole and proposed else "something missing"
    return _best(truth, report)


def _best(truth: Truth, report: Report) -> str:
    """Return the best that was said of the hidden effects; of a pair, of the lesser half."""
    levels = [_level(hidden, report["findings"]) for hidden in truth.hidden]
    return max(levels, key=OUTCOMES.index)


def _shows(finding: Report, hidden: Hidden) -> bool:
    return bool({finding["balance"], *finding["also_in"]} & {*hidden.equations})


def _wrong(finding: Report, truth: Truth) -> bool:
    if truth.kind == "clean":
        return True
    if finding["verdict"] != "identified":
        return False
    if truth.either:  # on these runs any single name is more than can be known
        return True
    named = (h for h in truth.hidden if finding["family"] in h.families)
    return not any(_shows(finding, hidden) for hidden in named)


def _level(hidden: Hidden, findings: Sequence[Report]) -> str:
    """Return the best that was said of one effect."""
    said = {"nothing found"}
    for finding in findings:
        if not _shows(finding, hidden):
            continue
        families = {finding["family"], *finding["alternatives"]}
        named = finding["verdict"] in ("identified", "one_of")
        if named and finding["family"] in hidden.families:
            said.add("right name")  # alone or as the likeliest of a set
        elif finding["verdict"] == "one_of" and families & {*hidden.families}:
            said.add("one of")
        elif finding["verdict"] == "depends_on" and _variables_right(hidden, finding):
            said.add("depends on")
        elif finding["verdict"] in ("depends_on", "something_missing"):
            said.add("something missing")
    return min(said, key=OUTCOMES.index)


def _variables_right(hidden: Hidden, finding: Report) -> bool:
    said = {*finding["depends_on"]}
    known = {variable for group in hidden.variables for variable in group}
    return not hidden.variables or (said <= known and all(said & {*g} for g in hidden.variables))
