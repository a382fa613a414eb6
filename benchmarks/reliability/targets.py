"""What is fuzzed: every decoder, good inputs to begin with, and an oracle for what it accepts.

An oracle raises `AssertionError` when an accepted input means another value than the decoder says.
Where a format has a checksum, the oracle computes it by other means; where it has none, what was
decoded must encode to the same bytes again.
"""

import binascii
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from cobs import cobs

from calibration.errors import CalibrationError
from drivers.ati_can import protocol as ati_can
from drivers.ati_net import protocol as ati_net
from drivers.ati_serial import protocol as ati_serial
from drivers.counters import DeviceCounters
from drivers.epos4 import protocol as epos4
from drivers.errors import DriverError
from drivers.framing import FrameStream, encode_frame
from drivers.qia128 import protocol as qia128
from drivers.streaming import SlidingFrames
from drivers.teensy import protocol as teensy
from drivers.teensy.fake import PythonBoard
from drivers.teensy.fake_device import HandMovedBench
from drivers.teensy.reference import REFERENCE, SAMPLE_DTYPE, Limits
from drivers.usb520 import protocol as usb520
from estimation.errors import EstimationError
from rig.configuration.config import SHIPPED, load_config, shipped_configs, to_toml
from rig.errors import RigError

REFUSALS = (DriverError, RigError, EstimationError, CalibrationError)
"""What a decoder may raise."""


@dataclass(frozen=True)
class Target:
    """One decoder.

    Attributes:
        seeds: Makes good inputs, which are mutated.
        run: Decodes an input and holds what it accepts against the oracle; returns whether it
            accepted anything, or raises one of `REFUSALS`.
        share: How much of the inputs beyond the least it gets.
    """

    name: str
    seeds: Callable[[], list[bytes]]
    run: Callable[[bytes], bool]
    share: int


def _commands() -> list[bytes]:
    gains, limits = np.array([20.0, 0.2, 4.0, 0.3, 2700.0]), Limits()
    commands = [(teensy.VERSION, kind, 7) for kind in teensy.Kind if kind >= 16]
    payloads = [np.array(one, teensy.HEADER_DTYPE).tobytes() for one in commands]
    payloads += [
        REFERENCE.encode_arm(8, gains, limits, 7),
        teensy.encode(teensy.Kind.PING, 9, 0, 10),
    ]
    payloads.append(REFERENCE.encode_setpoints(9, (np.arange(5), np.arange(5)), 7))
    return [encode_frame(payload) for payload in payloads]


def _replies() -> list[bytes]:
    payloads = [
        teensy.encode(teensy.Kind.ACK, 1, 2, 0, 1, 99),
        teensy.encode(teensy.Kind.PONG, 3, 4, 5),
        teensy.encode(
            teensy.Kind.HELLO_REPLY, 1, REFERENCE.protocol_hash, 5, 0, b"TEENSY-1", 0, 0, 0
        ),
        teensy.encode(teensy.Kind.TRIP_REPORT, 1, 4, 3, 5, 6, 7, 8),
        np.zeros(1, SAMPLE_DTYPE).tobytes(),
    ]
    return [encode_frame(payload) for payload in payloads]


def _frames(data: bytes) -> bool:
    """Frames and what is in them, against the cobs package and binascii's CRC."""
    data = data.rstrip(b"\x00") + b"\x00"
    found = FrameStream(SAMPLE_DTYPE.itemsize).feed(data)
    ours = sorted([*(row.tobytes() for row in found.payloads), *found.others])
    theirs = []
    for part in data.split(b"\x00"):
        try:
            body = cobs.decode(part)
        except cobs.DecodeError:
            continue
        if len(body) < 2 or len(body) - 2 > 1024:
            continue
        if binascii.crc_hqx(body[:-2], 0xFFFF) == int.from_bytes(body[-2:], "little"):
            theirs.append(body[:-2])
    assert ours == sorted(theirs), "frames differ from the oracle's"
    for payload in found.others:
        kind, _, fields = REFERENCE.decode(payload)
        assert REFERENCE.layouts[kind].itemsize <= len(payload)
        assert fields["version"] == teensy.VERSION
    return bool(ours)


