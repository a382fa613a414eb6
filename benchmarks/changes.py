"""Pairs of simulated campaigns of one rig: nothing changed, a parameter moved, an effect came.

`python -m benchmarks.changes [--first SEED] [--pairs N] [--out FILE]` counts how often `rig diff`
names what was planted. A pair takes about half a minute of processor time.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.rigs import draw
from benchmarks.rigs.build import spread_over
from estimation.changes.compare import compare
from estimation.changes.difference import Change
from estimation.files import write_text_atomic
from estimation.model_file import reference_rig
from rig.output.provenance import Provenance
from rig.output.table import TextTable, to_page

MOVED: Mapping[str, tuple[str, ...]] = {
    "constant": ("motor.torque_constant gain of motor", "gain of actuator motor_current_a"),
    "motor_friction": ("friction.coulomb friction of motor",),
    "motor_viscous": ("friction.viscous damping of motor",),
    "spindle_friction": ("friction.coulomb friction of cable",),
    "gear_stiffness": ("compliance.link compliance of gearbox",),
    "cable_stiffness": ("compliance.link compliance of stretch",),
}
"""Parameter of the simulated rig to the names that are right for it."""

FACTORS = (1.3, 2.0)
"""A parameter is multiplied or divided by a factor between these."""

RUNS = 6
"""Runs of each campaign."""

GEAR_RATIO = 35.0
SECOND = 500_000
"""Added to the seed of the sensors' noise in the second campaign."""


@dataclass(frozen=True)
class Pair:
    """One pair of campaigns and its answer.

    Attributes:
        planted: What changed, in words; empty where nothing did.
        kind: `nothing`, `parameter` or `effect`.
        found: The names of the changes found, those that share one place joined by `or`.
        outcome: `named`, `in a set`, `unnamed` of an unknown form, `missed`, `wrong`, or `right`
            where nothing changed.
    """

    seed: int
    planted: str
    kind: str
    found: tuple[str, ...]
    outcome: str


def pairs(seeds: range) -> Iterator[Pair]:
    """Yield one pair a seed: nothing, parameters and effects in turn."""
    for seed in seeds:
        kind = ("parameter", "effect", "nothing")[seed % 3]
        yield _effect(seed) if kind == "effect" else _parameter(seed, kind)


def _parameter(seed: int, kind: str) -> Pair:
    stage = draw(seed, "clean", gear_ratio=GEAR_RATIO).stage
    random = np.random.default_rng([seed, SECOND])
    name = str(random.choice(list(MOVED)))
    factor = float(np.exp(random.uniform(*np.log(FACTORS)) * random.choice([-1, 1])))
    known = float(getattr(stage.plant, name))
    moved = {name: factor * known} if kind == "parameter" else {}
    later = replace(
        stage, plant=stage.plant._replace(**moved), seed=seed + SECOND, clean={}, noise={}
    )
    runs = spread_over(stage.every, RUNS)
    found = compare(
        [stage.record(k) for k in runs],
        [later.record(k) for k in runs],
        reference_rig(),
    )
    planted = f"{name} x {factor:.2f}" if moved else ""
    return _judged(seed, planted, kind, found.changes, MOVED[name] if moved else ())


def _effect(seed: int) -> Pair:
    case = draw(seed, "strong", gear_ratio=GEAR_RATIO)
    (hidden,) = case.truth.effects
    later = replace(case.stage, seed=seed + SECOND, clean={}, noise={})
    runs = spread_over(hidden.runs, RUNS)
    found = compare(
        [case.stage.record(k) for k in runs],
        [later.record(k, case.switched) for k in runs],
        reference_rig(),
    )
    right = (hidden.family, *hidden.synonyms)
    return _judged(seed, f"{hidden.family} at the {hidden.place}", "effect", found.changes, right)


def _judged(
    seed: int, planted: str, kind: str, changes: tuple[Change, ...], right: tuple[str, ...]
) -> Pair:
    def names(change: Change) -> tuple[str, ...]:
        return (change.name, *change.alternatives)

    def is_right(name: str) -> bool:
        return any(name == one or name.startswith(f"{one} at ") for one in right)

    def may_be_right(change: Change) -> bool:
        return change.verdict == "depends_on" or any(map(is_right, names(change)))

    found = tuple(" or ".join(names(change)) for change in changes)
    if not changes:
        outcome = "right" if kind == "nothing" else "missed"
    elif kind == "nothing" or not all(map(may_be_right, changes)):
        outcome = "wrong"
    elif changes[0].verdict == "depends_on":
        outcome = "unnamed"
    elif all(map(is_right, names(changes[0]))):  # a synonym of what was planted is right
        outcome = "named"
    else:
        outcome = "in a set"
    return Pair(seed, planted, kind, found, outcome)


def main() -> int:
    """Compare the pairs of some seeds and write what was named."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.changes", description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--pairs", type=int, default=18, help="how many")
    parser.add_argument("--out", type=Path, help="Markdown file for the table")
    options = parser.parse_args()
    found = []
    for pair in pairs(range(options.first, options.first + options.pairs)):
        sys.stderr.write(f"{pair}\n")
        found.append(pair)
    text = _markdown(found)
    if options.out:
        write_text_atomic(options.out, text)
    sys.stdout.write(text)
    return 0


def _markdown(found: Sequence[Pair]) -> str:
    counts = Counter((p.kind, p.outcome) for p in found)
    kinds, outcomes = sorted({p.kind for p in found}), sorted({p.outcome for p in found})
    summary = TextTable(
        "Outcomes",
        ("change", *outcomes),
        [[kind, *(str(counts[kind, one]) for one in outcomes)] for kind in kinds],
        f"{RUNS} runs before and after, with new noise. Wrong: a change is stated, and none of its"
        " names is the planted one.",
    )
    rows = [[str(p.seed), p.planted or "-", "; ".join(p.found) or "-", p.outcome] for p in found]
    each = TextTable("Pairs", ("seed", "planted", "found", "outcome"), rows)
    made = Provenance.now(found[0].seed if found else 0)
    return to_page(["Planted changes"], [summary, each], made)


if __name__ == "__main__":
    sys.exit(main())
