"""What the plain simulated board makes of a bench's counts, by profile."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.control import Controllers
from drivers.teensy.grasper import GRASPER, MOTORS
from drivers.teensy.profile import Profile
from drivers.teensy.reference import REFERENCE

INT16 = (-(2**15), 2**15 - 1)
FORCE_MAX = 4095
TWELVE_BITS = (-(2**32), FORCE_MAX)
"""Ends of a converter; one of 12 bits has no lower end at which it is saturated."""


@dataclass(frozen=True, eq=False)
class BoardLogic:
    """How the samples of one profile are made."""

    profile: Profile
    # fields of a sample in the order of a bench's columns: inputs, then commands
    counted: tuple[str, ...]
    # field of each converter to the counts from which down and up it is saturated
    converted: Mapping[str, tuple[int, int]]
    # setpoint that follows a count to that count, which it is while nothing is asked
    stands: Mapping[str, str]

    def samples(
        self, counts: NDArray[np.int32], setpoints: NDArray[np.int32] | None
    ) -> NDArray[np.void]:
        """Return samples of some ticks, cut to the range of their fields.

        The counts are a row a tick, as in `counted`; setpoints are None while nothing is asked for.
        """
        given = dict(zip(self.counted, counts.T, strict=True))
        for place, name in enumerate(self.profile.setpoint_names):
            rest = given.get(self.stands.get(name, ""), np.zeros(len(counts), np.int32))
            given[name] = rest if setpoints is None else setpoints[:, place]
        samples = np.empty(len(counts), self.profile.sample)
        for name, values in given.items():
            bounds = np.iinfo(self.profile.sample[name])
            samples[name] = np.clip(values, bounds.min, bounds.max)
        return samples

    def saturated(self, counts: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return in which rows any converter is at its limit."""
        found = np.zeros(len(counts), np.bool_)
        for name, (low, high) in self.converted.items():
            column = counts[:, self.counted.index(name)]
            found |= (column <= low) | (column >= high)
        return found


REFERENCE_LOGIC = BoardLogic(
    profile=REFERENCE,
    counted=(*REFERENCE.input_names, "fsr", "command_e4"),
    converted={"proximal": INT16, "distal": INT16, "current": INT16, "fsr": TWELVE_BITS},
    stands={"target": "spindle"},
)
GRASPER_LOGIC = BoardLogic(
    profile=GRASPER,
    counted=(*GRASPER.input_names, *(f"command_{k}_e4" for k in MOTORS)),
    converted={f"current_{k}": INT16 for k in MOTORS} | {f"force_{k}": TWELVE_BITS for k in MOTORS},
    stands={f"target_{k}": f"motor_{k}" for k in MOTORS},
)


class Bench(Protocol):
    """The physics behind a plain board, in ticks of its profile."""

    def advance(self, setpoints: NDArray[np.int32], controllers: Controllers) -> NDArray[np.int32]:
        """Run a closed-loop tick for each setpoint and return the counts, a row a tick.

        Within a tick: the inputs are sampled into a row, the controllers' commands are written
        behind them, the physics moves a tick. The result does not depend on how ticks are divided
        between calls.

        Setpoints have shape (ticks, fields), in the order of the profile's; the controllers, which
        are the board's, are changed in place.
        """
