"""A session: what it reads, what it refuses, and that it ends safe on every way out."""

import os
import pty
import sys
from collections.abc import Callable

import numpy as np
import pytest

from drivers.teensy.driver import SampleBatch
from drivers.teensy.protocol import (
    STATUS_ARMED,
    STATUS_LIMIT_TRIPPED,
    STATUS_QUEUE_DRY,
    STATUS_SATURATED,
)
from drivers.transport.simulated import SimulatedTransport
from estimation.recording import Flag
from rig.bench.intake import LoggerStalledError
from rig.bench.session import Session
from rig.errors import SafetyTripError
from rig.log.reader import read_log
from rig.machines.reading import reading_of, with_setpoints
from tests.rig.simulated import behind, is_armed, protocol_file, session, simulated, transport

pytestmark = pytest.mark.integration

HOLD = np.full(600, -1.0)
LOAD = np.full(600, 0.3)


def test_rest_reads_a_disarmed_rig_in_si_units():
    with session() as rig:
        reading = next(rig.rest(0.2))
    assert not reading.armed
    assert set(reading.columns) == set(simulated().calibration_set().channels)
    np.testing.assert_allclose(np.diff(reading.time_s), 1e-3)
    assert (reading.setpoint == -1).all()


def test_zeros_are_taken_from_what_is_read_after():
    with session() as rig:
        offset = np.mean([r.columns["proximal_torque_n_m"].mean() for r in rig.rest(0.5)])
        rig.take_zeros(0.5)
        zeroed = np.mean([r.columns["proximal_torque_n_m"].mean() for r in rig.rest(0.5)])
    assert abs(offset) > 5e-3  # the simulated sensor has an offset
    assert abs(zeroed) < 5e-4


def test_every_setpoint_is_played_once_and_in_order():
    angle = np.linspace(-1.0, -0.6, 1000)
    with session() as rig:
        readings = list(rig.play(angle, np.zeros(1000)))
    setpoint = np.concatenate([r.setpoint for r in readings])
    target = np.concatenate([r.columns["target_angle_rad"] for r in readings])
    played = setpoint[setpoint >= 0]
    np.testing.assert_array_equal(played, np.arange(1000))
    np.testing.assert_allclose(target[setpoint >= 0], angle, atol=2 * np.pi / 8192)
    assert all(r.armed for r in readings)


@pytest.mark.parametrize("error", [ValueError("a bug"), KeyboardInterrupt()])
def test_the_rig_is_disarmed_whatever_ends_the_session(error):
    config = simulated()
    link = transport(config)
    with pytest.raises(type(error)), Session(config, link) as session:  # noqa: PT012
        assert next(session.play(HOLD, LOAD)).armed
        raise error
    assert not is_armed(link.board)


@pytest.mark.parametrize(
    ("angle", "load", "name"),
    [(9.0, 0.0, "spindle_angle_rad"), (-1.0, 5.0, "load_command_a"), (np.nan, 0.0, "spindle")],
)
def test_a_trajectory_beyond_the_limits_is_refused_before_anything_moves(angle, load, name):
    with session() as rig:
        with pytest.raises(SafetyTripError, match=name):
            next(rig.play(np.full(10, angle), np.full(10, load)))
        assert not next(rig.watch()).armed


def test_a_silent_logger_is_named_within_a_second():
    config = simulated()
    link = transport(config)
    silent = False
    paced = behind(link, lambda data: b"" if silent else data)
    unsafe = pytest.raises(SafetyTripError, match="did not confirm")
    with unsafe as left, Session(config, paced) as session:
        next(session.rest(0.1))
        silent = True
        began_s = paced.now_s
        with pytest.raises(LoggerStalledError, match="sent nothing"):
            next(session.watch())
        assert paced.now_s - began_s < 2.0
    assert "Cut the motor supply" in left.value.fix


def test_lost_and_damaged_bytes_are_counted_and_nothing_is_made_up():
    config = simulated()
    link = transport(config)
    generator = np.random.default_rng(0)

    def damage(data: bytes) -> bytes:
        bad = bytearray(data)
        if len(bad) > 1000:  # a stretch of samples, not an answer alone
            for place in generator.integers(0, len(bad), 3):
                bad[place] ^= 0x55
        return bytes(bad)

    with Session(config, behind(SimulatedTransport(link.board, step_s=0.2), damage)) as session:
        readings = list(session.rest(3.0))
        counters = session.counters
    ticks = np.concatenate([r.tick_us for r in readings])
    assert counters["lost"] > 0
    assert counters["crc_errors"] > 0
    assert (np.diff(ticks) % 1000 == 0).all()
    missing = (ticks[-1] - ticks[0]) // 1000 + 1 - ticks.size
    assert missing == readings[-1].lost


