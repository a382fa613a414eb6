"""The page of the study of del Sol et al. 2014."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from estimation.recording import FloatArray
from rig.arm.hidden import FAMILIES, names_of
from rig.output.figures import paired_bars
from rig.output.page import Page
from rig.output.table import TextTable
from rig.studies.coverage import coverage
from rig.studies.delsol.hydraulic_arm import HYDRAULIC, RUNS
from rig.studies.delsol.study import (
    DISCARDED,
    JOINTS,
    OURS,
    PAPER,
    PEAK_N,
    PEAK_PERCENT,
    PULLS,
    TABLE_1_HZ,
    TABLE_2_N_M,
    TABLE_5_N,
    DelSolStudy,
    Named,
)
from rig.studies.families import WITHIN, in_words, middle_and_ends, near, ratios, verdict

TITLE = "External forces of a hydraulic arm: del Sol et al. 2014 on simulated arms"

NOTE = f"Arm: {HYDRAULIC.name}; {HYDRAULIC.source}."

DISCARDS = (
    "Equation 15 discards points whose observation matrix has a condition number above 100, read as"
    " that of one point's rows, all 96 columns in SI units; the residual is then of the points"
    " kept. The simulated arms were set to meet the paper with all points."
)

NAMED_NOTE = (
    f"The joints are torque equations of the diagnosis, on {RUNS} further runs per arm along finite"
    " Fourier series (equation 14); one run in three was held out before any fit. Hoses drag on"
    " joint 1 alone, k q (1 + q^2). A name is right where it, or one of its alternatives, is what"
    " the joint has, and false else; a joint without a catalogued effect has no right name. Effects"
    " found are fitted to the paper's points together with its parameters: the rows with what was"
    " found."
)

ADJUSTED = TextTable(
    "Set so that the paper's method lands near the paper",
    ["what", "first value", "value here"],
    [
        ["hidden friction of joints 1 to 5, N m", "not recorded", "3, 29, 19, 28, 11"],
        ["noise of the pressures as torque, N m", "not recorded", "0.8, 5, 2, 3.3, 1.1"],
        ["sliding force, N", "not recorded", "30"],
    ],
    "So a landing within 25 % does not confirm the simulation.",
)


def is_false(finding: Named, family: str) -> bool:
    """Return whether a finding names what its simulated joint does not have.

    Every joint has hidden friction of the arm's family; joint 1 has the hoses' pull too. Of a
    finding with alternatives, one true name among them will do. A finding without a name claims
    nothing.
    """
    true = {*names_of(family), *(PULLS if finding.joint == 1 else ())}
    return finding.family != "unknown" and not _names(finding, true)


def _lead(study: DelSolStudy) -> str:
    found = [(f, family) for family, arms in _by_family(study).items() for arm in arms for f in arm]
    hoses = sum(map(_has_hoses, study.named))
    false = [f for f, family in found if is_false(f, family)]
    which = sorted({f"{f.family} on joint {f.joint}" for f in false})
    return (
        f"{verdict(_ratios(study))} The diagnosis identified the hoses' pull on joint 1 of {hoses}"
        f" of {len(study.named)} arms. Of {len(found)} names on {JOINTS * len(study.named)} joints"
        f" {len(false)} are false{': ' + ', '.join(which) if which else ''}."
    )


def page(study: DelSolStudy) -> Page:
    """Return the study's page: the paper's tables with ours next to them."""
    joints = [f"joint {k + 1}" for k in range(JOINTS)]
    ranges = zip(joints, TABLE_1_HZ, strict=True)
    excited = [[joint, *(f"{end:.3f}" for end in ends)] for joint, ends in ranges]
    residual = [["paper", *(f"{value:.2f}" for value in TABLE_2_N_M)]]
    stated = (TABLE_5_N[0], PEAK_PERCENT, TABLE_5_N[1])
    forces = [["paper", *(f"{value:.2f}" for value in stated)]]
    for method, every in study.outcomes.items():
        each = every[:: len(FAMILIES)]  # the simulation's own friction, which was matched
        residual += middle_and_ends(method, np.array([o.residual_n_m for o in each]))
        force = np.array([(o.impact_n, o.impact_percent, o.sliding_n) for o in each])
        forces += middle_and_ends(method, force)
    for method, word in ((PAPER, "within"), (DISCARDED, "with points discarded, within")):
        *rms, impact_n, sliding_n = np.median(_errors(study, method)[:: len(FAMILIES)], axis=0)
        errors = (impact_n, 100 * impact_n / PEAK_N, sliding_n)
        residual.append([f"{word} {WITHIN:.0%} of the paper", *in_words(near(rms, TABLE_2_N_M))])
        forces.append([f"{word} {WITHIN:.0%} of the paper", *in_words(near(errors, stated))])
    peak = f"The paper's impact peaks at {PEAK_N:.0f} N"
    count = f"{study.seeds} arms with the simulation's own friction"
    columns = [f"{name} residual" for name in joints] + ["impact force", "sliding force"]
    title = f"Ours over the paper's method, {study.seeds} arms a family"
    tables = [
        ratios(title, columns, _ratios(study)),
        TextTable("Table 1: excitation, Hz", ["", "lowest", "highest"], excited),
        TextTable(f"Table 2: RMS residual, N m, {count}", ["", *joints], residual, DISCARDS),
        TextTable(
            f"Table 5: RMS error of force, {count}",
            ["", "impact, N", "impact, % of peak", "sliding, N"],
            forces,
            f"{peak}; its sliding force is not stated and assumed.",
        ),
        _named(study),
        ADJUSTED,
        coverage("delsol"),
    ]
    return Page(TITLE, [_lead(study), NOTE], tables, study.provenance, lambda: _figures(study))


def _figures(study: DelSolStudy) -> Mapping[str, str]:
    sides = ("paper's method", "ours")
    paper, ours = (np.median(_errors(study, method), axis=0) for method in (PAPER, OURS))
    joints = {f"joint {k + 1}": (paper[k], ours[k]) for k in range(JOINTS)}
    named = {n: (paper[k], ours[k]) for n, k in (("impact", JOINTS), ("sliding", JOINTS + 1))}
    return {
        "delsol-residual": paired_bars(joints, sides, "RMS residual, N m", "Table 2, medians"),
        "delsol-forces": paired_bars(named, sides, "RMS error of force, N", "Table 5, medians"),
    }


def _errors(study: DelSolStudy, method: str) -> FloatArray:
    """Return a method's residuals and force errors on every arm, shape (arms, joints + 2)."""
    return np.array([(*o.residual_n_m, o.impact_n, o.sliding_n) for o in study.outcomes[method]])


