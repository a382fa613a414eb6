"""The grasper's motors go where the master goes, in position, sample for sample."""

from collections.abc import Iterator

import numpy as np

from drivers.device import Device
from drivers.errors import LinkTimeoutError
from drivers.teensy.grasper import GRASPER
from estimation.recording import FloatArray
from rig.grasper.machine import axes_of_joints
from rig.grasper.master import Master
from rig.grasper.three_dof import JOINTS

READ_S = 0.02
LEAD_S = 0.05
"""Setpoints are this far ahead of the motors, s: the delay for the user's hand."""
SILENT_READS = 50


def setpoints(
    master: Device,
    chief: Master,
    here: tuple[float, ...],
    duration_s: float,
    scale: float = 1.0,
) -> Iterator[tuple[FloatArray, ...]]:
    """Yield what `rig.bench.session.Session.follow` plays, so that the grasper follows its master.

    However the master is held at first, the motors start where they stand and go as far as it goes
    from there. Each sample of the master is one setpoint: both run at 2 kHz. A master that is ahead
    is followed where it is now, and what it did meanwhile is left out.

    Args:
        master: The master's potentiometers, started.
        chief: What their counts mean.
        here: Where yaw, jaw 1 and jaw 2 stand, closing positive, rad.
        duration_s: Time to follow, s.
        scale: Joint angle per angle of the master.

    Yields:
        Angles of yaw, jaw 1 and jaw 2, rad, each of shape (n,).

    Raises:
        GrasperError: A potentiometer is at its rail.
        LinkTimeoutError: The master sends nothing.
        DriverError: Its link is lost.
    """
    first: FloatArray | None = None
    remaining = round(duration_s * GRASPER.rate_hz)
    while remaining > 0:
        counts = _counts(master)[-min(GRASPER.max_setpoints, remaining) :]
        joints = scale * chief.joint_rad(counts)
        first = joints[0] if first is None else first
        remaining -= len(joints)
        yield tuple((np.array(here) + axes_of_joints(joints - first)).T)


def _counts(master: Device) -> FloatArray:
    """Return the master's next counts of yaw, pitch and grasp, shape (n, 3), n at least 1."""
    for _ in range(SILENT_READS):
        batch = master.read(READ_S)
        if len(batch):
            return np.column_stack([batch.columns[f"{joint}_count"] for joint in JOINTS])
    raise LinkTimeoutError(
        f"The master has sent nothing for {SILENT_READS * READ_S:g} s.",
        "Its cable was pulled, or its board was reset.",
        "Check the cable, then start again.",
    )
