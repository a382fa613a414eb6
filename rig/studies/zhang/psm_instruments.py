"""The eight instruments of Zhang et al. 2022, as the simulated seven-joint arm carries them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Kind:
    """An instrument family as it is drawn around.

    Attributes:
        name: Name of the instrument.
        model: Model number, by which its nominal coupling is known.
        open_rad: Angle to which its gripper opens; closed is 0.
        offset_n_m: Torque of the resting gripper.
        spring_n_m_rad: Stiffness of the gripper's cables against opening.
        friction_n_m: Friction of the gripper.
        memory_n_m: Friction with memory of the gripper.
    """

    name: str
    model: str
    open_rad: float
    offset_n_m: float
    spring_n_m_rad: float
    friction_n_m: float
    memory_n_m: float


KINDS = {
    "LND": Kind("Large Needle Driver", "400006", 1.0, 0.010, 0.02, 0.014, 0.016),
    "CF": Kind("Cadiere Forceps", "400049", 1.0, -0.021, 0.03, 0.011, 0.017),
    "LTF": Kind("Long Tip Forceps", "400048", 1.0, -0.028, 0.03, 0.010, 0.028),
    "MCS": Kind("Monopolar Curved Scissors", "400179", 1.0, -0.026, 0.03, 0.018, 0.018),
    "MBF": Kind("Maryland Bipolar Forceps", "400172", 1.0, -0.031, 0.03, 0.009, 0.034),
    "PF": Kind("ProGrasp Forceps", "400093", 1.0, -0.020, 0.03, 0.028, 0.010),
    "RF": Kind("Resano Forceps", "400181", 1.0, -0.023, 0.03, 0.012, 0.025),
    "SCA": Kind("Small Clip Applier", "400003", 0.7, -0.029, 0.03, 0.016, 0.018),
}
"""The paper's eight instruments. Jaw ranges beyond the dVRK's and all torques are assumed."""
