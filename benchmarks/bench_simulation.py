"""How much faster than real time the simulated rig runs on one core."""

import numpy as np

from benchmarks.ratio import Ratio, best_of
from drivers.teensy.control import Controllers
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import HiddenEffect
from rig.simulation.parameters import REFERENCE_GAINS, PlantParameters

DURATION_S = 20.0
DEAREST = ("gear_eccentricity", "eccentric_pulley", "current_ripple", "motor_ripple")
"""Two sines or more a step each; no simulated rig needs more than two effects at once."""


def measure() -> list[Ratio]:
    """Time closed-loop grasps at 0.3 Hz, plain and with the four dearest hidden effects."""
    ticks = round(1e3 * DURATION_S)
    phase = 2.0 * np.pi * 0.3 * 1e-3 * np.arange(ticks)
    target = np.round(683.0 * (1.0 + np.cos(phase)))
    setpoints = np.column_stack((target, np.full(ticks, 500))).astype(np.int32)

    def seconds(effects: list[HiddenEffect], plant: PlantParameters | None = None) -> float:
        bench = SimulatedBench(plant, effects=effects)
        controllers = Controllers.fresh(REFERENCE_GAINS)
        bench.advance(setpoints, controllers)  # compiles
        return best_of(lambda: bench.advance(setpoints, controllers), 5)

    plain_s = seconds([])
    loaded_s = seconds([HiddenEffect(name) for name in DEAREST])
    twin_s = seconds([], DECLARED_PLANT)
    return [
        Ratio(
            "simulated rig over real time, controller in the loop, one core",
            DURATION_S / plain_s,
            150.0,
            detail=f"{DURATION_S:g} s simulated in {plain_s * 1e3:.1f} ms",
        ),
        Ratio(
            "the same with the four dearest hidden effects switched on",
            DURATION_S / loaded_s,
            150.0,
            detail=f"{DURATION_S:g} s simulated in {loaded_s * 1e3:.1f} ms",
        ),
        Ratio(
            "the simulated rig over real time, smooth friction, one core",
            DURATION_S / twin_s,
            150.0,
            detail=f"{DURATION_S:g} s simulated in {twin_s * 1e3:.1f} ms",
        ),
    ]
