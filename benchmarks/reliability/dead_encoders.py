"""All encoders of the simulated rig dead at once, in slow motion and fast, anywhere in its travel.

Its gearhead and cable are elastic and its stops are away, so nothing but the board ends a motion.
"""

import ctypes
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.reliability.encoder_faults import (
    BLOCK,
    JAW,
    MOTOR,
    PER_RAD,
    SPINDLE,
    armed,
    frozen,
)
from drivers.teensy.core import TICK
from drivers.teensy.protocol import Trip
from rig.configuration.config import load_config
from rig.simulation.bench import SimulatedBench
from rig.simulation.hidden import draw
from rig.simulation.parameters import PlantParameters, vary
from rig.simulation.places import SPINDLE_ANGLE

MOVES = 120
REST = 6
"""Blocks in which the host sends setpoints, and in which it then is silent."""
FAR_RAD = 50.0


class DeadFrom:
    """A simulated rig whose encoders count no more from a tick on."""

    def __init__(self, bench: SimulatedBench, since: int) -> None:
        self._bench, self._fault, self._tick = bench, frozen(MOTOR, SPINDLE, JAW, since=since), 0

    def advance_with_board(
        self, ticks: int, tick_address: int, board_address: int, tick_us: int
    ) -> None:
        """Run ticks; see `drivers.teensy.core.FirmwareBench.advance_with_board`."""
        board_tick = TICK(tick_address)

        def tick(_board: int, now_us: int, inputs: int, outputs: int) -> None:
            counts = list((ctypes.c_int32 * 7).from_address(inputs))
            given = (ctypes.c_int32 * 7)(*self._fault(self._tick, counts))
            board_tick(board_address, now_us, given, outputs)
            self._tick += 1

        between = TICK(tick)
        address = ctypes.cast(between, ctypes.c_void_p).value
        assert address
        self._bench.advance_with_board(ticks, address, 0, tick_us)


@dataclass(frozen=True)
class Ride:
    """What became of a motion.

    Attributes:
        beyond_rad: Farthest the spindle was beyond its travel.
    """

    beyond_rad: float
    trip: Trip


def ride(seed: int, slow: bool = True, dead: bool = True, library: Path | None = None) -> Ride:
    """Move outward from a drawn place at a drawn speed; every other seed draws the rig, too.

    Args:
        seed: What is drawn.
        slow: Whether it begins in the last 0.4 rad, at 0.3 rad/s or slower; else it begins
            anywhere, up to 2 rad/s.
        dead: Whether the encoders die on the way.
        library: The firmware library; the built one when None.
    """
    rng = np.random.default_rng(seed)
    travel_rad = load_config(Path("reference")).reference_limits.spindle_angle_rad
    left_rad = rng.uniform(0.02, 0.4 if slow else 2 * travel_rad)
    speed_rad_s = math.exp(rng.uniform(math.log(0.005), math.log(0.3 if slow else 2.0)))
    sense, since = rng.choice([-1, 1]), int(rng.integers(100, 1500))
    short_rad = rng.uniform(0, 0.05)
    plant = PlantParameters(stop_open_rad=-FAR_RAD, stop_closed_rad=FAR_RAD)
    varied = seed % 2 == 1
    start_rad = sense * (travel_rad - left_rad)
    bench = SimulatedBench(
        vary(plant, seed, 0.15) if varied else plant,
        effects=[draw(seed)] if varied else [],
        seed=seed,
        start_count=round(start_rad * PER_RAD[SPINDLE]),
    )
    gone_rad = speed_rad_s * np.clip(np.arange(MOVES * BLOCK) * 1e-3 - 0.05, 0, None)
    angle_rad = start_rad + sense * np.clip(gone_rad, 0, max(left_rad - short_rad, 0.0))
    targets = np.round(angle_rad * PER_RAD[SPINDLE]).astype(np.int32)
    logger = armed(DeadFrom(bench, since) if dead else bench, library)
    beyond_rad = 0.0
    for block in [*np.split(targets, MOVES), *[None] * (REST if dead else 0)]:
        if logger.trip().code is Trip.NONE and block is not None:
            logger.queue(block, np.zeros(BLOCK, np.int32))
        logger.read(BLOCK * 1e-3)
        beyond_rad = max(beyond_rad, abs(float(bench.state[SPINDLE_ANGLE])) - travel_rad)
    return Ride(beyond_rad, logger.trip().code)
