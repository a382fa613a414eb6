"""The Net F/T: requests and records as in the manual, numbers, statuses, units, a real socket."""

import socket
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ati_net import protocol
from drivers.ati_net.driver import AtiNet
from drivers.ati_net.fake import CalibrationFake, RdtFake, fake_calibration
from drivers.ati_net.protocol import Calibration
from drivers.ati_net.stream import RESTART_STEP, RecordSequence
from drivers.counters import DeviceCounters
from drivers.errors import DriverError, FrameError, LinkError, LinkLostError, LinkTimeoutError
from drivers.transport import open_transport
from drivers.transport.simulated import SimulatedTransport
from tests.drivers.taps import started


def start(fake: RdtFake) -> AtiNet:
    return started(AtiNet, fake, open_calibration=fake_calibration)


def test_requests_are_the_bytes_of_the_manual():
    requests = {
        protocol.encode_command(protocol.STOP): "1234 0000 00000000",
        protocol.encode_command(protocol.STREAM): "1234 0002 00000000",
        protocol.encode_command(protocol.STREAM, 258): "1234 0002 00000102",
        protocol.encode_command(protocol.RESET_LATCH): "1234 0041 00000000",
        protocol.encode_command(protocol.SET_BIAS): "1234 0042 00000000",
    }
    assert all(request == bytes.fromhex(manual) for request, manual in requests.items())
    assert protocol.CALIBRATION_PORT == 49151
    assert protocol.READ_CALIBRATION.hex() == "01" + 19 * "00"


def test_a_record_is_big_endian_and_36_bytes():
    datagram = struct.pack(">IIIiiiiii", 7, 49, 0x80010000, -1, 2, -3, 4, -5, 6)
    (record,) = protocol.decode_records(datagram)
    *numbers, counts = record.tolist()
    assert numbers == [7, 49, 0x80010000]
    assert counts.tolist() == [-1, 2, -3, 4, -5, 6]
    assert len(protocol.decode_records(datagram * 5)) == 5
    for size in (0, 35, 37, 8):
        with pytest.raises(FrameError):
            protocol.decode_records((datagram * 2)[:size])


def test_a_calibration_is_the_bytes_of_the_manual():
    """Source: ATI 9620-05-Net FT, TCP interface: u16 header, two unit codes, two u32, six u16."""
    answer = bytes.fromhex("1234 02 03 000f4240 0007a120 0001 0002 0003 0004 0005 0106")
    calibration = Calibration(2, 3, 1_000_000, 500_000)
    assert protocol.decode_calibration(answer) == calibration
    assert protocol.encode_calibration(calibration) == answer[:12] + bytes(12)


@given(answer=st.binary(max_size=30))
def test_a_calibration_is_refused_unless_whole_and_of_known_units(answer):
    with pytest.raises(FrameError):
        protocol.decode_calibration(answer[:23])
    if len(answer) >= 24 and answer[:2] != b"\x12\x34":
        with pytest.raises(FrameError):
            protocol.decode_calibration(answer[:24])


def test_counts_become_si_by_the_scale_of_the_device():
    pounds = CalibrationFake(Calibration(1, 1, 1000, 500))
    device = started(AtiNet, RdtFake(), open_calibration=lambda: SimulatedTransport(pounds))
    batch = device.read(0.1)
    newest = RdtFake().load(int(batch.sequence[-1]) + 1)
    assert batch.columns["force_x_n"][-1] == pytest.approx(newest[0] / 1000 * 4.4482216152605)
    assert batch.columns["torque_z_n_m"][-1] == pytest.approx(newest[5] / 500 * 0.112984829)
    assert len(batch) == 50


STATUS_BITS = (
    "30 processor; 29 digital board; 28 analog board; 27 serial link; 26 program memory; "
    "25 halted; 24 settings; 23 calibration; 22 network; 21 CAN; 20 raw data; "
    "19 EtherNet/IP; 18 DeviceNet; 17 saturated; 16 threshold; 14 watchdog; 13 stack; "
    "12 settings memory; 11 flash; 10 analog watchdog; 9 excitation too high; "
    "8 excitation too low; 7 ground; 6 supply too high; 5 supply too low; 4 no data; "
    "3 reference; 2 temperature; 1 web server"
)
"""Source: ATI 9620-05-Net FT, status code: bit and a part of its meaning."""


@pytest.mark.parametrize("row", STATUS_BITS.split("; "))
def test_a_status_bit_is_that_of_the_manual(row):
    bit, words = int(row.split()[0]), row.split(" ", 1)[1]
    (said,) = protocol.status_words(1 << 31 | 1 << bit)
    assert words in said
    # only the threshold of bit 16 is no data fault
    assert protocol.is_data_fault(np.array([1 << 31 | 1 << bit], np.uint32))[0] == (bit != 16)


def test_a_status_is_reported_in_words_and_flags_its_samples():
    words = ["sensor saturated or its converter failed", "supply too low", "bit 0 is set"]
    assert protocol.status_words(1 << 31 | 1 << 17 | 1 << 5 | 1) == words
    fake = RdtFake()
    device = start(fake)
    fake.status = 0x80010000
    latched = device.read(0.1)
    assert not latched.flags.any()
    assert device.counters["device_errors"] == 0
    assert device.status == 0x80010000
    device.reset_latch()
    device.read(0.1)
    assert device.status == 0
    fake.status = 1 << 31 | 1 << 17 | 1 << 16
    assert set(device.read(0.1).flags) == {9}
    assert device.counters["device_errors"] == 50


