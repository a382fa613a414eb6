"""The linked images of the three Teensy boards, run in an emulator: what reaches which register.

Needs PJRC's cores (TEENSY_CORES, see firmware/teensy.mk) and Debian's Arm compiler.
"""

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from drivers.framing import FrameStream, encode_frame
from drivers.teensy import protocol
from drivers.teensy.grasper import GRASPER, AxisLimits, GrasperLimits
from drivers.teensy.protocol import Kind
from drivers.teensy.reference import REFERENCE, Limits

pytest.importorskip("unicorn", reason="no emulator: pip install unicorn pyelftools")

from tests.drivers.teensy_image import K64, RT1062, TeensyImage

pytestmark = pytest.mark.integration

FIRMWARE = Path(__file__).parents[2] / "firmware"
CHIPS = {"teensy35": K64, "teensy41": RT1062, "teensy41-grasper": RT1062}
ENABLES = {
    "teensy35": [(0x400FF100, 26), (0x400FF000, 5)],
    "teensy41": [(0x42008000, 18), (0x4200C000, 31)],
    "teensy41-grasper": [(0x42008000, 18), (0x4200C000, 31), (0x42008000, 23)],
}
"""Port and bit of each enable pin; PJRC's core_pins.h."""
REGISTERS = {K64: (0x04, 0x08, 0x14), RT1062: (0x84, 0x88, 0x04)}
"""Of a port: set, clear, direction."""
CROSSBAR, FIRST_DECODER_OUTPUT, DECODER_OUTPUTS = 0x403BC000, 66, 5
WDOG3_CS, WDOG3_CNT, WDOG3_TOVAL = 0x400BC000, 0x400BC004, 0x400BC008
WDOG_CONTROL, WDOG_TIMEOUT, WDOG_REFRESH = 0x40052000, 0x40052006, 0x4005200C

Images = Callable[[str], TeensyImage]


@pytest.fixture(scope="module")
def images() -> Images:
    """Build the images and give one that has booted."""
    cores = os.environ.get("TEENSY_CORES", "")
    if not cores or not Path(cores).exists():
        pytest.skip("no Teensy cores: set TEENSY_CORES to a folder or archive of PJRC's cores")
    if shutil.which("arm-none-eabi-g++") is None:
        pytest.skip("no arm-none-eabi-g++: apt-get install gcc-arm-none-eabi")
    words = ["make", "-C", str(FIRMWARE), "-f", "teensy.mk", f"TEENSY_CORES={cores}", "emulated"]
    subprocess.run(words, check=True, capture_output=True)

    def booted(name: str) -> TeensyImage:
        image = TeensyImage(FIRMWARE / "build" / "teensy" / f"{name}.emulated.elf", CHIPS[name])
        image.boot()
        return image

    return booted


def enable_writes(name: str, image: TeensyImage, since: int = 0) -> list[tuple[str, int]]:
    """What was written to the enable pins, in order: set, clear or direction, and which pin."""
    names = dict(zip(REGISTERS[CHIPS[name]], ("set", "clear", "output"), strict=True))
    return [
        (names[at - port], k)
        for at, value in image.writes[since:]
        for k, (port, bit) in enumerate(ENABLES[name])
        if at - port in names and value >> bit & 1
    ]


def say(image: TeensyImage, *payloads: bytes) -> int:
    """Hand commands to the main loop; return the most instructions on end with interrupts off."""
    longest = 0
    for payload in payloads:
        image.received += b"\x00" + encode_frame(payload)
        while image.received:
            image.call("loop")
            longest = max(longest, image.longest_locked)
    return longest


def offered(image: TeensyImage) -> int:
    """Say hello and return the session the board offers."""
    image.sent.clear()
    say(image, protocol.encode(Kind.HELLO, 1))
    replies: list[bytes] = []
    while not replies:  # behind the samples that wait
        image.call("loop")
        frames = FrameStream(0).feed(bytes(image.sent)).others
        replies = [frame for frame in frames if frame[1] == Kind.HELLO_REPLY]
    (reply,) = replies
    return int(np.frombuffer(reply, protocol.HELLO_REPLY_DTYPE)["offer"][0])


MOTOR = {
    "max_current": 900,
    "max_motor_step": 80,
    "max_motor_jump": 300,
    "max_target_step": 10,
    "max_following": 500,
    "following_ticks": 100,
    "continuous_current": 500,
    "i2t": 20_000,
}
CHOICE = {"stall_ticks": 100, "dry_ticks": 100, "hold_ticks": 100, "watchdog_us": 50_000}


