"""The grasper's motors follow the master, in position, sample for sample."""

from collections.abc import Iterator

import numpy as np

from drivers.device import Device
from drivers.teensy.driver import SampleBatch, TeensyLogger
from estimation.recording import FloatArray
from rig.grasper.master import Master
from rig.grasper.three_dof import JOINTS

READ_S = 0.02


def follow(
    master: Device, chief: Master, board: TeensyLogger, motor_rad_per_count: FloatArray
) -> Iterator[SampleBatch]:
    """Send the motors where the master is, until the caller stops.

    Each sample of the master is one setpoint of the board: both run at 2 kHz. Whatever ends it, the
    board is disarmed.

    Args:
        master: The master's potentiometers, started.
        chief: What their counts ask of the motors.
        board: The grasper's board, armed and started.
        motor_rad_per_count: Turn of each motor's shaft for a count, shape (3,).

    Yields:
        What the board measured meanwhile.

    Raises:
        GrasperError: A potentiometer is at its rail, or a joint asked beyond its limits.
        DriverError: A link is lost, or the board refuses.
    """
    try:
        while True:
            batch = master.read(READ_S)
            if len(batch):
                counts = np.column_stack([batch.columns[f"{joint}_count"] for joint in JOINTS])
                asked = np.round(chief.motor_rad(counts) / motor_rad_per_count)
                board.queue(*asked.astype(np.int64).T)
            yield board.read(READ_S)
    finally:
        board.disarm()
