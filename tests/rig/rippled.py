"""A small campaign of the simulated rig whose motor ripples."""

from pathlib import Path

from estimation import model_file
from estimation.recording import Recording
from rig.protocols.protocol import Protocol
from rig.simulation.campaign import bench_at, simulated_run
from rig.simulation.fitted import DECLARED_PLANT
from rig.simulation.hidden import HiddenEffect

MOTOR = model_file.read(Path("motor"))

RUN = {"kind": "sine", "amplitude_rad": 0.3, "duration_s": 4.0}
PROTOCOL = Protocol.model_validate(
    {
        "name": "small",
        "runs": [
            RUN | {"frequencies_hz": [0.25, 0.4], "loads_a": [0.2, 0.5, 0.8]},
            RUN | {"frequencies_hz": [0.3], "loads_a": [0.4], "repeats": 3},
        ],
    }
)


def record(*effects: HiddenEffect) -> list[Recording]:
    """Play the small protocol on a rig that the declared equations describe, but for effects."""
    made = []
    for seed, plan in enumerate(PROTOCOL.plans()):
        start_rad = float(plan.target_angle_rad[0])
        bench = bench_at(start_rad, DECLARED_PLANT, effects=effects, seed=seed)
        made.append(simulated_run(bench, plan, "simulated"))
    return made