@cache
def _board() -> PythonBoard:
    return PythonBoard(HandMovedBench())


def _board_takes(data: bytes) -> bool:
    """A board takes anything and stays a board: its set-points are finite and within limits."""
    board = _board()
    board.receive(data)
    board.advance(1)
    answers = FrameStream(SAMPLE_DTYPE.itemsize).feed(board.transmit())
    assert answers.bad == 0, "the board sent a bad frame"
    return bool(answers.others)


def _packet(data: bytes) -> bool:
    command, payload = qia128.decode_packet(data)
    assert qia128.encode_packet(command, payload) == data
    return True


def _sliding(check: Callable, size: int, weight: Callable[[bytes], bool]) -> Callable:
    def run(data: bytes) -> bool:
        frames = SlidingFrames(size, check, DeviceCounters()).feed(data)
        assert all(weight(frame.tobytes()) for frame in frames), "a checksum does not hold"
        return bool(len(frames))

    return run


def _line(data: bytes) -> bool:
    value, unit = usb520.decode_line(data)
    assert math.isfinite(value)
    assert usb520.encode_line(value, unit).lstrip(b"+-").lstrip(b"0") == (
        data.lstrip(b"+-").lstrip(b"0")
    )
    return True


def _records(data: bytes) -> bool:
    records = ati_net.decode_records(data)
    assert records.tobytes() == data
    return True


def _reading(data: bytes) -> bool:
    status, gauges = ati_can.decode_reading(data[:8], data[8:])
    frames = ati_can.encode_reading(0x20, status, gauges.tolist())
    assert b"".join(frame.data for frame in frames) == data
    return True


def _modbus(data: bytes) -> bool:
    function, body = ati_serial.decode(data)
    assert ati_serial.encode(function, body) == data
    crc = 0xFFFF
    for byte in data[:-2]:  # as the Modbus specification words it, bit by bit
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    assert crc == int.from_bytes(data[-2:], "little")
    return True


def _feedback(data: bytes) -> bool:
    feedback = epos4.decode_feedback(data)
    epos4.state_of(feedback.statusword)
    assert epos4.encode_feedback(feedback) == data
    return True


@cache
def _folder() -> Path:
    memory = Path("/dev/shm")  # noqa: S108
    return Path(tempfile.mkdtemp(prefix="rig-fuzz-", dir=memory if memory.is_dir() else None))


def _toml(data: bytes) -> bool:
    path = _folder() / "rig.toml"
    path.write_bytes(data)
    config = load_config(path)
    shown = _folder() / "shown.toml"
    shown.write_text(to_toml(config))
    assert load_config(shown) == config
    assert all(limit >= 0 and math.isfinite(limit) for _, limit in config.limits)
    return True


def _mrdlab(data: bytes) -> bool:
    from rig.importers.mrdlab_text import read_text

    path = _folder() / "11.TXT"
    path.write_bytes(data)
    text = read_text(path)
    lines = data.split(b"\n")[text.header_lines :]
    theirs = [[float(word) for word in line.split(b",")] for line in lines if line.strip()]
    told = np.array(theirs).T
    scale = 1e-3 if text.columns[0, 0] != told[0, 0] else 1.0
    assert np.allclose(text.columns[0], told[0] * scale, rtol=1e-12)
    assert np.array_equal(text.columns[1:], told[1:]), "a number differs from the text's"
    return True


