"""A session with the rig as the stream of blocks the display shows."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.transport import Transport
from estimation.channels import ESTIMATED, unit_of
from estimation.recording import Flag, FloatArray
from rig.bench.companions import Beside, Companion
from rig.bench.session import Session
from rig.configuration.config import Config
from rig.live.block import DeviceStatus, LimitStatus, SampleBlock
from rig.live.estimator import LiveEstimator, within_range
from rig.live.keys import LEAVE, MARK, RECORD, STOP, TARE, Keys, no_keys
from rig.live.status import CalibrationStatus
from rig.log.devices import topic_of
from rig.machines.reading import Reading
from rig.protocols.protocol import Plan
from rig.recording.recorder import LiveRecorder

ZERO_S = 0.5


def session_blocks(
    config: Config,
    open_transport: Callable[[], Transport],
    plans: Sequence[Plan],
    estimators: Sequence[LiveEstimator],
    keys: Keys = no_keys,
    folder: Path = Path("logs"),
) -> Iterator[SampleBlock]:
    """Open the rig, take its zeros, and yield what it measures until closed.

    The session lives inside the generator: closing it disarms the rig before anything else happens.
    Without plans the rig is only watched. The estimators have seen nothing yet. Recordings started
    by a key go to the folder.
    """
    with Session(config, open_transport()) as session:
        session.take_zeros(ZERO_S)
        if plans:
            session.settle()
            session.take_zeros(ZERO_S)
        calibrations = CalibrationStatus(config, session.calibrations.name)
        held = _Held(session.companions)
        named = dict.fromkeys(f"{ESTIMATED}{one.target_channel}" for one in estimators)
        with closing(_Hand(session, keys, LiveRecorder(session, folder, further=[*named]))) as hand:
            for reading in _readings(session, plans, hand):
                estimates, recorded = {}, {**reading.columns}
                for one in estimators:
                    estimate = one.push(reading.columns, reading.time_s)
                    estimates[one.target_channel] = estimate
                    recorded[f"{ESTIMATED}{one.target_channel}"] = within_range(one, estimate)
                devices = tuple(_device_status(session, reading))
                limits = _limits(session, reading)
                beside = session.take_beside()
                hand.obey(replace(reading, columns=recorded), beside)
                if hand.leaves:
                    return
                yield SampleBlock(
                    reading.time_s,
                    {**reading.columns, **held.columns(beside, len(reading))},
                    reading.flags,
                    estimates,
                    reading.lost,
                    (*devices, calibrations.of(reading), *hand.status()),
                    limits,
                )


class _Hand:
    """Actions of the keys in a session: tare, mark, record, stop, quit."""

    def __init__(self, session: Session, keys: Keys, recorder: LiveRecorder) -> None:
        self._session = session
        self._keys = keys
        self._recorder = recorder
        self._said = ""
        self.leaves = False
        self.stopped = False

    def obey(self, reading: Reading, beside: Mapping[str, Beside]) -> None:
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
        self._recorder.write(reading, beside)

    def status(self) -> Iterator[DeviceStatus]:
        """Yield the messages for the user."""
        if self.stopped:
            yield DeviceStatus("stop", "disarmed", "confirmed by the board")
        if said := ", ".join(filter(None, (self._recorder.said, self._said))):
            yield DeviceStatus("recording", "on" if self._recorder.is_on else "off", said)

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


class _Held:
    """Values of further devices for the display, which come at rates of their own.

    Those that came with a block are spread evenly over it, and the last one is held in the next: a
    display shows them late by a block. A log has them at their own times.
    """

    def __init__(self, companions: Sequence[Companion]) -> None:
        self._companions = companions
        self._last: dict[str, float] = {}

    def columns(self, beside: Mapping[str, Beside], samples: int) -> dict[str, FloatArray]:
        """Return the value of each channel at the samples of a block; none before its first."""
        found = {}
        for companion in self._companions:
            block = beside[topic_of(companion.name)]
            for name, own in companion.recorded.items():
                values = block.columns[own][(block.flags & Flag.MISSING) == 0]
                if values.size:
                    self._last[name] = float(values[-1])
                if name not in self._last:
                    continue
                places = np.linspace(0, 1, samples), np.linspace(0, 1, values.size)
                held = np.full(samples, self._last[name])
                found[name] = np.interp(*places, values) if values.size else held
        return found


def _readings(session: Session, plans: Sequence[Plan], hand: _Hand) -> Iterator[Reading]:
    """Play the runs; once the rig is stopped it is only watched."""
    for plan in plans:
        for reading in session.play(*session.machine.motion(plan, session.here).setpoints):
            yield reading
            if hand.stopped:
                yield from session.watch()
    if not plans:
        yield from session.watch()


def _device_status(session: Session, reading: Reading) -> Iterator[DeviceStatus]:
    """Yield the states of the logger and of the further devices, a silent one of which raises."""
    state = "armed" if reading.armed else "disarmed"
    logger = _with_faults(f"logger {session.identity.serial}", session.counters)
    yield DeviceStatus("logger", state, logger)
    for one in session.companions:
        yield DeviceStatus(one.name, "ok", _with_faults(one.device.name, one.device.counters))


def _with_faults(device: str, counters: Mapping[str, int]) -> str:
    named = (("crc_errors", "bad frames"), ("gaps", "gaps"), ("retries", "retries"))
    faults = [f"{counters[name]} {words}" for name, words in named if counters.get(name)]
    return ", ".join([device, *faults])


def _limits(session: Session, reading: Reading) -> tuple[LimitStatus, ...]:
    return tuple(
        LimitStatus(name, float(np.abs(reading.columns[name]).max()), limit, unit_of(name))
        for name, limit in session.config.limits.model_dump().items()
        if name in reading.columns
    )
