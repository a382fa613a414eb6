"""NETCANOEM: the manual's operations frame by frame, readings, faults of the sensor."""

import contextlib
import re
from collections import deque
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ati_can import protocol
from drivers.ati_can.driver import AtiCan
from drivers.ati_can.fake import MATRIX, AtiCanFake
from drivers.device import AXES, SampleFlag
from drivers.errors import DriverError, FrameError
from drivers.transport.can_bus import CanFrame
from drivers.transport.simulated_can import SimulatedCanBus

Exchange = tuple[CanFrame, list[CanFrame]]
"""A frame the driver must send, and the frames that answer it."""


def frame(can_id: int, data: str = "") -> CanFrame:
    return CanFrame(can_id, bytes.fromhex(data))


class Scripted:
    """A node that fails on a frame that is not the script's next."""

    def __init__(self, script: list[Exchange]) -> None:
        self.script, self.answers = deque(script), []

    def receive(self, frame: CanFrame) -> None:
        assert self.script, f"sent after the end of the script: {frame}"
        expected, self.answers = self.script.popleft()
        assert frame == expected

    def advance(self, ticks: int) -> None:
        pass

    def transmit(self) -> list[CanFrame]:
        answers, self.answers = self.answers, []
        return answers


@contextlib.contextmanager
def scripted(script: list[Exchange]) -> Iterator[SimulatedCanBus]:
    """A bus that holds a conversation to its script; at the end nothing is unsent or unread."""
    node = Scripted(script)
    bus = SimulatedCanBus([node])
    yield bus
    assert not node.script, f"never sent: {list(node.script)}"
    assert bus.read(0.0) is None, "never read"


def start(node: AtiCanFake, **options: int) -> AtiCan:
    device = AtiCan(SimulatedCanBus([node]), **options)
    device.start()
    return device


