"""What every drive on a serial line keeps: its limit, a watchdog of its own, a confirmed disarm."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from drivers.dynamixel.driver import Dynamixel
from drivers.dynamixel.fake import DynamixelFake
from drivers.errors import DisarmUnconfirmedError, DriverError, LinkTimeoutError
from drivers.moteus.driver import Moteus
from drivers.moteus.fake import MoteusFake
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import SimulatedTransport


@dataclass
class Kind:
    fake: Callable[[], Any]
    driver: Callable[[Any], Any]
    command: str
    some: float
    limit: float
    given: Callable[[Any], float]
    silence: str


KINDS = {
    "dynamixel": Kind(
        *(DynamixelFake, lambda link: Dynamixel(link, watchdog_ms=100), "set_current", 0.03),
        *(1.75, lambda fake: 1e-3 * fake.current, "stopped by itself"),
    ),
    "moteus": Kind(
        *(MoteusFake, Moteus, "set_torque", 0.01, 0.1),
        *(lambda fake: fake.torque_n_m, "timed out"),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_drive_that_is_not_started_or_not_there_is_refused(kind):
    device = KINDS[kind].driver(SimulatedTransport(KINDS[kind].fake()))
    with pytest.raises(DriverError, match="Call start"):
        device.arm()
    absent = type(device)(SimulatedTransport(KINDS[kind].fake()), device_id=9)
    with pytest.raises(LinkTimeoutError, match="identifier 9"):
        absent.identify()


@pytest.fixture(params=KINDS)
def armed(request: pytest.FixtureRequest) -> tuple[Kind, Any, Any, FaultyTransport]:
    """A kind of drive, its fake, its driver in force, and the cable between them."""
    kind = KINDS[request.param]
    fake = kind.fake()
    cable = FaultyTransport(SimulatedTransport(fake))
    device = kind.driver(cable)
    device.start()
    device.arm()
    return kind, fake, device, cable


@pytest.mark.parametrize("factor", [math.nan, math.inf, 1.1, -1.1])
def test_a_command_beyond_the_limit_or_no_number_is_refused(armed, factor):
    kind, _, device, _ = armed
    with pytest.raises(DriverError, match=rf"limit is {kind.limit}"):
        getattr(device, kind.command)(factor * kind.limit)
    device.close()


def test_a_host_that_falls_silent_stops_the_motor_and_reads_why(armed):
    kind, fake, device, _ = armed
    command = getattr(device, kind.command)
    for _ in range(2):  # armed again, it is as before
        command(kind.some)
        device.read(0.1)
        fake.advance(100)
        assert kind.given(fake) == pytest.approx(kind.some)
        fake.advance(1)
        assert kind.given(fake) == 0
        with pytest.raises(DriverError, match=kind.silence):  # noqa: PT012
            for _ in range(3):
                device.read(0.1)
        with pytest.raises(DriverError, match="not armed"):
            command(kind.some)
        device.arm()
    device.close()


def test_a_disarm_that_nobody_confirms_is_no_disarm(armed):
    _, _, device, cable = armed
    cable.incoming = lambda data: b""
    with pytest.raises(DisarmUnconfirmedError, match=r"cut its supply.*(100 ms|0\.1 s)"):
        device.disarm()
    with pytest.raises(DisarmUnconfirmedError):
        device.close()
