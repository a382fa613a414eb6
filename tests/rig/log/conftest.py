"""A small log like a recorder's: two streams, 20 ms blocks, marks, attachments."""

from pathlib import Path

import numpy as np
import pytest

from estimation.recording import Flag, Instrument, Mark, Stretch
from rig.log.container import Attached
from rig.log.convert import log_times_ns
from rig.log.run import RunEnd, RunInfo
from rig.log.streams import COUNTS, COUNTS_STREAM, SAMPLE, sample_stream
from rig.log.writer import LogWriter

RATE_HZ = 1000.0
STARTED_AT_NS = 1_790_000_000_000_000_000
CHANNELS = ("motor_current_a", "spindle_angle_rad", "proximal_torque_n_m")


def blocks(samples: int, drop: frozenset[int] = frozenset()):
    """Yield the streams' rows and log times, 20 samples at a time, without the dropped ones."""
    random = np.random.default_rng(1)
    columns = random.normal(size=(len(CHANNELS), samples))
    counts = random.integers(-(2**31), 2**31, size=(10, samples))
    for first in range(0, samples, 20):
        sequence = np.array([k for k in range(first, min(first + 20, samples)) if k not in drop])
        if not sequence.size:
            continue
        time_s = sequence / RATE_HZ
        log_time_ns = log_times_ns(time_s, STARTED_AT_NS)
        rows = {name: column[sequence] for name, column in zip(CHANNELS, columns, strict=True)}
        rows |= {"time_s": time_s, "sequence": sequence, "flags": np.zeros(sequence.size, int)}
        names = [field.name for field in COUNTS_STREAM.fields][:10]
        raw = {name: column[sequence] for name, column in zip(names, counts, strict=True)}
        raw |= {"sequence": sequence, "tick_us": sequence * 1000, "status": sequence * 0}
        yield rows, raw, log_time_ns


def write_log(path, samples=600, drop=frozenset(), duration_s=None) -> Path:
    run = RunInfo(
        name=path.stem,
        rig="bench 1",
        instrument=Instrument("Maryland", serial="0042", uses=3),
        conditions={"load_command_a": 0.3, "object": "spring"},
        notes="first try",
        started_at_ns=STARTED_AT_NS,
        duration_s=duration_s,
        calibrations={"proximal": "ab12"},
        zeros_before={"proximal_torque_n_m": 1.5e-3},
        details={"protocol": {"kind": "sine", "frequencies_hz": [0.5, 1.0]}},
    )
    attachments = [Attached("rig.toml", "application/toml", b"[rig]\nname = 'bench 1'\n")]
    streams = [sample_stream(CHANNELS, RATE_HZ), COUNTS_STREAM]
    with LogWriter(path, run, streams, attachments=attachments) as writer:
        for rows, raw, log_time_ns in blocks(samples, drop):
            writer.write(SAMPLE, rows, log_time_ns)
            writer.write(COUNTS, raw, log_time_ns)
        writer.add(Mark(0.1, "finger on the jaw"))
        writer.add(Stretch(0.2, 0.3, Flag.SUSPECT, "re-index", "spindle_angle_rad"))
        end = RunEnd(
            expected_samples={SAMPLE: samples},
            counters={"crc_errors": 2},
            zeros_after={"proximal_torque_n_m": 1.6e-3},
            drift={"proximal_torque_n_m": 1e-4},
            drift_verdict="within limits",
        )
        writer.close(end)
    return path


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "run.mcap")


def flip(path: Path, place: int, bit: int = 1) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= bit
    path.write_bytes(data)
