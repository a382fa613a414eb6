"""All monitors of the rig: on the board first, on the host again, with their messages."""

import dataclasses
import os
import signal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.linear import shipped_calibration_set
from drivers.teensy.protocol import STATUS_ARMED, TOP, SafeState, Trip, TripReport
from drivers.teensy.reference import REFERENCE, Limits
from rig.bench.session import Session
from rig.bench.trips import WORDS, HostWatch, trip_error
from rig.errors import ExitCode, SafetyTripError, exit_code_of
from rig.machines.reading import Reading
from rig.machines.reference import ReferenceMachine
from rig.machines.safety import board_limits, check_samples
from tests.rig.simulated import behind, is_armed, simulated, transport

pytestmark = [pytest.mark.integration, pytest.mark.usefixtures("library")]

HOLD = np.full(3000, -1.0)
CLOSE = np.concatenate([np.linspace(-1.0, 0.0, 1500), np.zeros(1500)])
LOAD = np.full(3000, 0.6)


def test_every_trip_has_words():
    assert set(WORDS) == set(Trip) - {Trip.NONE}
    for trip, (what, fix) in WORDS.items():
        report, lines = TripReport(trip, "", 1, 1, 0, 3000), shipped_calibration_set("reference")
        error = trip_error(report, lines, "", ReferenceMachine())
        for part in (what, f"code {int(trip)}", "3 ms"):
            assert part in error.what
        assert fix in error.fix
        assert exit_code_of(error) == ExitCode.SAFETY


def test_limits_reach_the_board_in_its_own_counts():
    config = simulated(firmware=True).changed(
        safety={"jaw_open_rad": -0.5, "jaw_closed_rad": 1.0, "stale_s": 0, "safe_state": "hold"}
    )
    limits = board_limits(config, config.calibration_set())
    assert limits.max_current == 600
    assert limits.i2t == 500_000  # 0.5 A^2 s at 1 mA a count
    assert (limits.min_jaw, limits.max_jaw) == (-318, 637)
    assert limits.max_motor_step == 261  # 0.4 rad a tick
    assert limits.stale_ticks == TOP
    assert limits.safe_state == SafeState.HOLD
    assert limits.min_spindle == -limits.max_spindle == -3911


STALLS = {"stall_current_a": 0.1, "stall_s": 0.2, "stall_motor_angle_rad": 3.0}
CROSSINGS = {
    Trip.OVERHEATED: ({"continuous_current_a": 0.05, "heat_a2_s": 0.01}, {}),
    Trip.STALLED: (STALLS, {}),
    Trip.OVER_SPEED: ({"motor_speed_rad_s": 15.0}, {}),
    Trip.JAW_TRAVEL: ({"jaw_closed_rad": -0.9}, {}),
    Trip.PROXIMAL_TORQUE: ({}, {"proximal_torque_n_m": 0.08}),
    Trip.OVER_CURRENT: ({}, {"motor_current_a": 0.1}),
}


@pytest.mark.parametrize("trip", list(CROSSINGS), ids=lambda trip: trip.name)
def test_a_crossing_ends_the_session_safe_and_reports_what_and_how_late(trip):
    safety, limits = CROSSINGS[trip]
    config = simulated(firmware=True).changed(safety=safety, limits=limits)
    link = transport(config)
    what = WORDS[trip][0]
    with pytest.raises(SafetyTripError, match=what) as caught, Session(config, link) as session:
        for _ in session.play(CLOSE, LOAD):
            pass
    assert "ms after it began" in caught.value.what
    assert "rig clear" in caught.value.fix
    assert not is_armed(link.board)


def test_with_hold_the_board_keeps_the_spindle_and_disarming_lets_go():
    config = simulated(firmware=True).changed(safety={**STALLS, "safe_state": "hold"})
    link = transport(config)
    with pytest.raises(SafetyTripError, match="holds the spindle"), Session(config, link) as rig:
        for _ in rig.play(CLOSE, LOAD):
            pass
    with Session(config, transport(config)) as rig:
        assert not next(rig.watch()).armed


def test_the_host_repeats_what_the_board_is_blind_to():
    """A board that does not trip has wide limits; the host holds the configured ones."""
    config = simulated(firmware=True)
    link = transport(config)
    with Session(config, link) as session:
        readings = session.play(HOLD[:600], LOAD[:600])
        reading = next(r for r in readings if len(r) and (r.counts["status"] & STATUS_ARMED).any())
    narrow = dataclasses.replace(Limits(), max_current=1)
    crossing = HostWatch([0.0] * 5, narrow, ReferenceMachine()).check(reading)
    assert crossing.code is Trip.OVER_CURRENT
    assert HostWatch([0.0] * 5, Limits(), ReferenceMachine()).check(reading) is None