def followed(numbers: list[int]) -> tuple[list[bool], list[int], DeviceCounters]:
    counters = DeviceCounters()
    kept, given_numbers = RecordSequence(counters).follow(np.array(numbers, np.uint32))
    return kept.tolist(), given_numbers.tolist(), counters


def test_lost_late_repeated_and_restarted_records_are_distinguished():
    kept, numbers, counters = followed([5, 6, 9, 8, 9, 10])
    assert kept == [True, True, True, False, False, True]
    assert numbers == [0, 1, 4, 5]
    assert (counters.lost, counters.gaps, counters.late, counters.duplicates) == (2, 1, 1, 1)
    assert followed([5, 5])[2].duplicates == 1
    kept, numbers, counters = followed([RESTART_STEP + 5, 1, 2])
    assert (kept, numbers, counters.restarts) == ([True] * 3, [0, 1, 2], 1)


@given(kept=st.lists(st.booleans(), min_size=2, max_size=200), first=st.integers(0, 2**32 - 1))
def test_what_is_missing_is_counted_exactly(kept, first):
    kept[0] = kept[-1] = True
    places = [place for place, keep in enumerate(kept) if keep]
    mask, numbers, counters = followed([(first + place) % 2**32 for place in places])
    assert all(mask)
    assert numbers == places
    assert counters.lost == kept.count(False)


@pytest.mark.parametrize("command", ["set_bias", "reset_latch"])
@pytest.mark.parametrize("numbers_begin_at", [1, 2**32 - 10])
def test_a_command_that_ends_the_stream_is_followed_by_a_request_for_it(command, numbers_begin_at):
    device = start(RdtFake(numbers_begin_at))
    before = device.read(0.1)
    getattr(device, command)()
    after = [device.read(0.1) for _ in range(4)]
    assert sum(map(len, after)) == 200
    sequence = np.concatenate([before.sequence, *[batch.sequence for batch in after]])
    assert sequence.tolist() == list(range(250))
    assert after[-1].lost == 0
    assert {k for k, count in device.counters.items() if count} == {"frames"}


def test_a_stream_that_goes_on_counting_after_a_command_loses_nothing():
    sequence = RecordSequence(counters := DeviceCounters())
    sequence.follow(np.arange(5, 10, dtype=np.uint32))
    sequence.expect_restart()
    _, numbers = sequence.follow(np.arange(10, 2010, dtype=np.uint32))
    assert numbers.tolist() == list(range(5, 2005))
    kept, _ = sequence.follow(np.array([2008, 2010], np.uint32))  # it is late, and nothing else
    assert kept.tolist() == [False, True]
    assert (counters.late, counters.restarts, counters.lost) == (1, 0, 0)


def complaints(device: AtiNet, reads: int, words: str) -> tuple[int, int]:
    """Return how many readings complain so, and the samples of the others."""
    said = back = 0
    for _ in range(reads):
        try:
            back += len(device.read(0.05))
        except DriverError as error:
            said += words in str(error)
    return said, back


def test_a_device_that_is_gone_is_reported_at_every_reading_until_it_is_back():
    fake = RdtFake()
    device = start(fake)
    device.read(0.1)
    fake.receive(protocol.encode_command(protocol.STOP))
    fake.deaf = 6
    said, back = complaints(device, 100, "fallen silent")
    assert said > 20
    assert back > 500
    assert (device.counters["stalls"], device.counters["retries"]) == (1, 7)


def test_a_sensor_that_repeats_one_sample_for_ever_is_an_error():
    fake = RdtFake()
    device = start(fake)
    device.read(0.1)
    fake.frozen_at = 50
    assert complaints(device, 10, "frozen")[0] >= 7
    assert device.counters["device_errors"] == 1
    fake.frozen_at = None
    assert len(device.read(0.05)) > 0


def test_the_bias_is_set_in_the_device():
    device = start(RdtFake())
    device.read(0.1)
    device.set_bias()
    assert abs(device.read(0.001).columns["force_z_n"][0]) < 0.3


def test_nobody_there_is_a_timeout():
    silent = CalibrationFake()
    silent.receive(b"x")
    device = AtiNet(SimulatedTransport(RdtFake()), lambda: SimulatedTransport(silent))
    with pytest.raises(DriverError, match="Call start"):
        device.read(0.1)
    with pytest.raises(LinkTimeoutError, match="calibration"):
        device.start()


def test_over_a_real_socket_on_the_loopback_interface():
    board = RdtFake()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        address = listening.getsockname()
        listening.settimeout(5.0)
        device = AtiNet(open_transport(f"udp:127.0.0.1:{address[1]}"), fake_calibration)
        device.start()
        for _ in range(2):  # stop, start
            request, client = listening.recvfrom(100)
            board.receive(request)
        board.advance(40)
        datagrams = [board.transmit() for _ in range(40)]
        for datagram in [*datagrams[:10], b"noise", *datagrams[20:]]:
            listening.sendto(datagram, client)
        batches = []
        while not batches or batches[-1].sequence[-1:] != 39:
            batches.append(device.read(1.0))
        assert np.concatenate([batch.sequence for batch in batches]).tolist() == [
            *range(10),
            *range(20, 40),
        ]
        assert batches[-1].lost == 10
        assert device.counters["unknown_frames"] == 1
        device.close()
        with pytest.raises(LinkLostError, match="closed"):
            device.read(0.1)


@pytest.mark.parametrize("url", ["udp:", "udp:host", "udp:host:", "udp:host:0", "udp:host:99999"])
def test_an_address_has_a_host_and_a_port(url):
    with pytest.raises(LinkError, match="udp:HOST:PORT"):
        open_transport(url)
