"""An EPOS4 in virtual time and on a virtual bus: set-up, torque, faults, and a safe end."""

import socket
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.counters import DeviceCounters
from drivers.device import SampleFlag
from drivers.epos4 import faults, protocol
from drivers.epos4.canopen_link import CanopenLink, ObjectRefusedError
from drivers.epos4.driver import Epos4
from drivers.epos4.fake import Epos4Fake
from drivers.epos4.faults import DriveFaultError
from drivers.epos4.protocol import Ratings, State
from drivers.errors import (
    DisarmUnconfirmedError,
    DriverError,
    FrameError,
    LinkError,
    LinkLostError,
    LinkTimeoutError,
    ProtocolMismatchError,
)
from drivers.transport.can_bus import CanFrame
from drivers.transport.python_can import open_can
from drivers.transport.simulated_can import LiveCanBus, SimulatedCanBus

RATINGS = Ratings(12.46e-3, 17.8e-3, 1.4)


class Tapped(SimulatedCanBus):
    """A simulated bus that notes what the host sends and may lose some of it."""

    def __init__(self, *nodes: Epos4Fake) -> None:
        super().__init__(nodes)
        self.sent: list[CanFrame] = []
        self.lose: Callable[[CanFrame], bool] = lambda _: False

    def send(self, frame: CanFrame) -> None:
        self.sent.append(frame)
        if not self.lose(frame):
            super().send(frame)


def armed() -> tuple[Epos4Fake, Epos4, Tapped]:
    """A drive in force, its driver, and the bus between them."""
    node = Epos4Fake()
    bus = Tapped(node)
    device = Epos4(bus)
    device.start()
    device.arm()
    return node, device, bus


def test_a_torque_turns_the_motor_and_the_end_is_powerless():
    node, device, _ = armed()
    sent_n_m = device.set_torque(1.001e-3)
    assert sent_n_m == pytest.approx(80 * 12.46e-6)
    positions = []
    for number in range(300):
        batch = device.read(0.1)
        assert batch.sequence[0] == number
        assert batch.flags[0] == 0
        positions.append(batch.columns["position_count"][0])
    assert batch.columns["motor_torque_n_m"][0] == pytest.approx(sent_n_m)
    assert batch.columns["motor_current_a"][0] == pytest.approx(sent_n_m / 17.8e-3)
    assert batch.columns["command_torque_n_m"][0] == pytest.approx(sent_n_m)
    assert np.all(np.diff(positions[5:]) > 0)
    assert node.torque_n_m == pytest.approx(sent_n_m)
    device.close()
    assert node.state is State.SWITCH_ON_DISABLED
    assert node.torque_n_m == 0.0


def test_set_up_and_arm_send_their_messages_in_order():
    _, device, bus = armed()
    heartbeat = 0x700 + 127
    spoken = [frame for frame in bus.sent if frame.can_id != heartbeat]
    said = [f"{frame.can_id:x} {frame.data.hex()}" for frame in spoken]
    writes = [line for line in said if line[:3] != "601" or line[4:6] in ("2f", "2b", "23")]
    set_up = (
        "0 8001; 601 2b17100064000000; "
        # voltage off when the host is lost, and at a fault
        "601 2b07600002000000; 601 2b5e600000000000; "
        # and pre-operational, so that objects can be reached
        "601 2f29100100000000; "
        # TPDO1 off, synchronous, mapped, counted, on
        "601 2300180181010080; 601 2f00180201000000; 601 2f001a0000000000; 601 23001a0110004160; "
        "601 23001a0220006460; 601 23001a031001d230; 601 2f001a0003000000; 601 2300180181010000; "
        # RPDO1 off, at once, mapped, counted, on
        "601 2300140101020080; 601 2f001402ff000000; 601 2f00160000000000; 601 2300160110004060; "
        "601 2300160210007160; 601 2f00160002000000; 601 2300140101020000"
    )
    expected = set_up.split("; ")
    assert writes[: len(expected)] == expected
    assert writes[-6:] == [
        "601 23161001fa007f00",  # the host is node 127 and beats every 250 ms at the latest
        "0 0101",
        "601 2b71600000000000",  # target torque 0
        "601 2f6060000a000000",  # cyclic torque
        "601 2b40600006000000",  # shutdown
        "601 2b4060000f000000",  # enable operation
    ]
    device.read(0.1)
    assert [frame for frame in bus.sent if frame.can_id != heartbeat][-2:] == [
        CanFrame(0x201, bytes.fromhex("0f000000")),
        CanFrame(0x80),
    ]
    device.disarm()
    assert CanFrame(0x201, bytes(4)) in bus.sent
    device.close()


