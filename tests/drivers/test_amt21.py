"""The AMT21: its check bits, its questions and answers, an adapter that echoes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.amt21 import protocol
from drivers.amt21.driver import Amt21, turns_at
from drivers.amt21.fake import Amt21Fake
from drivers.errors import FrameError
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import started

VECTORS = {0: 0xC000, 1: 0x8001, 0x1234: 0x9234, 0x2000: 0x6000, 0x21AB: 0x61AB, 0x3FFF: 0x3FFF}


@pytest.mark.parametrize(("value", "word"), VECTORS.items())
def test_the_check_bits_are_those_of_known_answers(value, word):
    reply = word.to_bytes(2, "little")
    assert protocol.encode_reply(value) == reply
    assert protocol.decode_reply(reply) == value


def test_the_questions_are_those_of_the_makers_sample_code():
    """Source: same-sky/AMT21_RS485_Sample_Code_Mega: address, and address + 1 for the turns."""
    assert protocol.request(0x54) == b"\x54"
    assert protocol.request(0x54, turns=True) == b"\x55"
    assert protocol.request(0x4C, turns=True) == b"\x4d"


@given(value=st.integers(0, 2**14 - 1), bit=st.integers(0, 15))
def test_one_changed_bit_is_refused(value, bit):
    word = int.from_bytes(protocol.encode_reply(value), "little") ^ 1 << bit
    with pytest.raises(FrameError):
        protocol.decode_reply(word.to_bytes(2, "little"))


def test_it_polls_at_its_rate_and_reads_the_angle():
    fake = Amt21Fake(counts_a_tick=100)
    device = Amt21(SimulatedTransport(fake), rate_hz=100.0)
    assert device.identify().model == "AMT21"
    device.start()
    batches = [device.read(0.1) for _ in range(400)]
    angles = [float(batch.columns["angle_rad"][0]) for batch in batches]
    expected = [2 * math.pi * (1000 * k % 2**14) / 2**14 for k in range(400)]
    assert angles == pytest.approx(expected)
    assert [int(batch.sequence[0]) for batch in batches] == list(range(400))
    assert batches[-1].time_s[0] - batches[0].time_s[0] == pytest.approx(3.99)
    assert len(device.read(0.001)) == 0


class Turning(Amt21Fake):
    """A shaft that turns between two questions, too: a millisecond on a USB adapter each."""

    def receive(self, data: bytes) -> None:
        self.count += self._counts_a_tick
        super().receive(data)


@pytest.mark.parametrize("counts_a_tick", [400, -400, 1000])
def test_turns_are_signed_and_go_with_the_angle_however_the_shaft_turns(counts_a_tick):
    fake = Turning(counts_a_tick=counts_a_tick, multi_turn=True)
    device = started(Amt21, fake, multi_turn=True, rate_hz=200.0)
    batches = [device.read(0.1) for _ in range(4000)]
    angle = np.concatenate([batch.columns["angle_rad"] for batch in batches])
    turns = np.concatenate([batch.columns["turns"] for batch in batches])
    steps = np.diff(turns + angle / math.tau)
    assert len(steps) == 3999
    assert np.ptp(steps) < 0.25  # a turn counted wrongly is a step of one
    assert (np.sign(steps) == np.sign(counts_a_tick)).all()
    assert np.sign(turns[-1]) == np.sign(counts_a_tick)
    assert device.counters["crc_errors"] == 0


@given(
    total=st.integers(-(2**27), 2**27 - 1),
    moved=st.tuples(st.integers(0, 2**12), st.integers(0, 2**12)),
    sense=st.sampled_from([-1, 1]),
)
def test_the_turns_of_an_angle_are_those_when_it_was_read(total, moved, sense):
    before, after = total - sense * moved[0], total + sense * moved[1]
    numbers = [place // 2**14 % 2**14 for place in (before, after, total)]
    assert turns_at(total % 2**14, numbers[0], numbers[1]) == numbers[2]
    assert turns_at(total % 2**14, numbers[0], (numbers[0] + 2) % 2**14) is None


def reader(multi_turn: bool, bad: list[int]) -> Amt21:
    """A device whose shaft rests at 1000 counts; the answers in `bad` read 9000 counts instead."""
    fake = Amt21Fake(counts_a_tick=0, multi_turn=multi_turn)
    fake.count = 1000
    answers = iter(range(10**6))
    original = fake.receive

    def receive(data: bytes) -> None:
        fake.count = 9000 if next(answers) in bad else 1000
        original(data)

    fake.receive = receive
    return Amt21(SimulatedTransport(fake), multi_turn=multi_turn, top_speed_rad_s=100.0)


@pytest.mark.parametrize(("bad", "count"), [([3], 1000), ([3, 4, 5, 6], 9000)])
def test_an_answer_out_of_reach_is_believed_only_where_a_second_one_confirms_it(bad, count):
    device = reader(multi_turn=False, bad=bad)
    device.start()
    batches = [device.read(0.1) for _ in range(5)]
    assert batches[3].columns["angle_rad"][0] == pytest.approx(count * math.tau / 2**14)
    assert batches[-1].lost == 0
    assert (device.counters["crc_errors"], device.counters["retries"]) == (1, 1)


def test_an_echoing_adapter_is_dealt_with_and_seen():
    device = started(Amt21, Amt21Fake(echo=True))
    assert device.read(0.1).columns["angle_rad"].tolist() == [0.0]
    assert device.counters["discarded_bytes"] == 1
    assert device.counters["crc_errors"] == 0


def test_a_caller_that_comes_late_has_lost_samples():
    transport = SimulatedTransport(Amt21Fake())
    device = Amt21(transport, rate_hz=100.0)
    device.start()
    device.read(0.1)
    transport.read(0.055)
    late = device.read(0.1)
    assert (int(late.sequence[0]), late.lost) == (5, 4)


def test_an_address_is_a_multiple_of_four():
    with pytest.raises(ValueError, match="multiple of 4"):
        protocol.request(0x55)