def arming(name: str, session: int) -> tuple[bytes, bytes]:
    """Return commands that arm within the board's own limits, and the longest setpoints."""
    if name.endswith("grasper"):
        axis = AxisLimits(min_motor=-9, max_motor=9, **MOTOR)
        arm = GRASPER.encode_arm(
            2, np.tile([1.0, 0, 0, 1, 100], (3, 1)), GrasperLimits((axis,) * 3, **CHOICE), session
        )
        return arm, GRASPER.encode_setpoints(3, [np.zeros(50, np.int32)] * 3, session)
    load = {"max_load_ma": 9, "continuous_load_ma": 500, "load_i2t": 20_000}
    limits = Limits(min_spindle=-9, max_spindle=9, **load, **MOTOR, **CHOICE)
    arm = REFERENCE.encode_arm(2, np.array([[1.0, 0, 0, 1, 100]]), limits, session)
    return arm, REFERENCE.encode_setpoints(3, [np.zeros(100, np.int32)] * 2, session)


def set_in_motion(name: str, image: TeensyImage) -> int:
    """Arm the board and let it follow set-points for some ticks.

    Returns the most instructions on end with interrupts off on the way.
    """
    for _ in range(110):  # it stands still, and is referenced where it stands
        image.tick()
    longest = say(image, protocol.encode(Kind.REFERENCE, 1, 0, 0, 0, False))
    longest = max(longest, say(image, *arming(name, offered(image))))
    for _ in range(3):
        image.tick()
        image.call("loop")
        longest = max(longest, image.longest_locked)
    return longest


@pytest.mark.parametrize(("name", "mhz"), [("teensy35", 120), ("teensy41", 600)])
def test_a_frame_from_the_host_keeps_no_edge_waiting(images, name, mhz):
    """At one instruction a cycle; the longest set-point frame, its acknowledgement, and samples."""
    image = images(name)
    say(image, protocol.encode(Kind.START, 9))
    longest = set_in_motion(name, image)
    assert 0 < longest <= 20 * mhz


@pytest.mark.parametrize("name", ["teensy41", "teensy41-grasper"])
def test_every_decoder_input_of_a_teensy_41_comes_from_a_pin_of_its_own(images, name):
    image = images(name)
    inputs = []
    for decoder in range(3):
        for phase in range(2):
            output = FIRST_DECODER_OUTPUT + DECODER_OUTPUTS * decoder + phase
            selected = image.last(CROSSBAR + output // 2 * 2)
            inputs.append(selected >> 8 * (output % 2) & 0xFF)
    assert len(set(inputs)) == 6


@pytest.mark.parametrize("name", list(CHIPS))
def test_a_board_boots_with_its_enables_low(images, name):
    written = enable_writes(name, images(name))
    for pin in range(len(ENABLES[name])):
        assert ("clear", pin) in written
        assert ("output", pin) in written
        assert ("set", pin) not in written


@pytest.mark.parametrize("name", list(CHIPS))
def test_a_fault_takes_the_enables_low_and_leaves_them(images, name):
    image = images(name)
    set_in_motion(name, image)
    pins = set(range(len(ENABLES[name])))
    assert {pin for what, pin in enable_writes(name, image) if what == "set"} == pins
    before = len(image.writes)
    vector = (
        "hard_fault_isr" if CHIPS[name] is K64 else image.word(image.symbols["_VectorsRam"] + 12)
    )
    image.call(vector, limit=2000)
    assert enable_writes(name, image, before)
    assert {what for what, _ in enable_writes(name, image, before)} <= {"clear", "output"}
    assert {pin for what, pin in enable_writes(name, image, before) if what == "clear"} == pins


@pytest.mark.parametrize("name", list(CHIPS))
def test_the_watchdog_runs_and_is_fed_only_by_tick_and_loop(images, name):
    image = images(name)
    if CHIPS[name] is K64:
        fed_at = WDOG_REFRESH
        assert image.last(WDOG_TIMEOUT) <= 20
        assert image.last(WDOG_CONTROL) & 1
    else:
        fed_at = WDOG3_CNT
        assert image.last(WDOG3_TOVAL) <= 20e-3 * 32768
        assert image.last(WDOG3_CS) & 1 << 7

    def meals() -> int:
        before = len(image.writes)
        image.tick()
        return sum(at == fed_at for at, _ in image.writes[before:])

    image.call("loop")
    assert meals() > 0
    assert meals() == meals() == 0
    before = len(image.writes)
    for _ in range(5):
        image.call("loop")
    assert fed_at not in [at for at, _ in image.writes[before:]]
    assert meals() > 0
