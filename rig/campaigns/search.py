"""Searching campaigns by words and by values: `maryland frequency_hz>=0.5 verdict=identified`."""

import difflib
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rig.campaigns.index import IndexedCampaign, IndexedRun
from rig.errors import UsageError
from rig.importers.table.raw import is_number

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


Comparison = tuple[str, str, str]
"""Field or condition, key of `COMPARISONS`, and the value as typed."""


def search(campaigns: Sequence[IndexedCampaign], terms: Sequence[str]) -> list[IndexedCampaign]:
    """Return the campaigns with a run that meets every term, with these runs only.

    `NAME=VALUE` and the like compare a field or a condition of a run; other words are looked for in
    the campaign's folder, fields, notes and findings.

    Raises:
        UsageError: A name that no run has, or a word that is compared with numbers alone.
    """
    comparisons = [(p[1], p[2], p[3]) for term in terms if (p := TERM.fullmatch(term))]
    words = [term.lower() for term in terms if not TERM.fullmatch(term)]
    _check_names(campaigns, [name for name, _, _ in comparisons])
    for one in comparisons:
        _check_value(campaigns, *one)
    found = []
    for campaign in campaigns:
        of_all = " ".join([str(campaign.folder), verdict(campaign), *families(campaign)]).lower()
        runs = [
            run
            for run in campaign.runs
            if all(word in of_all or word in _text(run) for word in words)
            and all(_meets(run, campaign, one) for one in comparisons)
        ]
        if runs:
            found.append(replace(campaign, runs=tuple(runs)))
    return found


def verdict(campaign: IndexedCampaign) -> str:
    """Return the verdict of a campaign's diagnosis; empty without one."""
    return str(campaign.diagnosis["verdict"]) if campaign.diagnosis else ""


def families(campaign: IndexedCampaign) -> list[str]:
    """Return the effects that a campaign's diagnosis found."""
    found = campaign.diagnosis["findings"] if campaign.diagnosis else []
    return [str(finding["family"]) for finding in found]


def _text(run: IndexedRun) -> str:
    values = (run.name, run.rig, run.instrument, run.protocol, run.notes, run.state, run.date)
    words = [value for value in run.conditions.values() if isinstance(value, str)]
    return " ".join([*values, *words]).lower()


def _meets(run: IndexedRun, campaign: IndexedCampaign, one: Comparison) -> bool:
    name, sign, text = one
    value = _value(run, campaign, name)
    if value is None:
        return False
    if isinstance(value, str):
        if sign in ("=", "!="):
            return (text.lower() in value.lower()) == (sign == "=")
        return COMPARISONS[sign](value, text)
    try:
        return COMPARISONS[sign](value, float(text))
    except ValueError:
        return False


def _value(run: IndexedRun, campaign: IndexedCampaign, name: str) -> Any:
    """Return a field or a condition of a run; None where it has none of this name."""
    known = {**run.conditions, **{field: getattr(run, field) for field in FIELDS}}
    return verdict(campaign) if name == VERDICT else known.get(name)


def _check_value(campaigns: Sequence[IndexedCampaign], name: str, sign: str, text: str) -> None:
    """Refuse a word where every run has a number."""
    values = [_value(run, campaign, name) for campaign in campaigns for run in campaign.runs]
    there = [value for value in values if value is not None]
    if is_number(text) or not there or any(isinstance(value, str) for value in there):
        return
    raise UsageError(
        f"{name}{sign}{text}: {text!r} is not a number.",
        f"{name} is a number in every run, from {min(there):g} to {max(there):g}.",
        f"Write a number with a point, such as '{name}{sign}{min(there):g}'.",
    )


def _check_names(campaigns: Sequence[IndexedCampaign], asked: Sequence[str]) -> None:
    runs = [run for campaign in campaigns for run in campaign.runs]
    known = {*FIELDS, VERDICT}.union(*(run.conditions for run in runs))
    for name in asked:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise UsageError(
                f"No run has a condition {name!r}.",
                f"Known: {', '.join(sorted(known))}.",
                f"{hint}Words without a comparison are looked for in all texts.",
            )