@cache
def _log_rows() -> tuple[bytes, dict[str, tuple[np.dtype, set[bytes]]]]:
    from rig.log.reader import read_log
    from rig.log.run import RunInfo
    from rig.log.schema import Field, Stream
    from rig.log.writer import LogWriter

    fields = (Field("x", "float64"), Field("sequence", "uint32"), Field("flags", "uint32"))
    path = _folder() / "seed.mcap"
    with LogWriter(path, RunInfo("fuzz"), [Stream("/t", "p/msg/P", fields, 1000.0)]) as log:
        number = np.arange(40)
        rows = {"x": np.sin(number), "sequence": number, "flags": 0 * number}
        log.write("/t", rows, number * 1_000_000)
    topics = read_log(path).topics
    rows_of = {n: (t.rows.dtype, {row.tobytes() for row in t.rows}) for n, t in topics.items()}
    return path.read_bytes(), rows_of


def _mcap(data: bytes) -> bool:
    """Whatever a damaged log still gives must be rows that were written."""
    from rig.log.reader import read_log

    _, written = _log_rows()
    path = _folder() / "damaged.mcap"
    path.write_bytes(data)
    accepted = False
    for name, topic in read_log(path, tolerant=True).topics.items():
        for row in topic.rows:
            accepted = True
            dtype, rows = written.get(name, (None, set()))
            assert topic.rows.dtype == dtype, "a stream of another layout"
            assert row.tobytes() in rows, "a row that was never written"
    return accepted


def _mrdlab_seed() -> list[bytes]:
    from rig.importers.mrdlab_text import COLUMNS

    header = "%a test\n%" + ", ".join(f"{word} {name}" for name, word, _ in COLUMNS) + "\n"
    rows = "".join(
        f"{0.001 * k:.3f},{1366 - k},{2 * k},0.0{k},{k},{-k},0.1,0.01,{35 * k},{1366 - k}\n"
        for k in range(1, 30)
    )
    return [(header + rows).encode()]


_NOISE = np.random.default_rng(3).integers(0, 2**24, 24)

TARGETS = (
    Target("logger frames", _replies, _frames, 12),
    Target("commands to the board", _commands, _board_takes, 2),
    Target(
        "QIA128 packets",
        lambda: [
            qia128.encode_packet(qia128.GET_SERIAL),
            qia128.set_rate(),
            qia128.encode_packet(qia128.GET_CALIBRATION, b"\0\5"),
        ],
        _packet,
        60,
    ),
    Target(
        "QIA128 stream",
        lambda: [qia128.encode_frames(_NOISE)],
        _sliding(qia128.frame_checks, 4, lambda f: (f[0] + 2 * f[1] + 3 * f[2]) & 0xFF == f[3]),
        4,
    ),
    Target(
        "USB520 lines",
        lambda: [usb520.encode_line(-0.0019, "N-m"), usb520.encode_line(12.5, "N-m")],
        _line,
        60,
    ),
    Target("RDT records", lambda: [bytes(36), bytes(range(72))], _records, 20),
    Target("NETCANOEM readings", lambda: [bytes(range(14))], _reading, 60),
    Target(
        "Modbus messages",
        lambda: [ati_serial.encode(0x46, b"\x55"), ati_serial.read_registers(0x1D, 1)],
        _modbus,
        20,
    ),
    Target(
        "Modbus stream",
        lambda: [ati_serial.encode_frames(np.arange(60).reshape(10, 6))],
        _sliding(ati_serial.frame_checks, 13, lambda f: sum(f[:12]) & 0x7F == f[12] & 0x7F),
        4,
    ),
    Target(
        "EPOS4 process data",
        lambda: [epos4.encode_feedback(epos4.Feedback(0x237, -5, 12))],
        _feedback,
        60,
    ),
    Target("MRDLab text", _mrdlab_seed, _mrdlab, 0),
    Target("MCAP logs", lambda: [_log_rows()[0]], _mcap, 0),
    Target(
        "TOML configurations",
        lambda: [(SHIPPED / f"{name}.toml").read_bytes() for name in shipped_configs()],
        _toml,
        0,
    ),
)
