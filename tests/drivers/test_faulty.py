"""Faults around a transport: each does what its name states, in the link's own time, repeatably."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.transport.faulty import LONGEST_RUN, Fault, Faults, FaultyTransport
from drivers.transport.simulated import SimulatedTransport


class Counting:
    """A board that sends its tick, two bytes a millisecond: all that wait, or one packet each."""

    def __init__(self, packets: bool = False) -> None:
        self._packets = packets
        self._tick = self._sent = 0

    def advance(self, ticks: int) -> None:
        self._tick += ticks

    def transmit(self) -> bytes:
        first = self._sent
        self._sent = min(first + 1, self._tick) if self._packets else self._tick
        return expected(self._sent)[2 * first :]


def expected(ticks: int) -> bytes:
    return b"".join(tick.to_bytes(2, "big") for tick in range(ticks))


def read_all(cable: FaultyTransport, seconds: float) -> list[bytes]:
    end_s = cable.now_s + seconds
    chunks = []
    while cable.now_s < end_s - 1e-9:
        chunks.append(cable.read(min(0.01, end_s - cable.now_s)))
    while chunk := cable.read(0.0):
        chunks.append(chunk)
    return [chunk for chunk in chunks if chunk]


@pytest.mark.parametrize("fault", [Fault.DROP, Fault.CORRUPT, Fault.DUPLICATE])
@given(seed=st.integers(0, 2**16))
def test_damage_is_one_short_run_and_the_same_for_a_seed(fault, seed):
    def damaged() -> bytes:
        faults = Faults(seed)
        cable = FaultyTransport(SimulatedTransport(Counting()), faults)
        faults.inject(fault)
        got = b"".join(read_all(cable, 0.2))
        assert faults.struck == {fault: 1}
        return got

    got, whole = damaged(), expected(200)
    assert got == damaged()
    assert got != whole
    size = len(got) - len(whole)
    if fault is Fault.CORRUPT:
        assert size == 0
        changed = [place for place in range(400) if got[place] != whole[place]]
        assert changed[-1] - changed[0] < LONGEST_RUN
    else:
        assert 1 <= abs(size) <= LONGEST_RUN
        assert (size > 0) == (fault is Fault.DUPLICATE)


@pytest.mark.parametrize("fault", [Fault.DELAY, Fault.STALL])
def test_a_late_stream_loses_nothing_and_keeps_its_order(fault):
    faults = Faults()
    cable = FaultyTransport(SimulatedTransport(Counting()), faults)
    read_all(cable, 0.1)
    faults.inject(fault, duration_s=0.3)
    silent_from_s = cable.now_s
    assert cable.read(0.25) == b""
    assert cable.now_s == pytest.approx(silent_from_s + 0.25)
    rest = b"".join(read_all(cable, 0.25))
    assert rest == expected(600)[200:]
    assert faults.struck == {fault: 1}


def test_packets_are_lost_repeated_and_overtaken_whole():
    faults = Faults()
    cable = FaultyTransport(
        SimulatedTransport(Counting(packets=True), step_s=0.001), faults, packets=True
    )
    for fault in (Fault.DROP, Fault.CORRUPT, Fault.DUPLICATE, Fault.DELAY):
        faults.inject(fault, duration_s=0.0035)
    numbers = [int.from_bytes(packet, "big") for packet in read_all(cable, 0.01)]
    assert numbers == [2, 2, 4, 5, 6, 3, 7, 8, 9]
