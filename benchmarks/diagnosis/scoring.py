"""Judging an answer about a case of the own simulator."""

from collections.abc import Sequence

from benchmarks.diagnosis.case import SURE, Judgement, Report
from benchmarks.diagnosis.draw import Answer
from benchmarks.diagnosis.truths import TRUTHS, Truth

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
"""So many runs may be misjudged where an effect is in some runs only: it may hardly show in one."""


def judge(answer: Answer, runs: Sequence[str], report: Report) -> Judgement:
    """Judge an answer.

    Args:
        answer: What is hidden.
        runs: Names of the case's runs, in order.
        report: The JSON answer.
    """
    findings = report["findings"]
    wrong = [f for f in findings if _wrong(f, answer)]
    reached = outcome(answer, report)
    right = reached == RIGHT.get(answer.kind, OUTCOMES[0])
    if right and answer.kind == "some_runs":
        affected = {runs[index] for index in answer.runs}
        off = min(len(affected ^ set(f["runs_affected"])) for f in findings)
        right = off <= OFF
        reached += f", {off} runs wrong"
    truths = _truths(answer)
    named = {f["balance"] for f in findings if any(_shows(f, t) for t in truths)}
    return Judgement(
        right,
        sure_and_wrong=any((f["confidence"] or 0.0) >= SURE for f in wrong),
        extra=0 if answer.kind == "clean" else len(wrong),
        equations=tuple(sorted(named)) if right and not answer.either else (),
        note=reached,
    )


def judge_next(answer: Answer, report: Report) -> Judgement:
    """Judge an answer about a confounded case after the runs that should settle it."""
    return Judgement(_best(answer, report) == OUTCOMES[0], note=_best(answer, report))


def outcome(answer: Answer, report: Report) -> str:
    """Return which of `OUTCOMES` an answer is."""
    findings = report["findings"]
    if answer.kind == "clean":
        return "false finding" if findings else "nothing found"
    if any(_wrong(finding, answer) for finding in findings):
        return "wrong name"
    if answer.either:
        sets = [{f["family"], *f["alternatives"]} for f in findings if f["verdict"] == "one_of"]
        whole = any(set(answer.either) <= named for named in sets)
        proposed = report.get("next_experiment") is not None
        return "one of" if whole and proposed else "something missing"
    return _best(answer, report)


def _best(answer: Answer, report: Report) -> str:
    """Return the best that was said of the hidden effects; of a pair, of the lesser half."""
    levels = [_level(truth, report["findings"]) for truth in _truths(answer)]
    return max(levels, key=OUTCOMES.index)


def _truths(answer: Answer) -> list[Truth]:
    return [TRUTHS[effect.name] for effect in answer.effects]


def _shows(finding: Report, truth: Truth) -> bool:
    return bool({finding["balance"], *finding["also_in"]} & truth.balances)


def _wrong(finding: Report, answer: Answer) -> bool:
    if answer.kind == "clean":
        return True
    if finding["verdict"] != "identified":
        return False
    if answer.either:  # on these runs any single name is more than can be known
        return True
    named = (t for t in _truths(answer) if t.names(finding["family"]))
    return not any(_shows(finding, truth) for truth in named)


def _level(truth: Truth, findings: Sequence[Report]) -> str:
    """Return the best that was said of one effect."""
    said = {"nothing found"}
    for finding in findings:
        if not _shows(finding, truth):
            continue
        families = {finding["family"], *finding["alternatives"]}
        named = finding["verdict"] in ("identified", "one_of")
        if named and all(map(truth.names, families)):
            said.add("right name")  # effects that no sensor distinguishes are one name
        elif finding["verdict"] == "one_of" and any(map(truth.names, families)):
            said.add("one of")
        elif finding["verdict"] == "depends_on" and (
            not truth.depends_on or truth.variables_right(finding["depends_on"])
        ):
            said.add("depends on")
        elif finding["verdict"] in ("depends_on", "something_missing"):
            said.add("something missing")
    return min(said, key=OUTCOMES.index)