def set_up(base: int = 0x200) -> list[Exchange]:
    """What `identify` says and hears: firmware 3.8.17, unit matrix, 1000 and 2000 counts a unit."""
    rows: list[Exchange] = []
    for axis in range(6):
        pairs = [["00000000"] * 2 for _ in range(3)]
        pairs[axis // 2][axis % 2] = "3f800000"
        answer = [frame(base + 2 + pair, "".join(pairs[pair])) for pair in range(3)]
        rows.append((frame(base + 2, f"{axis:02x}"), answer))
    return [
        (frame(base + 0xF), [frame(base + 0xF, "03080011")]),
        (frame(base + 5), [frame(base + 5, "4654313233343536")]),
        (frame(base + 6, "00"), [frame(base + 6, "00")]),
        (frame(base + 7), [frame(base + 7, "000003e8000007d0")]),
        (frame(base + 8), [frame(base + 8, "0203")]),
        *rows,
    ]


def test_the_conversation_of_the_manual():
    reading = [frame(0x200, "0000 0001 0003 0005"), frame(0x201, "0002 ffff 8001")]
    with scripted([*set_up(), (frame(0x200), reading)]) as bus:
        device = AtiCan(bus)
        identity = device.identify()
        assert (identity.serial, identity.firmware) == ("FT123456", "3.8.17")
        device.start()
        batch = device.read(0.1)
    assert [batch.columns[name][0] for name in AXES] == pytest.approx(
        [0.001, 0.002, 0.003, -0.0005, 0.0025, -16.3835]
    )
    assert batch.flags[0] == 0
    assert batch.sequence[0] == 0


def test_firmware_from_3_7_on_alone_is_asked_for_units():
    """Source: ATI 9610-05-1030, commands 7 and 8."""
    first, *others = set_up()
    assert first == (frame(0x20F), [frame(0x20F, "03080011")])
    with scripted([(first[0], [frame(0x20F, "03070000")]), *others]) as bus:
        assert AtiCan(bus).identify().firmware == "3.7.0"
    node = AtiCanFake(firmware=(3, 6, 0), load=lambda _: np.array([100, 0, 0, 0, 0, 0]))
    device = AtiCan(SimulatedCanBus([node]))
    assert device.identify().firmware == "3.6.0"
    device.start()
    assert device.read(0.1).columns["force_z_n"][0] == pytest.approx(1510 * 100 / 1e6, rel=1e-9)


def test_replies_are_paired_among_other_frames_and_stragglers():
    first, second = "0000 0001 0003 0005", "0002 0004 0006"
    answer = [
        frame(0x201, "0009 0009 0009"),  # a straggler's second half
        CanFrame(0x200, bytes(8), extended=True),
        frame(0x181, "37 06"),
        frame(0x200, "0000 0009 0009 0009"),  # a straggler's first half
        frame(0x200, first),
        frame(0x281, "00"),
        frame(0x201, second),
    ]
    with scripted([*set_up(), (frame(0x200), answer)]) as bus:
        device = AtiCan(bus)
        device.start()
        batch = device.read(0.1)
    assert batch.columns["force_x_n"][0] == pytest.approx(0.001)
    assert batch.columns["torque_z_n_m"][0] == pytest.approx(0.003)
    assert device.counters["late"] == 2


def test_half_an_answer_is_asked_for_again_and_none_is_a_gap():
    half = [frame(0x200, "0000 0001 0003 0005")]
    whole = [frame(0x200, "0000 0007 0003 0005"), frame(0x201, "0002 0004 0006")]
    polls: list[Exchange] = [(frame(0x200), half), (frame(0x200), whole)]
    silence: list[Exchange] = [(frame(0x200), [])] * 3
    with scripted([*set_up(), *polls, *silence, (frame(0x200), whole)]) as bus:
        device = AtiCan(bus, rate_hz=10.0)
        device.start()
        batch = device.read(0.1)
        assert batch.columns["force_x_n"][0] == pytest.approx(0.007)
        assert device.counters["retries"] == 1
        assert len(device.read(0.1)) == 0
        last = device.read(0.1)
    assert (last.sequence[0], last.lost) == (2, 1)
    assert device.counters["timeouts"] == 1


@pytest.mark.parametrize("gauge", range(6))
@pytest.mark.parametrize("end", [-40_000, 32_767])
def test_a_saturated_gauge_makes_the_whole_wrench_invalid(gauge, end):
    load = np.zeros(6, np.int64)
    load[gauge] = end
    device = start(AtiCanFake(load=lambda _: load))
    assert device.read(0.1).flags[0] == SampleFlag.SATURATED | SampleFlag.SUSPECT
    with pytest.raises(DriverError, match="saturated"):
        device.set_bias()
    assert not device.bias.any()
    assert not protocol.is_saturated(np.array([32_766, -32_767, 0, 0, 0, 0], np.int16))


def test_the_status_is_reported_in_words_and_flags_what_cannot_be_used():
    node = AtiCanFake()
    device = start(node)
    node.status = 1 << 15 | 1 << 5 | 1 << 6
    assert device.read(0.1).flags[0] == SampleFlag.SUSPECT
    assert protocol.status_words(device.status) == ["supply too low", "active calibration is bad"]
    node.status = 1 << 15 | 1
    assert device.read(0.1).flags[0] == 0
    assert protocol.status_words(1 << 9) == ["bit 9 is set"]


STATUS_BITS = (
    "0 watchdog; 1 too high; 2 too low; 3 analog|ground; 4 supply too high; 5 supply too low; "
    "6 active calibration; 7 memory; 8 configuration; 11 temperature too high; "
    "12 temperature too low; 14 CAN"
)
"""Source: ATI 9610-05-1030, status word; bits 1 to 7, 11 and 12 make a reading unusable."""


@pytest.mark.parametrize("row", STATUS_BITS.split("; "))
def test_a_status_bit_is_that_of_the_manual(row):
    bit, words = int(row.split()[0]), row.split(" ", 1)[1]
    (said,) = protocol.status_words(1 << bit)
    assert re.search(words, said)
    assert bool(protocol.UNUSABLE & 1 << bit) == (bit in {1, 2, 3, 4, 5, 6, 7, 11, 12})


def test_the_bias_is_taken_off():
    load = np.array([5, -4, 3, -2, 1, 700])
    device = start(AtiCanFake(load=lambda _: load))
    before = device.read(0.1)
    expected = MATRIX @ load / 1e6
    assert [before.columns[name][0] for name in AXES] == pytest.approx(expected.tolist())
    device.set_bias()
    after = device.read(0.1)
    assert [after.columns[name][0] for name in AXES] == pytest.approx([0.0] * 6)


def test_another_calibration_is_used_or_its_absence_reported():
    load = np.array([1000, 0, 0, 0, 0, 0])
    device = start(AtiCanFake(load=lambda _: load), calibration=1)
    assert device.read(0.1).columns["force_z_n"][0] == pytest.approx(2 * 1.51)
    missing = AtiCan(SimulatedCanBus([AtiCanFake()]), calibration=7)
    with pytest.raises(FrameError, match="calibration 7"):
        missing.identify()


@pytest.mark.parametrize(("silent_s", "samples"), [(0.5, 0), (0.0, 200)])
def test_a_sensor_that_restarts_and_loses_its_calibration_is_noticed(silent_s, samples):
    node = AtiCanFake()
    bus = SimulatedCanBus([node])
    device = AtiCan(bus, calibration=1)
    device.start()
    for _ in range(300):  # one and a half seconds: it looks more than once
        assert len(device.read(0.1)) == 1
    node.restart()
    if silent_s:
        answer, node.receive = node.receive, lambda _: None
        give_up_s = bus.now_s + silent_s
        while bus.now_s < give_up_s:
            assert len(device.read(0.1)) == 0
        node.receive = answer
    wrong = 0
    with pytest.raises(DriverError, match=r"calibration 1 any more.*restarted"):  # noqa: PT012
        for _ in range(1000):
            wrong += len(device.read(0.1))
    assert wrong <= samples
    with pytest.raises(DriverError, match="restarted"):
        device.read(0.1)
    assert device.counters["restarts"] == 1
    device.start()
    for _ in range(300):
        assert len(device.read(0.1)) == 1
    assert device.counters["restarts"] == 1


def test_a_sensor_on_the_calibration_of_a_restart_is_not_asked_for_it():
    node = AtiCanFake()
    device = start(node)
    node.restart()
    for _ in range(500):
        assert len(device.read(0.1)) == 1


@given(st.binary(max_size=8), st.binary(max_size=8), st.binary(max_size=8))
def test_any_bytes_are_decoded_or_refused(one, two, three):
    for decode in (
        lambda: protocol.decode_reading(one, two),
        lambda: protocol.decode_matrix_row([one, two, three]),
        lambda: protocol.decode_counts_per_unit(one),
        lambda: protocol.decode_firmware(one),
        lambda: protocol.decode_serial(one),
    ):
        with contextlib.suppress(FrameError):  # nothing else may be raised
            decode()
