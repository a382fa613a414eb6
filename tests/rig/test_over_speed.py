"""The host's watch of a motor's speed: lost and late samples make none, a fast motor does."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.teensy.protocol import STATUS_ARMED, Trip, TripReport
from drivers.teensy.reference import REFERENCE, Limits
from rig.bench.session import Session
from rig.bench.trips import HostWatch
from rig.machines.reading import Reading
from rig.machines.reference import ReferenceMachine
from tests.rig.simulated import simulated, transport

pytestmark = pytest.mark.integration

MAX_STEP = 100
LIMITS = dataclasses.replace(Limits(), max_motor_step=MAX_STEP)
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
    watch = HostWatch([0.0] * 5, LIMITS, ReferenceMachine())
    half = len(tick) // 2
    for part in (counts[:half], counts[half:]):
        crossing = watch.check(dataclasses.replace(rested, counts=part))
        if crossing is not None:
            return crossing
    return None


def arrivals(lost_share: float, seed: int) -> np.ndarray:
    """Return which samples came; six on end always do, at the end."""
    came = np.random.default_rng(seed).random(TICKS) >= lost_share
    came[[0, *range(-6, 0)]] = True
    return came


@given(
    st.integers(-MAX_STEP, MAX_STEP),
    st.floats(0.0, 0.95),
    st.integers(0, 2**32),
    st.sampled_from([0, 2**32 // REFERENCE.tick_us - TICKS // 2]),
)
def test_lost_samples_of_a_moving_motor_are_no_over_speed(rested, step, lost, seed, first_tick):
    assert watch_motor(rested, step, arrivals(lost, seed), first_tick) is None


@given(
    st.integers(MAX_STEP + 1, 4 * MAX_STEP),
    st.sampled_from([-1, 1]),
    st.floats(0.0, 0.95),
    st.integers(0, 2**32),
    st.sampled_from([0, 2**32 // REFERENCE.tick_us - TICKS // 2]),
)
def test_a_motor_too_fast_is_found_however_many_samples_are_lost(
    rested, step, sign, lost, seed, first_tick
):
    crossing = watch_motor(rested, sign * step, arrivals(lost, seed), first_tick)
    assert (crossing.code, crossing.channel) == (Trip.OVER_SPEED, "motor")
    assert crossing.limit == MAX_STEP
