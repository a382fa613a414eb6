"""The page of the study of O'Neill et al. 2018."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rig.output.page import Page
from rig.output.table import TextTable, to_markdown
from rig.studies.coverage import coverage
from rig.studies.oneill import goals
from rig.studies.oneill import networks_page as networks
from rig.studies.oneill import states_page as states
from rig.studies.oneill import tables as paper
from rig.studies.oneill.figures import draw
from rig.studies.oneill.kinds import FILTERS, KindRow
from rig.studies.oneill.networks import NetworkStudy
from rig.studies.oneill.paper import HELD_OUT, PROTOCOLS
from rig.studies.oneill.states import Shown, StateStudy
from rig.studies.oneill.study import Study

TITLE = "Grip torque and jaw angle from motor current: O'Neill et al. 2018, made again"


@dataclass(frozen=True)
class OneillPage(Page):
    """The page, whose Markdown has its first table above the remarks, and figures with captions.

    Attributes:
        lead: How many of the paragraphs are the result.
        captions: Caption of each figure.
    """

    lead: int = 1
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
    """Return the study's page: what is reached, the paper's tables, then all by what was held out.

    Args:
        study: The linear rows.
        deep: The network rows, where they were trained.
        physical: The estimates from physical states.
        kinds: Every kind of estimator on the same folds.
        shown: Target to what its figures are drawn from.
    """
    found = goals.reached(physical, deep) if physical is not None else []
    lead = list(goals.lead(found)) or [_lead(study)]
    tables = [*paper.tables(study, deep), _held_out_table(study)]
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
    drawn = draw(shown or {})
    return OneillPage(
        TITLE,
        [*lead, *notes],
        [*tables, coverage("oneill")],
        study.provenance,
        lambda: {name: figure for name, (_, figure) in drawn.items()},
        len(lead),
        [caption for caption, _ in drawn.values()],
    )


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
