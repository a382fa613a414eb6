"""A session with the rig as the stream of blocks the display shows."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from drivers.transport import Transport
from estimation.channels import unit_of
from rig.config import Config
from rig.live.block import DeviceStatus, LimitStatus, SampleBlock
from rig.live.replay import EstimateStream
from rig.motion import motion_of
from rig.protocol import RunPlan
from rig.reading import Reading
from rig.session import Session

ZERO_S = 0.5


def session_blocks(
    config: Config,
    open_transport: Callable[[], Transport],
    plans: Sequence[RunPlan],
    estimator: EstimateStream | None,
) -> Iterator[SampleBlock]:
    """Open the rig, take its zeros, and yield what it measures until closed.

    The session lives inside the generator: closing it disarms the rig before anything else happens.

    Args:
        config: The rig's configuration.
        open_transport: Opens the way to the logger.
        plans: Runs to play one after the other; without any, the rig is only watched.
        estimator: A stream that has seen nothing yet; None for none.
    """
    with Session(config, open_transport()) as session:
        session.take_zeros(ZERO_S)
        if plans:
            session.settle()
            session.take_zeros(ZERO_S)
        for reading in _readings(session, plans):
            yield _block(session, reading, estimator)


def _readings(session: Session, plans: Sequence[RunPlan]) -> Iterator[Reading]:
    for plan in plans:
        motion = motion_of(plan, session.spindle_angle_rad)
        yield from session.play(motion.target_angle_rad, motion.load_command_a)
    if not plans:
        yield from session.watch()


def _block(session: Session, reading: Reading, estimator: EstimateStream | None) -> SampleBlock:
    estimates = {}
    if estimator is not None:
        estimates[estimator.target_channel] = estimator.push(reading.columns, reading.time_s)
    return SampleBlock(
        reading.time_s,
        reading.columns,
        reading.flags,
        estimates,
        reading.lost,
        (_logger_status(session, reading),),
        _limits(session, reading),
    )


def _logger_status(session: Session, reading: Reading) -> DeviceStatus:
    counters = session.counters
    faults = [
        f"{counters[name]} {words}"
        for name, words in (("crc_errors", "bad frames"), ("gaps", "gaps"), ("retries", "retries"))
        if counters[name]
    ]
    state = "armed" if reading.armed else "disarmed"
    detail = ", ".join([f"logger {session.identity.serial}", *faults])
    return DeviceStatus("logger", state, detail)


def _limits(session: Session, reading: Reading) -> tuple[LimitStatus, ...]:
    return tuple(
        LimitStatus(name, float(np.abs(reading.columns[name]).max()), limit, unit_of(name))
        for name, limit in session.config.limits.model_dump().items()
        if name in reading.columns
    )
