"""A session with the rig as the stream of blocks the display shows."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.transport import Transport
from estimation.channels import ESTIMATED, unit_of
from rig.bench.session import Session
from rig.configuration.config import Config
from rig.live.block import DeviceStatus, LimitStatus, SampleBlock
from rig.live.calibration_status import CalibrationStatus
from rig.live.keys import LEAVE, MARK, RECORD, STOP, TARE, Keys, no_keys
from rig.live.replay import EstimateStream, within_range
from rig.machines.reading import Reading
from rig.protocols.protocol import Plan
from rig.recording.recorder import LiveRecorder

ZERO_S = 0.5


def session_blocks(
    config: Config,
    open_transport: Callable[[], Transport],
    plans: Sequence[Plan],
    estimators: Sequence[EstimateStream],
    keys: Keys = no_keys,
    folder: Path = Path("logs"),
) -> Iterator[SampleBlock]:
    """Open the rig, take its zeros, and yield what it measures until closed.

    The session lives inside the generator: closing it disarms the rig before anything else happens.

    Args:
        config: The rig's configuration.
        open_transport: Opens the way to the logger.
        plans: Runs to play one after the other; without any, the rig is only watched.
        estimators: Streams before their first sample; empty for none.
        keys: Keys pressed; see `rig.live.keys`.
        folder: Folder of the recordings started by a key.
    """
    with Session(config, open_transport()) as session:
        session.take_zeros(ZERO_S)
        if plans:
            session.settle()
            session.take_zeros(ZERO_S)
        calibrations = CalibrationStatus(config, session.calibrations.name)
        named = dict.fromkeys(f"{ESTIMATED}{one.target_channel}" for one in estimators)
        with closing(_Hand(session, keys, LiveRecorder(session, folder, further=[*named]))) as hand:
            for reading in _readings(session, plans, hand):
                block = _block(session, reading, estimators)
                estimated = {
                    f"{ESTIMATED}{e.target_channel}": within_range(
                        e, block.estimates[e.target_channel]
                    )
                    for e in estimators
                }
                hand.obey(replace(reading, columns={**reading.columns, **estimated}))
                if hand.leaves:
                    return
                said = (*block.devices, calibrations.of(reading), *hand.status())
                yield replace(block, devices=said)


class _Hand:
    """Actions of the keys in a session: tare, mark, record, stop, quit."""

    def __init__(self, session: Session, keys: Keys, recorder: LiveRecorder) -> None:
        self._session = session
        self._keys = keys
        self._recorder = recorder
        self._said = ""
        self.leaves = False
        self.stopped = False

    def obey(self, reading: Reading) -> None:
        """Do what the keys pressed since the last reading ask for, and record."""
        for key in self._keys():
            if key == LEAVE:
                self.leaves = True
            elif key == STOP:
                self._session.safe()  # raises unless the board confirms it
                self.stopped = True
            elif key == TARE:
                self._tare(reading)
            elif key == RECORD:
                self._recorder.stop() if self._recorder.is_on else self._recorder.start()
                self._said = ""
            elif key == MARK:
                self._recorder.mark()
                self._said = "" if self._recorder.is_on else "no recording to mark: r starts one"
        self._recorder.write(reading)

    def status(self) -> tuple[DeviceStatus, ...]:
        """Return the message for the user."""
        said = ", ".join(part for part in (self._recorder.said, self._said) if part)
        found = []
        if self.stopped:
            found.append(DeviceStatus("stop", "disarmed", "confirmed by the board"))
        if said:
            state = "on" if self._recorder.is_on else "off"
            found.append(DeviceStatus("recording", state, said))
        return tuple(found)

    def close(self) -> None:
        """Close a log that is open."""
        self._recorder.stop()

    def _tare(self, reading: Reading) -> None:
        if reading.armed:
            self._said = "no tare while the rig moves"
        elif self._recorder.is_on:
            self._said = "no tare in a recording: its zeros are written at its start"
        else:
            self._session.take_zeros(ZERO_S)
            self._said = "tared"


def _readings(session: Session, plans: Sequence[Plan], hand: _Hand) -> Iterator[Reading]:
    """Play the runs; once the rig is stopped it is only watched."""
    for plan in plans:
        for reading in session.play(*session.machine.motion(plan, session.here).setpoints):
            yield reading
            if hand.stopped:
                yield from session.watch()
    if not plans:
        yield from session.watch()


def _block(session: Session, reading: Reading, estimators: Sequence[EstimateStream]) -> SampleBlock:
    estimates = {}
    for estimator in estimators:
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