def test_an_unarmed_drive_is_only_watched():
    node = Epos4Fake()
    bus = Tapped(node)
    device = Epos4(bus)
    with pytest.raises(DriverError, match="start"):
        device.arm()
    device.start()
    assert len(device.read(0.1)) == 1
    assert not [frame for frame in bus.sent if frame.can_id == 0x201]
    with pytest.raises(DriverError, match="arm"):
        device.set_torque(1e-3)
    assert node.state is State.SWITCH_ON_DISABLED
    device.close()


@pytest.mark.parametrize("torque", [np.nan, np.inf, -np.inf, 0.025, -0.025])
def test_a_torque_that_must_not_be_is_refused(torque):
    _, device, _ = armed()
    with pytest.raises(DriverError, match=r"cannot be commanded|beyond"):
        device.set_torque(torque)
    assert device.read(0.1).columns["command_torque_n_m"][0] == 0.0
    device.close()


@given(st.floats(-0.0249, 0.0249))
def test_a_command_is_off_by_half_a_step_at_most(torque):
    assert abs(RATINGS.torque_n_m(RATINGS.per_mille(torque)) - torque) <= 0.5001 * 12.46e-6


def test_an_error_stops_the_session_in_words_and_is_cleared_by_hand():
    node, device, _ = armed()
    device.set_torque(1e-3)
    device.read(0.1)
    node.fail(0x3220, 4)
    with pytest.raises(DriveFaultError, match=r"supply voltage is too low.*0x3220") as caught:
        device.read(0.1)
    assert caught.value.code == 0x3220
    assert "power supply" in caught.value.fix
    after = device.read(0.1)
    assert after.flags[0] == SampleFlag.SUSPECT
    assert device.counters["device_errors"] == 1
    with pytest.raises(DriveFaultError, match="0x3220"):
        device.arm()
    device.clear_fault()
    assert device.last_error == 0
    device.arm()
    assert device.read(0.1).flags[0] == 0
    assert node.torque_n_m == 0.0
    device.close()


def after_a_pause() -> tuple[Epos4Fake, Epos4]:
    """A drive in force whose host paused for longer than the drive waits."""
    node, device, _ = armed()
    device.set_torque(1e-3)
    device.read(0.1)
    node.advance(180)  # the host's last beat may be 63 ms old
    assert node.state is State.OPERATION_ENABLED
    node.advance(71)
    return node, device


def test_a_silent_host_is_noticed_by_the_drive_and_raised_until_it_is_cleared():
    node, device = after_a_pause()
    assert node.state is State.FAULT  # at once: no ramp along which the motor stays in force
    assert node.torque_n_m == 0.0
    for _ in range(200):  # no sample can come, and that is raised as long as it is so
        with pytest.raises(DriveFaultError, match=r"heartbeat of the host.*0x8130"):
            device.read(0.1)
    with pytest.raises(DriverError, match="not armed"):
        device.set_torque(1e-3)
    device.disarm()
    assert device.clear_fault() == 0x8130
    assert node.state is State.SWITCH_ON_DISABLED
    assert device.last_error == 0
    assert device.read(0.1).flags[0] == 0
    device.arm()
    device.set_torque(1e-3)
    device.read(0.1)
    assert node.torque_n_m == pytest.approx(80 * 12.46e-6)
    node.advance(251)  # the heartbeat is watched again
    assert node.state is State.FAULT
    device.close()


def test_another_program_clears_what_the_first_one_left():
    node, _ = after_a_pause()
    device = Epos4(SimulatedCanBus([node]))
    device.start()
    with pytest.raises(DriveFaultError, match="heartbeat of the host"):
        device.arm()
    assert device.clear_fault()
    assert not device.clear_fault()
    device.arm()
    assert device.read(0.1).flags[0] == 0
    device.close()
    assert node.state is State.SWITCH_ON_DISABLED


