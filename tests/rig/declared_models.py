"""The four declared balances of the rig, of catalogue effects, and a campaign to fit them on."""

from collections.abc import Iterable

import numpy as np

from estimation.campaign import Campaign
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.recording import Recording
from rig.protocol import load_protocol
from rig.simulation.parameters import PlantParameters, SensorParameters
from rig.simulation.twin import reference_of, simulate

STRETCH = "cable_stretch_rad"


def term(name: str, sign: int = 1, **channels: str) -> Term:
    return Term(effect(name), sign, channels)


MOTOR = Model(
    "motor",
    "motor",
    "proximal_torque_n_m",
    (
        term("motor.torque_constant"),
        term("inertia.missing", -1),
        term("friction.viscous", -1),
        term("friction.coulomb", -1),
        term("sensor.offset"),
    ),
)
GEARBOX = Model(
    "gearbox",
    "gearbox",
    "gearbox_differential_rad",
    (term("spring.position", position="proximal_torque_n_m"), term("sensor.offset")),
)
CABLE = Model(
    "cable",
    "cable",
    "proximal_torque_n_m",
    (
        term("transmission.ratio"),
        term("friction.viscous", speed="spindle_velocity_rad_s"),
        term("friction.coulomb", speed="spindle_velocity_rad_s"),
        term("inertia.missing", acceleration="spindle_acceleration_rad_s2"),
        term("sensor.offset"),
    ),
)
STRETCHED = Model(
    "stretch",
    "stretch",
    STRETCH,
    (term("spring.position", position="distal_torque_n_m"), term("sensor.offset")),
)


def with_stretch(recordings: Iterable[Recording], ratio: float) -> Campaign:
    return Campaign.of(
        r.with_columns(**{STRETCH: ratio * r["spindle_angle_rad"] - r["jaw_angle_rad"]})
        for r in recordings
    )


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