def _ratios(study: DelSolStudy) -> Mapping[str, FloatArray]:
    found = _errors(study, OURS) / _errors(study, PAPER)
    return {family: found[k :: len(FAMILIES)] for k, family in enumerate(FAMILIES)}


def _by_family(study: DelSolStudy) -> Mapping[str, Sequence[Sequence[Named]]]:
    return {family: study.named[k :: len(FAMILIES)] for k, family in enumerate(FAMILIES)}


def _named(study: DelSolStudy) -> TextTable:
    """Return for each family the joints rightly named, the hoses, and the false names."""
    rows = []
    for family, arms in _by_family(study).items():
        own = names_of(family)
        found = [f for arm in arms for f in arm]
        right = sum(len({f.joint for f in arm if _names(f, own)}) for arm in arms)
        hoses = sum(_has_hoses(arm) for arm in arms)
        false = Counter(f.family for f in found if is_false(f, family))
        count = f"{right} of {JOINTS * len(arms)}" if own else "no right name"
        wrong = ", ".join(f"{name} {count}" for name, count in false.most_common())
        rows.append([family, count, f"{hoses} of {len(arms)}", wrong])
    header = ["hidden friction", "joints named right", "hoses named", "false names"]
    return TextTable(f"Effects identified, {len(study.named)} arms", header, rows, NAMED_NOTE)


def _names(finding: Named, families: Collection[str]) -> bool:
    return not {finding.family, *finding.alternatives}.isdisjoint(families)


def _has_hoses(arm: Sequence[Named]) -> bool:
    return any(f.joint == 1 and f.family in PULLS for f in arm)