def test_a_stopped_node_is_cleared_too():
    node = Epos4Fake()
    node.fail(0x2310, 2)
    node.receive(CanFrame(0, bytes([0x02, 1])))
    device = Epos4(SimulatedCanBus([node]))
    assert device.clear_fault()
    assert node.state is State.SWITCH_ON_DISABLED
    device.close()


@pytest.mark.parametrize(("command", "words"), [(0x80, "pre-operational"), (0x81, "restarted")])
def test_a_drive_that_leaves_operation_of_the_network_is_reported_and_not_commanded(command, words):
    node, device, bus = armed()
    device.set_torque(1e-3)
    device.read(0.1)
    node.receive(CanFrame(0, bytes([command, 1])))
    with pytest.raises(DriveFaultError, match=words):  # noqa: PT012
        for _ in range(200):  # noticed at the next heartbeat
            device.read(0.1)
    assert device.counters["restarts"] == (command == 0x81)
    bus.sent.clear()
    for _ in range(50):
        with pytest.raises(DriveFaultError, match=words):
            device.read(0.1)
    assert not [frame for frame in bus.sent if frame.can_id == 0x201]
    device.close()
    assert node.state is State.SWITCH_ON_DISABLED


def test_a_drive_that_stops_operation_by_itself_is_reported():
    node, device, _ = armed()
    node.state = State.QUICK_STOP
    with pytest.raises(DriveFaultError, match="quick stop"):
        device.read(0.1)
    device.close()
    assert node.state is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize(("index", "subindex"), [(0x6007, 0), (0x1029, 1), (0x1A00, 2)])
def test_a_setting_that_is_not_held_is_refused_before_the_motor_has_force(index, subindex):
    node = Epos4Fake()

    def other(**asked: object) -> int | None:
        return 3 if (asked["index"], asked["subindex"]) == (index, subindex) else None

    node._node.add_read_callback(other)
    with pytest.raises(ProtocolMismatchError, match=f"{index:#06x}"):
        Epos4(SimulatedCanBus([node])).start()


def test_a_host_that_only_waits_beats_all_the_same():
    node = Epos4Fake()
    bus = SimulatedCanBus([node])
    device = Epos4(bus, rate_hz=0.5)
    device.start()
    device.arm()
    for _ in range(30):
        device.read(0.1)
    assert node.state is State.OPERATION_ENABLED
    device.close()


def test_a_disarm_that_nobody_confirms_is_no_disarm():
    _, device, bus = armed()
    bus.lose = lambda frame: frame.can_id == 0x601
    with pytest.raises(DisarmUnconfirmedError, match=r"cut its supply.*250 ms"):
        device.disarm()
    with pytest.raises(DisarmUnconfirmedError):
        device.close()
    with pytest.raises(LinkLostError):
        bus.read(0.0)


def test_a_disarm_is_not_believed_while_the_statusword_differs():
    node, device, bus = armed()
    # the drive confirms the write of the controlword and does not follow it
    deaf = bytes.fromhex("2b406000 00000000")
    bus.lose = lambda frame: frame.can_id == 0x201

    original = node.receive
    node.receive = lambda frame: (
        original(CanFrame(0x601, bytes.fromhex("2b716000 00000000")))
        if frame.data == deaf
        else original(frame)
    )
    with pytest.raises(DisarmUnconfirmedError):
        device.disarm()
    assert node.state is State.OPERATION_ENABLED
    node.receive = original
    device.close()
    assert node.state is State.SWITCH_ON_DISABLED


def test_the_wrong_device_is_refused_before_anything_is_written():
    bus = Tapped(Epos4Fake(objects={(0x1018, 1): 0x2E}))
    with pytest.raises(ProtocolMismatchError, match=r"0x2e.*0xfb"):
        Epos4(bus).start()
    assert all(frame.data[0] == 0x40 for frame in bus.sent)
    for place, value, words in (
        ((0x6502, 0), 0xA5, "torque mode"),
        ((0x6076, 0), 0, "EPOS Studio"),
    ):
        with pytest.raises(DriverError, match=words):
            Epos4(SimulatedCanBus([Epos4Fake(objects={place: value})])).start()
    with pytest.raises(LinkTimeoutError, match="Node 9"):
        Epos4(SimulatedCanBus([Epos4Fake()]), node_id=9).identify()