def test_a_late_host_causes_flagged_samples_not_wrong_ones():
    """The queue runs dry when the host is late; the target is held and the samples say so."""
    config = simulated()
    link = SimulatedTransport(transport(config).board, step_s=0.08)
    angle_rad, load_a = np.linspace(-1.0, -0.8, 500), np.zeros(500)
    pieces = [slice(cut, cut + 10) for cut in range(0, 500, 10)]
    with Session(config, link) as session:
        asked = ((angle_rad[piece], load_a[piece]) for piece in pieces)
        readings = list(session.follow(asked, lead_s=0.05))
    setpoint = np.concatenate([r.setpoint for r in readings])
    flags = np.concatenate([r.flags for r in readings])
    np.testing.assert_array_equal(setpoint[setpoint >= 0], np.arange(500))
    held = flags == Flag.STALE
    assert held.any()
    assert (setpoint[held] == -1).all()


def test_what_the_board_complains_of_becomes_a_flag():
    with session() as rig:
        counts = next(rig.rest(0.1)).counts
    counts["status"][:3] |= STATUS_SATURATED
    counts["status"][3] |= STATUS_LIMIT_TRIPPED
    batch = SampleBatch(counts, np.arange(len(counts)) * 1000, 0)
    reading = reading_of(batch, simulated().calibration_set(), {}, 0)
    assert reading.flags[:5].tolist() == [Flag.SATURATED] * 3 + [Flag.SUSPECT, 0]


def test_setpoints_are_numbered_past_samples_lost_between_two_readings():
    with session() as rig:
        counts = next(rig.rest(0.1)).counts[:6]
    counts["status"] = [0, STATUS_ARMED, STATUS_ARMED, STATUS_ARMED, STATUS_ARMED, STATUS_QUEUE_DRY]
    counts["sequence"] = [10, 11, 12, 15, 16, 17]
    batch = SampleBatch(counts, np.arange(6) * 1000, 0)
    reading = reading_of(batch, simulated().calibration_set(), {}, 0)
    first = with_setpoints(reading, 0, 100, None)
    assert first.setpoint.tolist() == [-1, 0, 1, 4, 5, -1]
    assert first.flags.tolist() == [0, 0, 0, 0, 0, Flag.STALE]
    later = with_setpoints(reading, 6, 100, before=7)
    assert later.setpoint.tolist() == [-1, 6, 7, 10, 11, -1]


class Typed:
    """A command that was typed in a terminal of its own."""

    def __init__(self, *words: str) -> None:
        self._child, self._terminal = pty.fork()
        if self._child == 0:
            os.execv(sys.executable, [sys.executable, "-m", "rig", *words])  # noqa: S606
        os.set_inheritable(self._terminal, False)  # a later command would keep it open

    def close_terminal(self, when: Callable[[str], bool]) -> int:
        """Close the terminal when it shows something; return the command's exit code."""
        shown = ""
        while not when(shown):
            shown += os.read(self._terminal, 4096).decode(errors="replace")
        os.close(self._terminal)
        _, status = os.waitpid(self._child, 0)
        return os.waitstatus_to_exitcode(status)


def has_samples(path):
    if not path.stat().st_size:
        return False
    return any(topic.rows.size for topic in read_log(path, tolerant=True).topics.values())


@pytest.mark.usefixtures("hang_up_is_heard")
def test_recording_closes_its_log_and_the_rig_is_safe(tmp_path):
    out = tmp_path / "campaign"
    protocol = protocol_file(tmp_path, duration_s=2000.0)
    command = Typed("record", "-p", str(protocol), "-o", str(out))
    assert command.close_terminal(lambda _: any(map(has_samples, out.glob("*.part")))) == 130
    (path,) = out.glob("*.mcap*")
    assert not read_log(path).end.clean


@pytest.mark.usefixtures("hang_up_is_heard")
def test_the_display_ends_as_ctrl_c_ends_it():
    displays = Typed("live", "--pace", "1"), Typed("live", "--plain")
    assert [one.close_terminal(lambda shown: "mN" in shown) for one in displays] == [130, 130]