def test_a_value_that_is_no_number_is_beyond_every_limit():
    config = simulated(firmware=True)
    with Session(config, transport(config)) as session:
        reading = next(session.rest(0.1))
    columns = {**reading.columns, "proximal_torque_n_m": np.full(len(reading), np.nan)}
    with pytest.raises(SafetyTripError, match="proximal_torque_n_m reached nan"):
        check_samples(config.limits.model_dump(), columns, reading.time_s)


@pytest.mark.usefixtures("hang_up_is_heard")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_second_ctrl_c_does_not_break_into_the_way_out(number):
    """The second comes while the board is being disarmed, which must go on all the same."""
    config = simulated(firmware=True)
    link = transport(config)
    leaving = False

    def strike(data: bytes) -> bytes:
        if leaving:
            os.kill(os.getpid(), number)
        return data

    handler = signal.getsignal(number)
    paced = behind(link, strike)
    with pytest.raises(KeyboardInterrupt), Session(config, paced) as session:  # noqa: PT012
        next(session.play(HOLD, LOAD))
        leaving = True
        os.kill(os.getpid(), number)
        for _ in session.watch():
            pass
    leaving = False
    assert not is_armed(link.board)
    assert signal.getsignal(number) is handler


def test_a_cut_cable_is_reported_as_unknown_and_the_board_makes_itself_safe():
    config = simulated(firmware=True).changed(safety={"watchdog_s": 0.05})
    link = transport(config)
    unsafe = pytest.raises(SafetyTripError, match="did not confirm")
    with unsafe as left, Session(config, link) as session:
        next(session.play(HOLD, LOAD))
        link.close()
        next(session.watch())
    assert "Cut the motor supply" in left.value.fix
    link.board.advance(51)
    assert not is_armed(link.board)


MAX_STEP = 100
MOST = dataclasses.replace(Limits(), max_motor_step=MAX_STEP)
TICKS = 400


@pytest.fixture(scope="module")
def rested() -> Reading:
    config = simulated()
    with Session(config, transport(config)) as session:
        return next(reading for reading in session.rest(0.2) if len(reading))


def watch_motor(rested: Reading, step: int, came: np.ndarray, first_tick: int) -> TripReport | None:
    """Hold the limit against the samples that came of a motor at `step` counts a tick.

    The clock starts at `first_tick` and wraps; the samples come in two readings.
    """
    tick = np.flatnonzero(came)
    counts = np.zeros(len(tick), rested.counts.dtype)
    counts["tick_us"] = (first_tick + tick) * REFERENCE.tick_us % 2**32
    counts["sequence"] = tick
    counts["motor"] = step * tick
    counts["status"] = STATUS_ARMED
    watch = HostWatch([0.0] * 5, MOST, ReferenceMachine())
    parts = (dataclasses.replace(rested, counts=part) for part in np.array_split(counts, 2))
    return next(filter(None, map(watch.check, parts)), None)


@st.composite
def arrivals(draw: st.DrawFn) -> np.ndarray:
    """Return which samples came; six on end always do, at the end."""
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    came = random.random(TICKS) >= draw(st.floats(0.0, 0.95))
    came[[0, *range(-6, 0)]] = True
    return came


FIRST_TICKS = st.sampled_from([0, 2**32 // REFERENCE.tick_us - TICKS // 2])


@given(st.integers(-MAX_STEP, MAX_STEP), arrivals(), FIRST_TICKS)
def test_lost_samples_of_a_moving_motor_are_no_over_speed(rested, step, came, first_tick):
    assert watch_motor(rested, step, came, first_tick) is None


@given(st.integers(MAX_STEP + 1, 4 * MAX_STEP), st.sampled_from([-1, 1]), arrivals(), FIRST_TICKS)
def test_a_motor_too_fast_is_found_however_many_samples_are_lost(
    rested, step, sign, came, first_tick
):
    crossing = watch_motor(rested, sign * step, came, first_tick)
    assert (crossing.code, crossing.channel) == (Trip.OVER_SPEED, "motor")
    assert crossing.limit == MAX_STEP
