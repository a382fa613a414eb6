"""A small campaign of the simulated rig whose motor ripples, and a part of the catalogue."""

from pathlib import Path

import numpy as np

from estimation import model_file
from estimation.diagnosis import candidate
from estimation.diagnosis.gates import Gates
from estimation.recording import Recording
from rig.protocols.motion import motion_of
from rig.protocols.protocol import Protocol
from rig.simulation.bench import SimulatedBench
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import HiddenEffect
from rig.simulation.play import play
from rig.simulation.sensors import spindle_count_of

MOTOR = model_file.read(Path("motor"))
QUICK = Gates(surrogates=59)

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
    """Play the small protocol on a rig that the declared balances describe, but for effects."""
    made = []
    for k, plan in enumerate(PROTOCOL.plans()):
        start = float(plan.target_angle_rad[0])
        bench = SimulatedBench(DECLARED_PLANT, None, effects, k, 0)
        bench = SimulatedBench(
            DECLARED_PLANT, None, effects, k, spindle_count_of(start, bench.sensors)
        )
        motion = motion_of(plan, start)
        columns = play(bench, motion.target_angle_rad, motion.load_command_a)
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


def few(model, measured):
    """A part of the catalogue: what is tested is not how many effects there are."""
    return [
        c
        for c in candidate.pool(model, measured)
        if c.family in ("friction.stribeck", "friction.drag")
        or (c.family.startswith("ripple.") and c.shape[0] % 1 == 0)
    ]
