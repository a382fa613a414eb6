"""The drive chain of the reference rig, read from its machine file: what each calibration reads."""

from dataclasses import dataclass

from estimation.plant import Plant
from estimation.plant_file import shipped_plant


@dataclass(frozen=True, slots=True)
class Pair:
    """An encoder, its reference, and the torque between the two."""

    channel: str  # angle of the encoder
    reference: str  # angle of the encoder before it in the chain
    torque: str  # torque between the two
    ratio: float  # travel of the reference per travel of the encoder, by the label

    @property
    def nominal_ratio(self) -> float:
        """Travel of the encoder per travel of the reference."""
        return 1.0 / self.ratio


def pairs(plant: Plant) -> dict[str, Pair]:
    """Return the encoder behind each transmission that has both angles and a torque, by axis."""
    found = {}
    for joint in plant.transmissions:
        own, reference = plant.position(joint.output), plant.position(joint.input)
        torque = plant.effort(joint.output)
        if own and reference and torque:
            ratio = 1.0 if joint.ratio is None else joint.ratio
            found[joint.output] = Pair(own.name, reference.name, torque.name, ratio)
    return found


REFERENCE = shipped_plant("reference")
PAIRS = pairs(REFERENCE)
GEAR = next(iter(PAIRS.values()))
"""The first transmission: the gear."""

CURRENT = REFERENCE.actuators[0].name
