"""The study of O'Neill et al. 2018 as tables for any medium and as Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass

from rig.output.table import TextTable, to_markdown
from rig.studies.coverage import coverage
from rig.studies.oneill import goals
from rig.studies.oneill import networks_page as networks
from rig.studies.oneill import states_page as states
from rig.studies.oneill import tables as paper
from rig.studies.oneill.kinds import FILTERS, KindRow
from rig.studies.oneill.networks import NetworkStudy
from rig.studies.oneill.states import StateStudy
from rig.studies.oneill.study import PROTOCOLS, Study

TITLE = "Grip torque and jaw angle from motor current: O'Neill et al. 2018, made again"

HEADINGS = {
    "random": "samples at random",
    "run-wise": "runs",
    "lofo": "a frequency (LOFO)",
    "lopo": "a power level (LOPO)",
}
"""Heading of each protocol that holds something out."""


def _mn_m(torque_n_m: float) -> str:
    return f"{1e3 * torque_n_m:.2f}"


def lead(study: Study, more: "More | None" = None) -> list[str]:
    """Return the study's result, a paragraph each: of all that was estimated, the best."""
    if more is not None and (found := list(goals.lead(more.reached))):
        return found
    kept = {row.surrogate: row for row in study.rows if row.protocol == "run-wise"}
    best = min(kept.values(), key=lambda row: row.score.rmse)
    return [
        f"A straight line through the {best.surrogate} estimates the proximal torque to"
        f" {_mn_m(best.score.rmse)} mN m on whole runs it has not seen (RMSE over"
        f" {best.score.samples:,} closing samples of {best.runs} runs). Better estimators:"
        " --states; the paper's networks, Tables I to V: --networks."
    ]


def notes(study: Study) -> list[str]:
    """Return remarks for the reader: the sample counts, runs left out, and the study's notes."""
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
    """Return the errors on runs, frequencies and power levels that were not fitted."""
    found: dict[str, dict[str, float]] = {}
    for row in study.rows:
        found.setdefault(row.surrogate, {})[row.protocol] = row.score.rmse
    tried = [name for name in PROTOCOLS if name != "authors"]
    protocols = [name for name in tried if any(name in by for by in found.values())]
    rows = [
        [name, *(_mn_m(by[p]) if p in by else "" for p in protocols)] for name, by in found.items()
    ]
    note = "; ".join(f"{HEADINGS[name]}: {PROTOCOLS[name]}" for name in protocols) + "."
    columns = ["surrogate", *(HEADINGS[name] for name in protocols)]
    return TextTable(
        "Straight lines, proximal torque, mN m: RMSE by what was held out", columns, rows, note
    )


@dataclass(frozen=True)
class More:
    """What goes beyond the linear rows, where it was done.

    Attributes:
        networks: The network rows.
        states: The estimates from physical states.
        kinds: Every kind of estimator on the same folds.
    """

    networks: NetworkStudy | None = None
    states: StateStudy | None = None
    kinds: tuple[KindRow, ...] = ()

    @property
    def reached(self) -> list[goals.Reached]:
        """What the best estimator reaches."""
        return goals.reached(self.states, self.networks) if self.states is not None else []

    @property
    def notes(self) -> list[str]:
        """Notes of both."""
        deep = networks.notes(self.networks) if self.networks is not None else []
        return [*deep, *(states.notes(self.states) if self.states is not None else [])]


def kinds_table(kinds: tuple[KindRow, ...]) -> TextTable:
    """Return the errors of every kind of estimator."""
    found: dict[str, list[str]] = {}
    for row in kinds:
        found.setdefault(row.kind, [row.kind]).append(_mn_m(row.score.rmse))
    columns = ["estimator", *(f"RMSE, {filters}" for filters in FILTERS)]
    note = (
        "Proximal torque, mN m, from the measured current and the encoders, five folds of whole"
        " runs, closing samples; each was written to a file and read again before it estimated."
    )
    return TextTable("Every kind of estimator", columns, list(found.values()), note)


NOTHING_MORE = More()


def markdown(study: Study, more: More = NOTHING_MORE, drawn: Sequence[tuple[str, str]] = ()) -> str:
    """Return the study, and what goes beyond where there is any, as a Markdown page.

    Args:
        study: The linear rows.
        more: What goes beyond.
        drawn: Caption and place of each figure, relative to the page.
    """
    first, *others = all_tables(study, more)
    known = [f"Data: {study.source}.", *all_notes(study, more)]
    parts = [f"# {TITLE}", *lead(study, more), to_markdown(first).rstrip()]
    parts += ["## Before comparing", "\n".join(f"- {note}" for note in known)]
    parts += ["## Figures"] if drawn else []
    parts += [f"![{caption}]({place})\n\n{caption}" for caption, place in drawn]
    parts += [to_markdown(table).rstrip() for table in others]
    return "\n\n".join([*parts, study.provenance.line()]) + "\n"


def all_notes(study: Study, more: More) -> list[str]:
    """Return the notes of the study and of what goes beyond."""
    return notes(study) + more.notes


def all_tables(study: Study, more: More) -> list[TextTable]:
    """Return the tables: what is reached, the paper's, then all by what was held out."""
    return [
        *([goals.table(more.reached)] if more.reached else []),
        *paper.tables(study, more.networks),
        _held_out_table(study),
        *(networks.tables(more.networks) if more.networks is not None else []),
        *([kinds_table(more.kinds)] if more.kinds else []),
        *(states.tables(more.states) if more.states is not None else []),
        coverage("oneill"),
    ]
