"""Studies over families of hidden torque: which arm has which, and methods compared by family."""

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from estimation.recording import FloatArray
from rig.arm.hidden import FAMILIES, NOT_IN_CATALOGUE, OWN
from rig.output.table import TextTable

WITHIN = 0.25
"""A number lands near a paper's when it differs by at most this share of it."""

NOTE = (
    "Error of ours over that of the paper's method on the same arm, median over its arms; below 1"
    " ours is better. The simulation's own form is the one whose size was set so that the paper's"
    " method lands near the paper. Every other family has forms drawn for each joint (random"
    " tables and banks of elements with memory), of the same size. Last: cells, arm by arm, in"
    " which ours has the smaller error."
)


def arm_of(number: int, families: Sequence[str] = FAMILIES) -> tuple[int, str]:
    """Return the seed and the family of hidden torque of a study's arm, by its number from 0."""
    return number // len(families), families[number % len(families)]


def near(found: Iterable[float], stated: Iterable[float | None]) -> list[bool | None]:
    """Return whether each number lands near a paper's; None where the paper's is not known."""
    pairs = zip(found, stated, strict=True)
    return [None if s is None else bool(abs(here / s - 1) <= WITHIN) for here, s in pairs]


def in_words(answers: Iterable[bool | None]) -> list[str]:
    """Return `yes`, `no`, or nothing for what is not known."""
    return [{True: "yes", False: "no", None: ""}[answer] for answer in answers]


def ratios(
    title: str,
    columns: Sequence[str],
    found: Mapping[str, FloatArray],
    outside: Collection[str] = frozenset(NOT_IN_CATALOGUE),
) -> TextTable:
    """Return a table of two methods' errors by family.

    `found` is ours over the paper's method, shape (arms, columns), by family; `outside` are the
    families that the catalogue does not have.
    """
    rows = []
    for family, each in found.items():
        kind = "written" if family == OWN else "no" if family in outside else "yes"
        middle = np.median(each, axis=0)
        better = f"{int(np.sum(each < 1))} of {each.size}"
        rows.append([family, kind, *(f"{value:.2f}" for value in middle), better])
    header = ["hidden torque", "family in the catalogue", *columns, "ours better"]
    return TextTable(title, header, rows, NOTE)


def middle_and_ends(method: str, values: FloatArray) -> list[list[str]]:
    """Return two rows of a method's values (arms, columns): medians, and least and largest."""
    ends = zip(values.min(axis=0), values.max(axis=0), strict=True)
    return [
        [f"{method}, median", *(f"{value:.2f}" for value in np.median(values, axis=0))],
        [f"{method}, least to most", *(f"{low:.1f}-{high:.1f}" for low, high in ends)],
    ]


def verdict(found: Mapping[str, FloatArray]) -> str:
    """Return in how many cells ours is better, and which families are not in its favour."""
    drawn = {family: each for family, each in found.items() if family != OWN}
    better = sum(int(np.sum(each < 1)) for each in drawn.values())
    total = sum(each.size for each in drawn.values())
    behind = [family for family, each in drawn.items() if np.median(each) >= 1]
    said = f"; the paper's method is as good or better with {', '.join(behind)}" if behind else ""
    return (
        f"With hidden torque of {len(drawn)} drawn families ours has the smaller error in"
        f" {better} of {total} cells{said}."
    )
