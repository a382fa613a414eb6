"""The master's three potentiometers, read by the converter of a Teensy that drives no motor."""

from drivers.registry import Driver, opener
from drivers.teensy.device import TeensyDevice, raw_channel
from drivers.teensy.grasper import GRASPER
from drivers.transport import open_transport
from drivers.transport.transport import Transport

JOINTS = {"yaw": "force_1", "pitch": "force_2", "grasp": "force_3"}

POTS = {
    field: raw_channel(f"{joint}_count", field, GRASPER, f"potentiometer of the {joint}, 12 bits")
    for joint, field in JOINTS.items()
}
"""The board's three analogue inputs, which at a grasper are its force sensors."""


class TeensyMaster(TeensyDevice):
    """Counts of the potentiometers at 2 kHz, on the board's clock. It is never armed."""

    name = "teensy-master"

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport, POTS, GRASPER)


DRIVER = Driver(
    "teensy-master",
    "The 3-DOF grasper's master, potentiometers",
    opener(TeensyMaster, "master", open_transport),
)
