"""The bench of a guided calibration: the logger and a force sensor.

Each step opens the devices and closes them again, so that the rig is disarmed and nothing waits in
a buffer while hands are in it.
"""

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.procedure import Measurement, Step
from drivers.device import Batch, Device
from drivers.errors import DriverError
from drivers.transport import Transport
from estimation.recording import Recording
from rig.bench.session import Session
from rig.configuration.config import Config
from rig.machines.reading import Reading
from rig.protocols.protocol import RunPlan

ZERO_S = 0.5
START_TIMEOUT_S = 2.0


class RigBench:
    """Measures steps with devices of a rig: `logger`, `force_sensor` or both.

    Implements `calibration.procedure.Bench`.
    """

    def __init__(
        self,
        config: Config,
        devices: tuple[str, ...],
        open_logger: Callable[[], Transport],
        open_force_sensor: Callable[[], Device] | None = None,
    ) -> None:
        self._config = config
        self._devices = devices
        self._open_logger = open_logger
        self._open_force_sensor = open_force_sensor
        self._zeros: dict[str, float] | None = None

    def measure(self, step: Step) -> Measurement:
        """Measure one step.

        Raises:
            RigError: A device failed, or a limit was crossed; the rig is safe.
        """
        if step.target_angle_rad is not None:
            return self._play(step)
        with ExitStack() as stack:
            force = self._force_sensor(stack)
            if "logger" not in self._devices:
                assert force is not None  # noqa: S101 - a procedure names a device
                return _of_force(step, self._config, force, read_for(force, step.duration_s))
            session = stack.enter_context(Session(self._config, self._open_logger()))
            readings: list[Reading] = []
            batches: list[Batch] = []
            for reading in session.rest(step.duration_s):
                readings.append(reading)
                if force is not None:
                    elapsed_s = reading.time_s[-1] - readings[0].time_s[0]
                    batches += _caught_up(force, batches, elapsed_s)
            measured = self._measured(session, step, readings)
            if force is None:
                return measured
            return _joined(measured, force, _together(batches))

    def _play(self, step: Step) -> Measurement:
        assert step.target_angle_rad is not None  # noqa: S101
        assert step.load_command_a is not None  # noqa: S101
        plan = RunPlan(step.name, step.target_angle_rad, step.load_command_a)
        with Session(self._config, self._open_logger()) as session:
            for _ in session.rest(ZERO_S):
                pass
            if self._zeros is None:
                session.settle()
                self._zeros = session.take_zeros(ZERO_S)
            # one zero for all steps: at rest the sensor shows what friction happens to hold, and
            # that differs from step to step by more than the sensor's own zero does
            session.zeros = dict(self._zeros)
            motion = session.machine.motion(plan, session.here)
            of_run = []
            for reading in session.play(*motion.setpoints):
                setpoint = reading.setpoint
                of_run.append(reading.where((setpoint >= motion.first) & (setpoint < motion.last)))
            return self._measured(session, step, [reading for reading in of_run if len(reading)])

    def _measured(self, session: Session, step: Step, readings: list[Reading]) -> Measurement:
        time_s = np.concatenate([reading.time_s for reading in readings])
        names = readings[0].columns
        recording = Recording(
            step.name,
            time_s - time_s[0],
            {name: np.concatenate([r.columns[name] for r in readings]) for name in names},
            flags=np.concatenate([reading.flags for reading in readings]),
            conditions=step.conditions,
            rig=self._config.name,
            instrument=self._config.instrument.identity(),
            calibrations={session.calibrations.name: session.calibrations.content_hash},
        )
        counts = np.concatenate([reading.counts for reading in readings])
        return Measurement(recording, counts, {**session.board})

    def _force_sensor(self, stack: ExitStack) -> Device | None:
        if "force_sensor" not in self._devices or self._open_force_sensor is None:
            return None
        device = self._open_force_sensor()
        stack.callback(_close, device)
        device.identify()
        device.start()
        return device


def read_for(device: Device, duration_s: float) -> Batch:
    """Read a device for a while, by its nominal rate; DriverError where it sends too little."""
    rate_hz = device.channels[0].rate_hz
    wanted = round(duration_s * rate_hz)
    batches: list[Batch] = []
    got = idle = 0
    while got < wanted:
        batches.append(device.read(0.1))
        got += len(batches[-1])
        idle = 0 if len(batches[-1]) else idle + 1
        if idle * 0.1 > START_TIMEOUT_S:
            raise DriverError(
                f"The force sensor has sent nothing for {START_TIMEOUT_S:g} s.",
                fix="Check its supply and its cable.",
            )
    return _together(batches)


def _caught_up(device: Device, before: list[Batch], elapsed_s: float) -> list[Batch]:
    """Return the data of a device up to the logger's time, or all that it has."""
    got = sum(len(batch) for batch in before)
    batches: list[Batch] = []
    while got / device.channels[0].rate_hz < elapsed_s:
        batch = device.read(0.02)
        if not len(batch):
            break
        batches.append(batch)
        got += len(batch)
    return batches


def _close(device: Device) -> None:
    with suppress(DriverError):
        device.close()


def _together(batches: list[Batch]) -> Batch:
    full = [batch for batch in batches if len(batch)]
    if not full:
        raise DriverError("The force sensor sent nothing.", fix="Check its supply and its cable.")
    return Batch(
        {name: np.concatenate([b.columns[name] for b in full]) for name in full[0].columns},
        np.concatenate([b.time_s for b in full]),
        full[0].clock,
        np.concatenate([b.sequence for b in full]),
        np.concatenate([b.flags for b in full]),
        full[-1].lost,
    )


def _force_times(device: Device, batch: Batch) -> NDArray[np.float64]:
    """Return the times of samples since the first by their numbers: a read stamps all alike."""
    number = batch.sequence.astype(np.float64)
    return np.asarray((number - number[0]) / device.channels[0].rate_hz)


def _said(device: Device) -> dict[str, float | str]:
    """Return the identity of a force sensor: serial, and counts per unit where available."""
    return {"force_sensor": device.name, **(getattr(device, "counts_per_unit", None) or {})}


def _of_force(step: Step, config: Config, device: Device, batch: Batch) -> Measurement:
    recording = Recording(
        step.name,
        _force_times(device, batch),
        batch.columns,
        flags=batch.flags,
        conditions=step.conditions,
        rig=config.name,
    )
    return Measurement(recording, None, _said(device))


def _joined(measured: Measurement, device: Device, batch: Batch) -> Measurement:
    """Put the force sensor's columns on the logger's clock; both are taken to begin together.

    They begin within one read of each other, some milliseconds on a real bench: press slowly.
    """
    force_s = _force_times(device, batch)
    kept = np.flatnonzero(measured.recording.time_s <= force_s[-1])
    recording = measured.recording.at(kept)
    forces = {n: np.interp(recording.time_s, force_s, v) for n, v in batch.columns.items()}
    after = np.searchsorted(force_s, recording.time_s)
    joined = replace(recording.with_columns(**forces), flags=recording.flags | batch.flags[after])
    counts = None if measured.counts is None else measured.counts[kept]
    return Measurement(joined, counts, {**measured.details, **_said(device)})
