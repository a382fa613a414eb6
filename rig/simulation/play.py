"""Play a trajectory on the simulated bench and get channels back, with no link in between."""

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.logic import Drive
from rig.simulation.bench import SimulatedBench
from rig.simulation.parameters import REFERENCE_GAINS
from rig.simulation.sensors import TURN_RAD, columns_of

FloatArray = NDArray[np.float64]


def play(
    bench: SimulatedBench, target_angle_rad: FloatArray, load_command_a: FloatArray
) -> dict[str, FloatArray]:
    """Run the armed bench along a trajectory with the reference gains and a fresh controller.

    Args:
        bench: The bench; it goes on from where it stands.
        target_angle_rad: Spindle trajectory at 1 kHz, closing positive, shape (n,).
        load_command_a: Load current, shape (n,).

    Returns:
        SI channels as from `columns_of`, each of shape (n,).
    """
    per_rad = bench.sensors.spindle_count_per_turn / TURN_RAD
    target = np.round(-target_angle_rad * per_rad).astype(np.int32)
    load_ma = np.round(1e3 * load_command_a).astype(np.int32)
    counts = bench.advance(target.size, target, load_ma, Drive.armed(REFERENCE_GAINS))
    return columns_of(counts, target, bench.sensors)
