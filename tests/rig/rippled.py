"""A small campaign of the simulated rig whose motor ripples."""

from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.recording import Recording
from rig.protocols.motion import motion_of
from rig.protocols.protocol import Protocol
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import HiddenEffect
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of

MOTOR = model_file.read(Path("motor"))

PROTOCOL = Protocol.model_validate(
    {
        "name": "small",
        "runs": [
            {
                "kind": "sine",
                "frequencies_hz": [0.25, 0.4],
                "loads_a": [0.2, 0.5, 0.8],
                "amplitude_rad": 0.3,
                "duration_s": 4.0,
            },
            {
                "kind": "sine",
                "frequencies_hz": [0.3],
                "loads_a": [0.4],
                "amplitude_rad": 0.3,
                "duration_s": 4.0,
                "repeats": 3,
            },
        ],
    }
)


def record(*effects: HiddenEffect) -> list[Recording]:
    """Play the small protocol on a rig that the declared equations describe, but for effects."""
    made = []
    for k, plan in enumerate(PROTOCOL.plans()):
        start = float(plan.target_angle_rad[0])
        bench = SimulatedBench(DECLARED_PLANT, None, effects, k, 0)
        bench = SimulatedBench(
            DECLARED_PLANT, None, effects, k, spindle_count_of(start, bench.sensors)
        )
        motion = motion_of(plan, start)
        columns = play(bench, *motion.setpoints)
        part = slice(motion.first, motion.last)
        made.append(
            Recording(
                plan.name,
                np.arange(motion.last - motion.first) * 1e-3,
                {name: values[part] for name, values in columns.items()},
                conditions=plan.conditions,
            )
        )
    return made