def test_an_absent_object_is_refused_with_its_code():
    link = CanopenLink(SimulatedCanBus([Epos4Fake(absent=(0x6502,))]), 1, DeviceCounters())
    with pytest.raises(ObjectRefusedError, match=r"0x6502.*does not exist") as caught:
        link.read(0x6502)
    assert caught.value.code == 0x06020000
    bus = SimulatedCanBus([Epos4Fake()])
    bus.send(CanFrame(0x601, bytes.fromhex("4072600000000000")))  # 0x6072, absent from every EPOS4
    answers = [bus.read(0.0), bus.read(0.0)]
    assert CanFrame(0x581, bytes.fromhex("8072600000000206")) in answers
    with pytest.raises(DriverError, match="0x6072:0 is not in the dictionary"):
        link.read(0x6072)


@pytest.mark.integration
def test_it_runs_in_real_time_over_multicast_and_a_drive_that_dies_is_reported():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("", 0))
        url = f"can:udp_multicast:239.74.163.9?port={link.getsockname()[1]}"
    node = Epos4Fake()
    try:
        bus = LiveCanBus(open_can(url), open_can(url), [node])
    except LinkError as error:
        pytest.skip(f"no multicast here: {error}")
    device = Epos4(bus, rate_hz=100.0, host_timeout_ms=10_000)

    def run(samples: int) -> None:
        while samples > 0:
            samples -= len(device.read(0.5))

    device.start()
    device.arm()
    device.set_torque(2e-3)
    run(30)
    node.fail(0x8130)
    with pytest.raises(DriveFaultError, match="0x8130"):
        run(10_000)
    assert device.clear_fault() == 0x8130
    device.arm()
    run(30)
    assert device.last_error == 0
    node.transmit = list
    with pytest.raises(LinkTimeoutError, match="fallen silent"):
        run(10_000)
    with pytest.raises(DisarmUnconfirmedError):
        device.close()


WORDS = {
    State.NOT_READY: [0x0200],
    State.SWITCH_ON_DISABLED: [0x0240, 0x0270],
    State.READY: [0x0231],
    State.SWITCHED_ON: [0x0233],
    State.OPERATION_ENABLED: [0x0637],
    State.QUICK_STOP: [0x0217],
    State.FAULT_REACTION: [0x021F],
    State.FAULT: [0x0208],
}


def test_process_data_and_codes_are_those_of_the_specification():
    """Source: CiA 301, network states; CiA 402, controlwords; the TPDO's mapping."""
    feedback = protocol.Feedback(0x0637, -2, 258)
    data = bytes.fromhex("3706 feffffff 0201")
    assert protocol.encode_feedback(feedback) == data
    assert protocol.decode_feedback(data) == feedback
    assert (protocol.STOPPED, protocol.OPERATIONAL, protocol.PRE_OPERATIONAL) == (0x04, 0x05, 0x7F)
    words = (protocol.SHUTDOWN, protocol.ENABLE_OPERATION, protocol.DISABLE_VOLTAGE)
    assert (*words, protocol.FAULT_RESET) == (0x06, 0x0F, 0x00, 0x80)


@given(st.integers(0, 2**16 - 1))
def test_a_statusword_is_a_state_or_refused(word):
    assert all(protocol.state_of(word) is state for state in WORDS for word in WORDS[state])
    try:
        state = protocol.state_of(word)
    except FrameError:
        state = None
    powered = word & 0x6F in (0x23, 0x27, 0x07)
    assert (state in (State.SWITCHED_ON, State.OPERATION_ENABLED, State.QUICK_STOP)) == powered


NAMED = {
    (0x1080, 0x1088): "did not start",
    (0x6180, 0x61F0): "firmware",
    (0xFF11, 0xFF24): "tuning",
    (0x738A,): "Hall",
    (0x738C,): "SSI sensor could not be read",
    (0x738D,): "SSI sensor's frames",
    (0x5282,): "STO card",
}


@pytest.mark.parametrize("codes", NAMED)
def test_an_error_is_named_as_in_the_specification(codes):
    assert all(NAMED[codes] in faults.explain(code)[0] for code in codes)
    assert NAMED[codes] not in faults.explain(codes[-1] + 1)[0]
