"""Cases drawn by seed: a rig, its runs and what is hidden in it.

The kind and the seed alone decide everything. A rig that does not work (its motion does not stay
finite, it does not follow, or its declared equations do not hold without any effect) is drawn
again, from the same seed.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.rigs.build import build
from benchmarks.rigs.recipes import KINDS, recipes_for
from benchmarks.rigs.seeds import part_of
from benchmarks.rigs.stage import Stage, Switched
from benchmarks.rigs.structure import Truth
from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.errors import RigError, UsageError

ATTEMPTS = 400
"""Rigs that are drawn before a seed is given up: of a few seeds the first 40 fail."""


class NoCaseError(RigError):
    """No rig of a seed works: a bug, since each seed has many draws."""


@dataclass(frozen=True, eq=False)
class Case:
    """One simulated campaign with its answer.

    Attributes:
        kind: One of `KINDS`.
        stage: The rig, its protocol and sensors.
        switched: The effects, with their amplitudes.
        truth: The answer.
    """

    seed: int
    kind: str
    stage: Stage
    switched: tuple[Switched, ...]
    truth: Truth

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The runs, with noise; simulated again at each call."""
        return tuple(self.stage.record(k, self.switched) for k in self.stage.every)

    @property
    def campaign(self) -> Campaign:
        """The runs as a campaign in memory."""
        return Campaign.of(self.recordings)

    @property
    def twin(self) -> Campaign:
        """The same runs, noise and all, without the effects."""
        return Campaign.of(self.stage.record(k) for k in self.stage.every)

    def describe(self) -> dict[str, object]:
        """Return the answer and the rig as plain values."""
        truth = self.truth
        return {
            "seed": self.seed,
            "range": part_of(self.seed),
            "kind": self.kind,
            "effects": [
                {**vars(e), "runs": [self.stage.plans[k].name for k in e.runs]}
                for e in truth.effects
            ],
            "families": truth.families,
            "clean_rms": dict(truth.clean_rms),
            "with_rms": dict(truth.with_rms),
            "oracle_rms": dict(truth.oracle_rms),
            "controller": self.stage.controller[0],
            "protocol": vars(self.stage.protocol),
            "gear_ratio": self.stage.plant.ratio,
            "cable_ratio": self.stage.plant.pull,
            "gear_stiffness_n_m_rad": self.stage.plant.gear_stiffness,
            "cable_stiffness_n_m_rad": self.stage.plant.cable_stiffness,
            "torque_constant_n_m_a": self.stage.plant.constant,
        }


def draw(seed: int, kind: str, *, gear_ratio: float | None = None) -> Case:
    """Draw a case; the same seed and kind give the same samples.

    Args:
        seed: Of one of the ranges in `benchmarks.rigs.seeds`.
        kind: One of `KINDS`.
        gear_ratio: Gear ratio of the rig instead of the drawn one, for a reader whose derived
            channels are made for one ratio.

    Raises:
        UsageError: No such kind, or the seed belongs to no range.
        NoCaseError: No rig of this seed works.
    """
    part_of(seed)
    if kind not in KINDS:
        raise UsageError(f"There is no kind of case {kind!r}.", f"There are {', '.join(KINDS)}.")
    number = KINDS.index(kind)
    for attempt in range(ATTEMPTS):
        chooser = np.random.default_rng([seed, number, attempt // 8])
        names, load = recipes_for(chooser, kind)
        random = np.random.default_rng([seed, number, 1000 + attempt])
        built = build(seed, kind, random, names, load, gear_ratio)
        if built is not None:
            return Case(seed, kind, *built)
    raise NoCaseError(f"No rig works for seed {seed}, kind {kind}.")
