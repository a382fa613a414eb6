"""Searching campaigns by words and by values: `maryland frequency_hz>=0.5 verdict=identified`."""

import difflib
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rig.campaigns.index import IndexedCampaign, IndexedRun
from rig.errors import UsageError

COMPARISONS: Mapping[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "!=": operator.ne,
    "=": operator.eq,
    "<": operator.lt,
    ">": operator.gt,
}
TERM = re.compile(r"([A-Za-z_]\w*)(<=|>=|!=|=|<|>)(.*)")

FIELDS = ("date", "rig", "instrument", "protocol", "notes", "state", "samples", "lost")
"""Fields of a run that can be compared, next to its conditions."""

VERDICT = "verdict"


@dataclass(frozen=True)
class Comparison:
    """One condition of a search.

    Attributes:
        name: Field or condition.
        sign: Key of `COMPARISONS`.
        text: The value, as typed.
    """

    name: str
    sign: str
    text: str


def search(campaigns: Sequence[IndexedCampaign], terms: Sequence[str]) -> list[IndexedCampaign]:
    """Return the campaigns with a run that meets every term, with these runs only.

    Args:
        campaigns: All campaigns.
        terms: `NAME=VALUE` and the like compare a field or a condition of a run; other words are
            looked for in the campaign's folder, fields, notes and findings.

    Raises:
        UsageError: A name that no run has.
    """
    comparisons = [c for term in terms if (c := comparison(term)) is not None]
    words = [term.lower() for term in terms if comparison(term) is None]
    _check_names(campaigns, comparisons)
    found = []
    for campaign in campaigns:
        of_all = f"{campaign.folder} {_findings(campaign)}".lower()
        runs = [
            run
            for run in campaign.runs
            if all(word in of_all or word in _text(run) for word in words)
            and all(_meets(run, campaign, one) for one in comparisons)
        ]
        if runs:
            found.append(replace(campaign, runs=tuple(runs)))
    return found


def comparison(term: str) -> Comparison | None:
    """Return a term as a comparison; None for a word."""
    parsed = TERM.fullmatch(term)
    if parsed is None:
        return None
    return Comparison(*parsed.groups())


def verdict(campaign: IndexedCampaign) -> str:
    """Return the verdict of a campaign's diagnosis; empty without one."""
    return str(campaign.diagnosis["verdict"]) if campaign.diagnosis else ""


def families(campaign: IndexedCampaign) -> list[str]:
    """Return the effects that a campaign's diagnosis found."""
    found = campaign.diagnosis["findings"] if campaign.diagnosis else []
    return [str(finding["family"]) for finding in found]


def _findings(campaign: IndexedCampaign) -> str:
    return " ".join([verdict(campaign), *families(campaign)])


def _text(run: IndexedRun) -> str:
    values = (run.name, run.rig, run.instrument, run.protocol, run.notes, run.state, run.date)
    words = [value for value in run.conditions.values() if isinstance(value, str)]
    return " ".join([*values, *words]).lower()


def _meets(run: IndexedRun, campaign: IndexedCampaign, one: Comparison) -> bool:
    value: Any
    if one.name == VERDICT:
        value = verdict(campaign)
    elif one.name in FIELDS:
        value = getattr(run, one.name)
    else:
        value = run.conditions.get(one.name)
    if value is None:
        return False
    if isinstance(value, str):
        if one.sign in ("=", "!="):
            return (one.text.lower() in value.lower()) == (one.sign == "=")
        return COMPARISONS[one.sign](value, one.text)
    try:
        return COMPARISONS[one.sign](value, float(one.text))
    except ValueError:
        return False


def _check_names(campaigns: Sequence[IndexedCampaign], asked: Sequence[Comparison]) -> None:
    if not asked:
        return
    known = {*FIELDS, VERDICT}
    for campaign in campaigns:
        for run in campaign.runs:
            known.update(run.conditions)
    for one in asked:
        if one.name not in known:
            near = difflib.get_close_matches(one.name, known, n=1, cutoff=0.4)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise UsageError(
                f"No run has a condition {one.name!r}.",
                f"Known: {', '.join(sorted(known))}.",
                f"{hint}Words without a comparison are looked for in all texts.",
            )
