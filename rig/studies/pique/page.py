"""The page of the study of Piqué 2018."""

from collections.abc import Mapping

import numpy as np

from rig.arm.search import DAMPING, LEAST_GAIN, STRETCHES
from rig.output.figures import paired_bars
from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.coverage import coverage
from rig.studies.pique.study import EFFECTS, THESIS, WITHIN, Row, Study

AIMS = {
    "aimed at": (0.7, 2.2, 2.8, 5.5, 3.6, 3.9),
    "aimed at beyond that": (0.4, 1.2, 1.5, 3.0, 2.0, 2.0),
}
"""What was set out for on the public paths, mean of both directions, %."""

PUBLIC_PATHS = {"one18", "two18"}

TITLE = "Joint torques of a patient-side manipulator: table 3.2 of Piqué 2018, made again"


def page(study: Study) -> Page:
    """Return the study's page."""
    paragraphs = [_lead(study), f"Arm: {study.arm}.", *_notes(study)]
    others = [_others(study)] if any(r.tested_on not in study.paths for r in study.rows) else []
    added = "Gain: mean over the joints of the relative fall of NRMSD, when the effect was added."
    dropped = (
        "Gain had the effect been added to those kept; negative: it made the estimate worse. An"
        " effect that gains in the first column only was found and not confirmed."
    )
    tables = [
        _errors(study),
        *others,
        _trials(study, True, "Effects kept, in order", added),
        _trials(study, False, "Effects tried and dropped", dropped),
        _parameters(study),
        coverage("pique"),
    ]
    return Page(TITLE, paragraphs, tables, study.provenance, lambda: _figures(study))


def _lead(study: Study) -> str:
    models = list(dict.fromkeys(row.model for row in study.rows))
    before, after = (_mean(study, model) for model in (models[0], EFFECTS))
    return (
        "With effects beyond the thesis' model, the joint torques of a path that was not fitted are"
        f" estimated to {np.mean(after):.2f} % of their range, mean over joints and both"
        f" directions; the thesis' model reaches {np.mean(before):.2f} %. With effects chosen on"
        f" the fitted path alone it is {np.mean(_mean(study, WITHIN)):.2f} %.{_reached(study)}"
    )


def _reached(study: Study) -> str:
    """Return how many joints reach what was aimed at, or nothing on other paths."""
    if set(study.paths) != PUBLIC_PATHS:
        return ""
    said = [
        f"{np.sum(np.round(_mean(study, model), 2) <= aim)} of {len(aim)} joints {model}"
        for aim in AIMS.values()
        for model in (EFFECTS, WITHIN)
    ]
    return (
        f" The goal is reached by {said[0]} and {said[1]}; the further goal by {said[2]} and"
        f" {said[3]}."
    )


def _notes(study: Study) -> list[str]:
    first, second = study.paths
    return [
        "The torque is motor current times nominal constants: the arm has no torque sensor. Both"
        " sides pass a zero-phase Butterworth filter of order 3 at 5 Hz; one second at either end"
        " is left out. The thesis' row is another robot's.",
        f"Effects were discovered by their gain on {second} after a fit on {first}, least gain"
        f" {100 * LEAST_GAIN:g} %, and kept if the other direction gains by them too. The list of"
        " candidates and the least gain were drawn up with the public paths one18 and two18 in"
        " view, so a run unseen by either is the better judge. Effects chosen on the fitted path"
        f" alone help from every other of {STRETCHES} stretches of its period to the rest and back."
        " Frictions, slip and creep cannot be negative. The gripper's torque takes part in the fit"
        " and is not scored."
        f" Fits with effects are damped by {DAMPING:g} of a column's squared length.",
    ]


def _figures(study: Study) -> Mapping[str, str]:
    before, after = _mean(study, THESIS), _mean(study, EFFECTS)
    pairs = {f"J{k + 1}": (before[k], after[k]) for k in range(len(before))}
    caption = "NRMSD on the path that was not fitted, mean of both directions"
    bars = paired_bars(pairs, ("thesis' model", "with the effects kept"), "NRMSD, %", caption)
    return {"pique-joints": bars}


def _mean(study: Study, model: str) -> np.ndarray:
    rows = (r for r in study.rows if r.model == model and r.tested_on in study.paths)
    return np.asarray(np.mean([row.nrmsd_percent for row in rows], axis=0))


def _percent(values: tuple[float, ...] | np.ndarray) -> list[str]:
    return [f"{value:.2f}" for value in values]


def _errors(study: Study) -> TextTable:
    joints = [f"J{k + 1}" for k in range(len(study.thesis))]
    rows = [["thesis, table 3.2 (another robot)", "", *_percent(study.thesis)]]
    on_paths = [row for row in study.rows if row.tested_on in study.paths]
    for model in dict.fromkeys(row.model for row in on_paths):
        for row in on_paths:
            if row.model == model:
                rows.append([_way(row), str(row.parameters), *_percent(row.nrmsd_percent)])
        rows.append([f"{model}, mean of both", "", *_percent(_mean(study, model))])
    if set(study.paths) == PUBLIC_PATHS:
        rows += [[f"{word}, mean of both", "", *_percent(aim)] for word, aim in AIMS.items()]
    return TextTable(
        "NRMSD on the path that was not fitted, %", ["model", "parameters", *joints], rows
    )


def _others(study: Study) -> TextTable:
    joints = [f"J{k + 1}" for k in range(len(study.thesis))]
    rows = []
    for row in study.rows:
        if row.tested_on not in study.paths:
            rows.append([_way(row), *_percent(row.nrmsd_percent)])
            if row.without_offset_percent is not None:
                rows.append(["the same, offsets removed", *_percent(row.without_offset_percent)])
    note = (
        "Nothing was chosen on these runs. Offsets removed: each joint's mean error, by a zero"
        " of its current or a spring after a restart."
    )
    return TextTable("NRMSD on further runs, %", ["model", *joints], rows, note)


def _way(row: Row) -> str:
    return f"{row.model}, {row.fitted_on} to {row.tested_on}"


def _trials(study: Study, kept: bool, title: str, note: str) -> TextTable:
    rows = [
        [t.effect, t.what, f"{t.gain_percent:+.1f}", f"{t.other_way_percent:+.1f}"]
        for t in study.trials
        if (t.kept_in_round is not None) == kept
    ]
    first, second = study.paths
    columns = ["effect", "what", f"gain on {second}, %", f"gain on {first} (to confirm), %"]
    return TextTable(title, columns, rows, note)


def _parameters(study: Study) -> TextTable:
    rows = [
        [p.name, f"{p.value:.4g}", f"{p.standard_error:.2g}", f"{p.consistent:.4g}"]
        for p in study.parameters
    ]
    note = (
        "m: mass, l: first moment, L: inertia about the joint, Ke: spring, Fv and Fs: viscous and"
        " Coulomb friction, Ia: drive inertia, tau0: offset. Standard errors include noise only."
        " Physically consistent: every link's pseudo-inertia is positive semidefinite, and no"
        " friction, spring or drive inertia is negative."
    )
    title = f"Base parameters of the thesis' model, fitted on {study.paths[0]}, SI units"
    columns = ["parameter", "value", "standard error", "physically consistent"]
    return TextTable(title, columns, rows, note)
