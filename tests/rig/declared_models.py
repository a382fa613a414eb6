"""The four declared balances of the rig, as shipped, and a campaign to fit them on."""

import numpy as np

from estimation import model_file
from estimation.recording import Recording
from rig.protocols.protocol import load_protocol
from rig.simulation.parameters import PlantParameters, SensorParameters
from rig.simulation.twin import reference_of, simulate

MODELS = model_file.reference_rig()


def record(
    plant: PlantParameters, sensors: SensorParameters, every: int = 2, seed: int = 0
) -> list[Recording]:
    """Simulate every n-th run of the diagnosis protocol, sensors and all."""
    runs = []
    for index, plan in enumerate(load_protocol("diagnosis").plans()[::every]):
        t = np.arange(plan.target_angle_rad.size, dtype=np.float64) * 1e-3
        columns = {
            name: np.zeros(t.size)
            for name in (
                "motor_angle_rad",
                "jaw_angle_rad",
                "proximal_torque_n_m",
                "distal_torque_n_m",
                "motor_current_a",
            )
        }
        columns |= {
            "target_angle_rad": plan.target_angle_rad,
            "spindle_angle_rad": plan.target_angle_rad,
            "load_command_a": plan.load_command_a,
        }
        asked = Recording(plan.name, t, columns, conditions=plan.conditions)
        runs.append(simulate(reference_of(asked), plant, sensors, seed * 1000 + index))
    return runs
