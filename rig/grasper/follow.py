"""The grasper's motors go where the master goes, in position, sample for sample, into a log."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.device import Device
from drivers.errors import LinkTimeoutError
from drivers.teensy.grasper import GRASPER
from estimation.recording import FloatArray
from rig.bench.logger import open_logger, open_section
from rig.bench.session import Session
from rig.configuration.config import Config, is_simulated
from rig.configuration.sections import DeviceSection
from rig.errors import UsageError
from rig.grasper.machine import AXES, axes_of_joints
from rig.grasper.settings import MasterSection, master_section
from rig.machines.reading import Reading
from rig.protocols.joints import JOINTS
from rig.recording.recorder import LiveRecorder

DRIVER = "teensy-master"
SIMULATED_URL = "sim://"
ZEROS_S = 0.5
READ_S = 0.02
LEAD_S = 0.05
"""Setpoints are this far ahead of the motors, s: the delay for the user's hand."""
SILENT_READS = 50


def setpoints(
    master: Device,
    chief: MasterSection,
    here: tuple[float, ...],
    duration_s: float,
    scale: float = 1.0,
) -> Iterator[tuple[FloatArray, ...]]:
    """Yield what `rig.bench.session.Session.follow` plays, so that the grasper follows its master.

    However the master is held at first, the motors start where they stand (`here`) and go as far as
    it goes from there, times `scale`. Each sample of the master is one setpoint: both run at 2 kHz.
    A master that is ahead is followed where it is now, and what it did meanwhile is left out.

    Yields:
        Angles of yaw, jaw 1 and jaw 2, closing positive, rad, each of shape (n,).

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


@dataclass(slots=True)
class Followed:
    """Motion of one motor: `yaw`, `jaw_1` or `jaw_2`.

    The errors are those of its angle to its setpoint, the force is that at its tip.
    """

    axis: str
    lowest_rad: float = np.inf
    highest_rad: float = -np.inf
    largest_error_rad: float = 0.0
    largest_force_n: float = 0.0

    def add(self, reading: Reading) -> None:
        """Take in samples that played a setpoint."""
        angle = reading.columns[f"{self.axis}_angle_rad"]
        error = np.abs(angle - reading.columns[f"{self.axis}_target_rad"])
        force = reading.columns[f"{self.axis}_force_n"]
        self.lowest_rad = min(self.lowest_rad, float(angle.min()))
        self.highest_rad = max(self.highest_rad, float(angle.max()))
        self.largest_error_rad = max(self.largest_error_rad, float(error.max()))
        self.largest_force_n = max(self.largest_force_n, float(force.max()))


def follow_master(
    config: Config,
    url: str | None,
    duration_s: float,
    scale: float,
    folder: Path,
    on_time: Callable[[float], None] = lambda time_s: None,
) -> tuple[list[Followed], Path]:
    """Let the grasper follow its master into a log; return what its motors did, and the log.

    Whatever ends it, the rig is disarmed and the log closed. The master's URL is that of the
    configuration if None; `scale` is the joint angle per angle of the master. `on_time` is called
    with the time it has followed, s.

    Raises:
        UsageError: The configuration is of another kind of rig, or the master's URL is missing.
        GrasperError: A potentiometer is at its rail.
        SafetyTripError: A limit was crossed.
        DriverError: A link is lost.
    """
    chief = master_section(config)
    url = url or chief.url
    if url is None and not config.is_simulated:
        raise UsageError("Where is the master?", fix="Write for example --master usb:16c0:0483.")
    section = DeviceSection(driver=DRIVER, url=url or SIMULATED_URL)
    if is_simulated(section.url) and not config.is_simulated:
        raise UsageError(
            "A simulated master does not move a real grasper.", fix="Say where the real one is."
        )
    followed = [Followed(axis) for axis in AXES]
    with ExitStack() as stack:
        master = stack.enter_context(closing(open_section(section)))
        session = stack.enter_context(Session(config, open_logger(config)))
        session.take_zeros(ZEROS_S)
        master.identify()
        master.start()
        recorder = LiveRecorder(session, folder, "follow")
        stack.callback(recorder.stop)
        recorder.start()
        asked = setpoints(master, chief, session.here, duration_s, scale)
        for reading in session.follow(asked, LEAD_S):
            recorder.write(reading, session.take_beside())
            played = reading.where(reading.setpoint >= 0)
            if len(played):
                for axis in followed:
                    axis.add(played)
                on_time(float(played.setpoint[-1] + 1) / session.machine.profile.rate_hz)
        assert recorder.path is not None  # noqa: S101  it was started
        return followed, recorder.path
