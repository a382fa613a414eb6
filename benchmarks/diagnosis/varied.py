"""Cases whose rig, protocol and hidden forms are all drawn at random (`benchmarks.rigs`)."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
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
    return in_turn(KINDS, most, lambda kind, k: _case(_Lazy(seed + k, kind, gear_ratio, kept)))


@dataclass(frozen=True)
class _Lazy:
    """A case that is drawn when it is needed."""

    seed: int
    kind: str
    gear_ratio: float | None
    kept: Path

    @property
    def name(self) -> str:
        ratio = "" if self.gear_ratio is None else f"-ratio-{self.gear_ratio:g}"
        return f"{self.kind}-{self.seed}{ratio}"

    @cached_property
    def drawn(self) -> Drawn:
        return draw(self.seed, self.kind, gear_ratio=self.gear_ratio)

    def truth(self) -> scoring.Truth:
        path = self.kept / f"{self.name}.json"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text_atomic(path, json.dumps(_described(self.drawn)))
        content = json.loads(path.read_text())
        hidden = [scoring.Hidden(*effect) for effect in content["hidden"]]
        return scoring.Truth(self.kind, hidden, content["runs"], content["either"])

    def write(self, folder: Path) -> None:
        write_recordings(folder, self.drawn.recordings)
        self._write_machine(folder)

    def write_without(self, folder: Path) -> None:
        write_recordings(folder, self.drawn.twin.evidence)
        self._write_machine(folder)

    def _write_machine(self, folder: Path) -> None:
        if self.gear_ratio is None:
            plant = plant_file.shipped_plant("reference")
            ratio = self.drawn.stage.plant.ratio
            parts = [replace(t, ratio=ratio) if t.ratio else t for t in plant.transmissions]
            plant_file.write(replace(plant, transmissions=tuple(parts)), folder / MACHINE_FILE)

    def judge(self, report: Report) -> Judgement:
        return scoring.judge(self.truth(), report)


def _case(lazy: _Lazy) -> Case:
    without = None if lazy.kind == "clean" else lazy.write_without
    options = ("--machine", f"{{case}}/{MACHINE_FILE}") if lazy.gear_ratio is None else ()
    return Case(lazy.name, lazy.kind, lazy.write, lazy.judge, without, options=options)


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
