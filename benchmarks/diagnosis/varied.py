"""Cases whose rig, protocol and hidden forms are all drawn at random (`benchmarks.rigs`)."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import scoring
from benchmarks.diagnosis.case import (
    BLOCK,
    KINDS,
    MACHINE_FILE,
    Case,
    Judgement,
    Report,
    in_turn,
    write_recordings,
)
from benchmarks.diagnosis.truths import same_on_one_rig
from benchmarks.rigs import Case as Drawn
from benchmarks.rigs import draw
from estimation import plant_file
from estimation.files import write_text_atomic


def cases(
    seed: int, counts: Mapping[str, int], kept: Path, gear_ratio: float | None = None
) -> Iterator[Case]:
    """Yield the cases of a block of seeds, the classes in turn.

    Args:
        seed: First seed of the block.
        counts: Cases of each class, at most a block.
        kept: Folder where the answers are kept: to draw a case takes seconds.
        gear_ratio: One gear ratio for all rigs; by default each has its own, and its machine file
            is handed over.
    """
    most = {kind: min(count, BLOCK) for kind, count in counts.items()}
    return in_turn(KINDS, most, lambda kind, k: _case(kind, seed + k, gear_ratio, kept))


def _case(kind: str, seed: int, gear_ratio: float | None, folder_of_answers: Path) -> Case:
    """Return a case that is drawn when it is needed."""
    name = f"{kind}-{seed}" + ("" if gear_ratio is None else f"-ratio-{gear_ratio:g}")
    kept = folder_of_answers / f"{name}.json"

    @cache
    def drawn() -> Drawn:
        return draw(seed, kind, gear_ratio=gear_ratio)

    def write(folder: Path, without: bool = False) -> None:
        write_recordings(folder, drawn().twin.evidence if without else drawn().recordings)
        if gear_ratio is None:
            plant = plant_file.shipped_plant("reference")
            ratio = drawn().stage.plant.ratio
            parts = [replace(t, ratio=ratio) if t.ratio else t for t in plant.transmissions]
            plant_file.write(replace(plant, transmissions=tuple(parts)), folder / MACHINE_FILE)

    def judge(report: Report) -> Judgement:
        if not kept.exists():
            write_text_atomic(kept, json.dumps(_described(drawn())))
        content = json.loads(kept.read_text())
        hidden = [scoring.Hidden(*effect) for effect in content["hidden"]]
        return scoring.judge(
            scoring.Truth(kind, hidden, content["runs"], content["either"]), report
        )

    write_without = None if kind == "clean" else partial(write, without=True)
    options = ("--machine", f"{{case}}/{MACHINE_FILE}") if gear_ratio is None else ()
    return Case(name, kind, write, judge, write_without, options=options)


def _described(drawn: Drawn) -> dict[str, object]:
    """Return the hidden effects as a `scoring.Truth`."""
    truth = drawn.truth
    plans = drawn.stage.plans
    hidden = []
    for place, effect in enumerate(truth.effects):
        shown = [
            equation
            for equation, columns in truth.columns.items()
            if any(np.any(run[:, place]) for run in columns)
        ]
        outside = effect.family == "unknown"
        groups = [sorted(same_on_one_rig(word)) for word in effect.variables] if outside else []
        hidden.append([[effect.family, *effect.synonyms], shown, groups])
    runs = sorted({plans[k].name for effect in truth.effects for k in effect.runs})
    return {"hidden": hidden, "runs": runs, "either": list(truth.together)}
