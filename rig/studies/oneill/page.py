"""The page of the study of O'Neill et al. 2018."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.recording import FloatArray
from rig.output.figures import against, over_time
from rig.output.page import Page
from rig.output.table import TextTable, to_markdown
from rig.studies.coverage import coverage
from rig.studies.oneill import goals
from rig.studies.oneill import networks_page as networks
from rig.studies.oneill import states_page as states
from rig.studies.oneill.kinds import KindRow
from rig.studies.oneill.networks import NetworkStudy
from rig.studies.oneill.paper import FILTERS, HELD_OUT, PROTOCOLS, SHOWN
from rig.studies.oneill.states import Shown, StateStudy
from rig.studies.oneill.study import Study

TITLE = "Grip torque and jaw angle from motor current: O'Neill et al. 2018, made again"


@dataclass(frozen=True)
class OneillPage(Page):
    """The page, whose Markdown has its first table above the remarks, and figures with captions."""

    lead: int = 1  # how many of the paragraphs are the result
    captions: Sequence[str] = ()

    def markdown(self, places: Sequence[str] = ()) -> str:
        """Return the page as Markdown, with its figures at places relative to it."""
        first, *others = (to_markdown(table).rstrip() for table in self.tables)
        known = "\n".join(f"- {note}" for note in self.paragraphs[self.lead :])
        parts = [f"# {self.title}", *self.paragraphs[: self.lead], first]
        parts += ["## Before comparing", known, *(["## Figures"] if places else [])]
        for caption, place in zip(self.captions, places, strict=False):
            parts += [f"![{caption}]({place})", caption]
        return "\n\n".join([*parts, *others, self.provenance.line()]) + "\n"


def page(
    study: Study,
    deep: NetworkStudy | None = None,
    physical: StateStudy | None = None,
    kinds: Sequence[KindRow] = (),
    shown: Mapping[str, Sequence[Shown]] | None = None,
) -> Page:
    """Return the study's page: what is reached, the paper's tables, all by what was held out."""
    found = goals.reached(physical, deep) if physical is not None else []
    lead = list(goals.lead(found)) or [_lead(study)]
    tables = [*networks.paper_tables(study, deep), _held_out_table(study)]
    notes = [f"Data: {study.source}.", *_notes(study)]
    if found:
        tables.insert(0, goals.table(found))
    if deep is not None:
        tables += networks.tables(deep)
        notes += networks.notes(deep)
    if kinds:
        tables.append(_kinds_table(kinds))
    if physical is not None:
        tables += states.tables(physical)
        notes += states.notes(physical)
    drawn = _drawn(shown or {})
    return OneillPage(
        TITLE,
        [*lead, *notes],
        [*tables, coverage("oneill")],
        study.provenance,
        lambda: {name: figure for name, (_, figure) in drawn.items()},
        len(lead),
        [caption for caption, _ in drawn.values()],
    )


VARIABLES = {"spindle angle, rad": 0, "motor speed, rad/s": 2, "command (load)": 1}
"""Channels of a row, by what the error is drawn over."""


def _drawn(shown: Mapping[str, Sequence[Shown]]) -> dict[str, tuple[str, str]]:
    """Return caption and figure by name, of the runs of each target."""
    drawn = {}
    for target, runs in shown.items():
        name, unit, scale = SHOWN[target]
        stem = f"oneill-{name.replace(' ', '-')}"
        errors = [np.mean((run.after - run.truth) ** 2) for run in runs]
        run = runs[int(np.argsort(errors)[len(errors) // 2])]
        caption = (
            f"{name.capitalize()}, closing samples of run {run.name}, the run of median error: the"
            " sensor, a straight line through the command, and physical states, live, both"
            " fitted on other runs."
        )
        series = {"sensor": run.truth, "line": run.before, "states": run.after}
        time_s, lines = _gapped(run.time_s, {k: scale * v for k, v in series.items()})
        figure = over_time(time_s, lines, f"{name}, {unit}", caption)
        drawn[f"{stem}-time"] = caption, figure
        caption = (
            f"Error of the {name} on held-out runs: mean and the middle 90 % of the closing"
            " samples; before: a straight line through the command; after: physical states, live."
        )
        before, after = (
            scale * np.concatenate([getattr(run, which) - run.truth for run in runs])
            for which in ("before", "after")
        )
        rows = np.concatenate([run.rows for run in runs])
        variables = {label: rows[:, k] for label, k in VARIABLES.items()}
        figure = against(variables, before, after, f"error, {unit}", caption)
        drawn[f"{stem}-error"] = caption, figure
    return drawn


def _gapped(
    time_s: FloatArray, series: dict[str, FloatArray]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Put the samples on the run's own clock, with gaps where it does not close."""
    period_s = float(np.median(np.diff(time_s)))
    ticks = np.rint((time_s - time_s[0]) / period_s).astype(np.int64)
    lines = {name: np.full(ticks[-1] + 1, np.nan) for name in series}
    for name, values in series.items():
        lines[name][ticks] = values
    return time_s[0] + period_s * np.arange(ticks[-1] + 1), lines


def _mn_m(torque_n_m: float) -> str:
    return f"{1e3 * torque_n_m:.2f}"


def _lead(study: Study) -> str:
    kept = {row.surrogate: row for row in study.rows if row.protocol == "run-wise"}
    best = min(kept.values(), key=lambda row: row.score.rmse)
    return (
        f"A straight line through the {best.surrogate} estimates the proximal torque to"
        f" {_mn_m(best.score.rmse)} mN m on whole runs it has not seen (RMSE over"
        f" {best.score.samples:,} closing samples of {best.runs} runs). Better estimators:"
        " --states; the paper's networks, Tables I to V: --networks."
    )


def _notes(study: Study) -> list[str]:
    counts = (
        f"The paper's processing gives {study.closing_samples:,} closing samples; the paper states"
        f" {study.paper_samples:,}, the public data gives {study.public_samples:,}."
    )
    if study.measured:
        same = study.closing_samples == study.public_samples
        counts += (
            " This is the public data's count, so the processing is the published one; the public"
            " set is probably not the paper's exact set."
            if same
            else " This is neither count: files are missing or were changed."
        )
    left_out = [f"Run {name} left out: {why}." for name, why in study.left_out.items()]
    return [counts, *left_out, *study.notes]


def _held_out_table(study: Study) -> TextTable:
    found: dict[str, dict[str, float]] = {}
    for row in study.rows:
        found.setdefault(row.surrogate, {})[row.protocol] = row.score.rmse
    tried = [name for name in PROTOCOLS if name != "authors"]
    protocols = [name for name in tried if any(name in by for by in found.values())]
    rows = [
        [name, *(_mn_m(by[p]) if p in by else "" for p in protocols)] for name, by in found.items()
    ]
    note = "; ".join(f"{HELD_OUT[name]}: {PROTOCOLS[name]}" for name in protocols) + "."
    columns = ["surrogate", *(HELD_OUT[name] for name in protocols)]
    return TextTable(
        "Straight lines, proximal torque, mN m: RMSE by what was held out", columns, rows, note
    )


def _kinds_table(kinds: Sequence[KindRow]) -> TextTable:
    found: dict[str, list[str]] = {}
    for row in kinds:
        found.setdefault(row.kind, [row.kind]).append(_mn_m(row.score.rmse))
    columns = ["estimator", *(f"RMSE, {filters}" for filters in FILTERS)]
    note = (
        "Proximal torque, mN m, from the measured current and the encoders, five folds of whole"
        " runs, closing samples; each was written to a file and read again before it estimated."
    )
    return TextTable("Every kind of estimator", columns, list(found.values()), note)
