"""The arithmetic behind the live display, without a terminal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.recording import Flag
from rig.live.block import BlockError, DeviceStatus
from rig.live.sparkline import round_scale
from rig.live.state import LiveState
from rig.live.text import summary_lines
from tests.rig.blocks import GRIP, block


def state_of(*blocks):
    state = LiveState((GRIP,))
    for each in blocks:
        state.feed(each)
    return state


def test_value_is_the_mean_of_the_last_tenth_of_a_second():
    snapshot = state_of(block(0, 900, sensor=9.0), block(900, 100, sensor=0.2)).snapshot()
    assert snapshot.readings[0].sensor.number == pytest.approx(0.2)


def test_error_rms_is_of_the_last_five_seconds_and_in_the_summary_of_all():
    state = state_of(
        block(0, 5000, sensor=0.1, estimate=0.4), block(5000, 5000, sensor=0.1, estimate=0.103)
    )
    assert state.snapshot().readings[0].error_rms == pytest.approx(0.003)
    summary = state.summary("finished")
    assert summary.error_rms == pytest.approx(np.sqrt((0.3**2 + 0.003**2) / 2))
    assert summary.error_samples == 10_000
    assert summary.duration_s == pytest.approx(9.999)


def test_the_error_within_the_fitted_range_is_reported_separately():
    inside = {GRIP: np.arange(1000) < 400}
    estimate = {GRIP: np.where(inside[GRIP], 0.103, 0.4)}
    summary = state_of(block(0, 1000, estimates=estimate, inside=inside)).summary("finished")
    assert summary.inside_rms == pytest.approx(0.003)
    assert summary.inside_samples == 400
    *_, line = summary_lines(summary, "N m")
    assert line == "Within what it was fitted on: 3.0 mN m over 400 of these samples."
    unsaid = state_of(block(0, 1000, estimates=estimate)).summary("finished")
    assert unsaid.inside_rms is None
    assert "Within" not in " ".join(summary_lines(unsaid, "N m"))


def test_a_gap_lowers_the_measured_rate():
    with_gap = state_of(block(0, 500), block(1000, 1000, lost=500)).snapshot()
    assert with_gap.sample_rate_hz == pytest.approx(750, rel=0.01)
    assert with_gap.lost == 500


@pytest.mark.parametrize("flag", [f for f in Flag if f])
def test_flagged_samples_give_the_reason_and_no_number(flag):
    snapshot = state_of(
        block(0, 500, estimate=0.1),
        block(500, 200, estimate=0.1, flags=np.full(200, flag, np.uint8)),
    ).snapshot()
    reading = snapshot.readings[0]
    assert reading.sensor.number is None
    assert reading.estimate.number is None
    assert reading.sensor.missing == flag.name.lower()
    assert snapshot.flagged == {flag.name.lower(): 200}


def test_blocks_without_samples_mean_that_nothing_arrives():
    silence = block(500, 0, columns={}, devices=(DeviceStatus("teensy", "stale"),))
    state = state_of(block(0, 500), silence)
    assert state.snapshot().readings[0].sensor.number == pytest.approx(0.1), "one may be late"
    state.feed(silence)
    snapshot = state.snapshot()
    assert snapshot.readings[0].sensor.missing == "no samples arriving"
    assert snapshot.devices[0].state == "stale"
    state.feed(block(900, 100))
    assert state.snapshot().readings[0].sensor.number == pytest.approx(0.1)


def test_a_restarted_device_clock_begins_the_trace_anew_and_keeps_the_totals():
    state = state_of(block(0, 3000, sensor=5.0), block(0, 1000, sensor=0.1))
    snapshot = state.snapshot()
    assert np.nanmax(snapshot.readings[0].sensor_trace) == pytest.approx(0.1)
    assert snapshot.samples == 4000
    assert state.summary("finished").duration_s == pytest.approx(2.999 + 0.999)


def test_blocks_whose_parts_do_not_fit_are_refused():
    with pytest.raises(BlockError, match="shape"):
        block(0, 10, columns={GRIP: np.zeros(9)})
    with pytest.raises(BlockError, match="increase"):
        block(0, 2, time_s=np.array([0.1, 0.1]))


@given(sizes=st.lists(st.integers(1, 400), min_size=1, max_size=12), seed=st.integers(0, 1000))
def test_the_picture_does_not_depend_on_how_samples_are_cut_into_blocks(sizes, seed):
    n = sum(sizes)
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.0005, 0.004, n))
    values = np.where(rng.random(n) < 0.2, np.nan, rng.normal(size=n))

    def part(index):
        return block(0, len(index), time_s=time_s[index], columns={GRIP: values[index]})

    whole = state_of(part(np.arange(n))).snapshot()
    cut = state_of(*map(part, np.split(np.arange(n), np.cumsum(sizes)[:-1]))).snapshot()
    assert (cut.samples, cut.sample_rate_hz) == (whole.samples, whole.sample_rate_hz)
    assert cut.readings[0].sensor == whole.readings[0].sensor
    np.testing.assert_array_equal(cut.readings[0].sensor_trace, whole.readings[0].sensor_trace)


@given(*2 * [st.integers(-(10**12), 10**12).map(lambda n: n * 1e-6)])
def test_scale_holds_the_range_and_zero(a, b):
    low, high = round_scale(min(a, b), max(a, b))
    assert low <= min(a, b, 0) <= max(a, b, 0) <= high
    assert low < high


def test_an_estimate_outside_its_range_is_no_value():
    inside = {GRIP: np.arange(1000) < 400}
    state = state_of(block(0, 1000, estimates={GRIP: np.full(1000, 0.4)}, inside=inside))
    (reading,) = state.snapshot().readings
    assert reading.estimate.number is None
    assert reading.estimate.missing == "outside what it was fitted on"
    assert reading.sensor.number is not None
    assert reading.error_rms == pytest.approx(abs(0.4 - reading.sensor.number))
    assert state.summary("finished").error_samples == 1000
