"""Checks of a device's stream: rate, loss, saturation, stuck channels."""

from collections.abc import Callable

import numpy as np

from drivers.device import Batch, Device, SampleFlag
from drivers.errors import DriverError, ProtocolMismatchError
from rig.doctor.finding import Finding, Level

WATCHED_S = 1.0
MOST_READS = 20_000
MOST_SILENT_READS = 100
RATE_TOLERANCE = 0.02
STANDING_STILL = ("motor_", "spindle_", "jaw_", "fsr_", "position_", "angle")
STANDING_STILL_UNITS = ("rad", "1")
"""Channels that rightly do not change at rest: encoders, a motor without current, an idle FSR."""
COMMANDED = "command_"
"""Channels of a drive alone: its current, supply and temperature come in steps above its noise."""


def device_findings(name: str, open_it: Callable[[], Device]) -> list[Finding]:
    """Open a device of the configuration, read its stream for a second, and report its faults."""
    try:
        device = open_it()
    except DriverError as error:
        return [_failure(name, "open", error)]
    try:
        return _watched(name, device)
    except DriverError as error:
        return [_failure(name, "answer", error)]
    finally:
        device.close()


def _watched(name: str, device: Device) -> list[Finding]:
    identity = device.identify()
    who = " ".join(part for part in (identity.model, identity.serial, identity.firmware) if part)
    device.start()
    batches = _read(device)
    device.stop()
    findings = [Finding(name, "identity", Level.OK, f"{who}.")]
    if sum(len(batch) for batch in batches) < 2:
        what = f"It sends nothing: {_troubles(device) or 'no trouble on the link'}."
        fix = "Check its supply, its wiring, and that it is set to stream."
        return [*findings, Finding(name, "sample rate", Level.ERROR, what, fix)]
    findings.append(_rate_finding(name, device, batches))
    findings.append(_loss_finding(name, device, batches))
    return findings + _channel_findings(name, device, batches)


def _read(device: Device) -> list[Batch]:
    """Return a second of samples by the time they carry, or what came in as many reads."""
    batches: list[Batch] = []
    nothing = 0
    for _ in range(MOST_READS):
        batch = device.read(0.1)
        nothing = 0 if len(batch) else nothing + 1
        if len(batch):
            batches.append(batch)
            if batch.time_s[-1] - batches[0].time_s[0] >= WATCHED_S:
                break
        elif nothing >= MOST_SILENT_READS:
            break
    return batches


def _rate_finding(name: str, device: Device, batches: list[Batch]) -> Finding:
    expected_hz = device.channels[0].rate_hz
    first, last = batches[0], batches[-1]
    # from the end of the first batch: what the host stamps, it stamps by the batch
    span_s = float(last.time_s[-1] - first.time_s[-1])
    rate_hz = float(last.sequence[-1] - first.sequence[-1]) / span_s if span_s > 0 else 0.0
    what = f"{rate_hz:.4g} Hz by the {first.clock}'s clock, {expected_hz:.4g} Hz configured."
    if abs(rate_hz - expected_hz) <= RATE_TOLERANCE * expected_hz:
        return Finding(name, "sample rate", Level.OK, what)
    fix = f"Set the rate on the device, or `rate_hz` in [devices.{name}] options."
    return Finding(name, "sample rate", Level.ERROR, what, fix)


def _loss_finding(name: str, device: Device, batches: list[Batch]) -> Finding:
    lost = batches[-1].lost
    troubles = _troubles(device)
    if not lost and not troubles:
        return Finding(name, "link", Level.OK, "Nothing lost, no trouble on the link.")
    what = f"{lost} samples lost; {troubles or 'no other trouble'}."
    return Finding(name, "link", Level.WARNING, what, "Check cable, connectors, grounds and hub.")


def _channel_findings(name: str, device: Device, batches: list[Batch]) -> list[Finding]:
    flags = np.concatenate([batch.flags for batch in batches])
    saturated = int(np.count_nonzero(flags & SampleFlag.SATURATED))
    findings = []
    if saturated:
        what = f"Saturated in {saturated} of {flags.size} samples."
        fix = "Check wiring and amplifier; unload the sensor; check its range."
        findings.append(Finding(name, "saturation", Level.ERROR, what, fix))
    is_drive = any(channel.name.startswith(COMMANDED) for channel in device.channels)
    for channel in () if is_drive else device.channels:
        if channel.unit in STANDING_STILL_UNITS or channel.name.startswith(STANDING_STILL):
            continue
        values = np.concatenate([batch.columns[channel.name] for batch in batches])
        if np.ptp(values) == 0:
            what = f"{channel.name} did not change in {values.size} samples: {values[0]:g}."
            fix = "A live sensor makes noise: check its wiring, supply and amplifier."
            findings.append(Finding(name, "stuck", Level.WARNING, what, fix))
    return findings or [Finding(name, "channels", Level.OK, "None saturated, none stuck.")]


def _troubles(device: Device) -> str:
    return ", ".join(f"{n} {k}" for k, n in device.counters.items() if n and k != "frames")


def _failure(name: str, check: str, error: DriverError) -> Finding:
    check = "firmware" if isinstance(error, ProtocolMismatchError) else check
    return Finding(name, check, Level.ERROR, f"{error.what} {error.why}".strip(), error.fix)
