"""The arithmetic behind the live display, and what a person reads on it, wide and narrow."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from estimation.recording import Flag
from rig.live.block import BlockError, DeviceStatus, LimitStatus
from rig.live.options import ShowOptions
from rig.live.state import LiveState, Value
from rig.live.text import plain_line, summary_lines
from rig.live.view import View, round_scale
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


def test_an_estimate_outside_its_range_is_no_value_and_its_error_is_reported_separately():
    inside = {GRIP: np.arange(1000) < 400}
    estimate = {GRIP: np.where(inside[GRIP], 0.103, 0.4)}
    state = state_of(block(0, 1000, estimates=estimate, inside=inside))
    (reading,) = state.snapshot().readings
    assert reading.estimate == Value(None, "outside what it was fitted on")
    assert reading.sensor.number is not None
    assert reading.error_rms == pytest.approx(0.003)
    summary = state.summary("finished")
    assert summary.error_samples == 1000
    assert summary.inside_rms == pytest.approx(0.003)
    assert summary.inside_samples == 400
    *_, line = summary_lines(summary, "N m")
    assert line == "Within what it was fitted on: 3.0 mN m over 400 of these samples."
    unsaid = state_of(block(0, 1000, estimates=estimate)).summary("finished")
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
    assert reading.sensor == reading.estimate == Value(None, flag.name.lower())
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


OPTIONS = ShowOptions("rig live")
DEVICES = (DeviceStatus("teensy", "armed", "SIM-0001"), DeviceStatus("load", "stale", "no reply"))
LIMITS = (LimitStatus("motor current", 0.31, 0.6, "A"), LimitStatus("torque", -0.29, 0.3, "N m"))


def stream(seconds=12.0, channel=GRIP, **changes):
    n = int(seconds * 1000)
    parts = {
        "columns": {channel: np.full(n, 0.12)},
        "estimates": {channel: np.full(n, 0.1234)},
        "devices": DEVICES,
        "limits": LIMITS,
    }
    return block(0, n, **parts | changes)


def snapshot_of(samples, channels=(GRIP,)):
    state = LiveState(channels)
    state.feed(samples)
    return state.snapshot()


def render(snapshot, width=80, height=24):
    console = Console(file=io.StringIO(), width=width, height=height, color_system=None)
    console.print(View(snapshot, OPTIONS))
    return console.file.getvalue()


@pytest.mark.parametrize("width", [80, 40])
def test_shows_what_a_person_needs(width):
    text = render(snapshot_of(stream()), width)
    for wanted in (
        "123.4 mN m",
        "10.28 N at the jaw tip (lever 12 mm)",
        "sensor 120.0 mN m",
        "error rms 3.4 mN m in 5 s",
        "1000 Hz",
        "lost 0",
        "● teensy armed",
        "▲ load stale",
        "0.310 of 0.600 A, 52 %",
        "-290.0 of 300.0 mN m, 97 % near"[: width - 8],
        "Ctrl-C",
    ):
        assert wanted in text, f"{wanted!r} is not on a display of {width} columns"


@pytest.mark.parametrize(("width", "height"), [(200, 60), (80, 24), (64, 24), (40, 24), (24, 10)])
def test_no_line_is_wider_than_the_terminal_and_the_drawing_fits(width, height):
    lines = render(snapshot_of(stream()), width, height).splitlines()
    assert all(len(line) < width for line in lines)
    if height >= 24:
        assert len(lines) < height


@pytest.mark.parametrize("width", [80, 40])
def test_flagged_samples_show_the_reason_and_no_number(width):
    flags = np.zeros(12_000, np.uint8)
    flags[-500:] = Flag.SATURATED
    text = render(snapshot_of(stream(flags=flags)), width)
    assert "no value (saturated)" in text
    assert "flagged in 10 s: saturated 500" in text
    assert "no force at the jaw tip" in text
    assert "mN m (" not in text
    assert "123.4" not in text


SPINDLE = "proximal_torque_n_m"


@pytest.mark.parametrize(
    ("channel", "changes", "wanted", "unwanted"),
    [
        (GRIP, {"estimates": {}}, "Grip torque, sensor  120.0 mN m", "estimate "),
        (GRIP, {"estimates": {}}, "10.00 N at the jaw tip", "error"),
        (GRIP, {"estimates": {}}, "no estimator", "error"),
        (SPINDLE, {}, "Spindle torque", " N at "),
        (GRIP, {"limits": (LimitStatus("a", 0.6, 0.6, "A"),)}, "AT LIMIT", "near"),
        (GRIP, {"limits": (LimitStatus("a", np.nan, 0.6, "A"),)}, "no value, limit 0.600 A", "%"),
    ],
)
def test_what_is_absent_or_reached_is_shown_as_that(channel, changes, wanted, unwanted):
    text = render(snapshot_of(stream(channel=channel, **changes), (channel,)))
    assert wanted in text
    assert unwanted not in text


@pytest.mark.parametrize("height", [16, 24])
def test_a_small_terminal_shows_the_nearest_limit(height):
    limits = tuple(LimitStatus(f"limit {k}", 0.1 * k, 0.6, "A") for k in range(6))
    text = render(snapshot_of(stream(limits=limits)), width=40, height=height)
    assert "limit 5" in text
    assert "5 more limits, none nearer" in text or height > 16


def test_colour_only_repeats_the_text():
    coloured = Console(file=io.StringIO(), width=80, height=24, record=True, force_terminal=True)
    coloured.print(View(snapshot_of(stream()), OPTIONS))
    assert coloured.export_text(styles=False) == render(snapshot_of(stream()))


def test_before_the_first_sample_the_display_reports_it():
    text = render(LiveState((GRIP,)).snapshot())
    assert "no samples yet" in text
    assert "sensor  no value (no samples arriving)" in text


def test_plain_line_holds_the_same_facts():
    line = plain_line(snapshot_of(stream()), OPTIONS)
    assert "\n" not in line
    for wanted in ("123.4 mN m", "10.28 N at 12 mm", "1000 Hz", "lost 0", "armed", "97 % near"):
        assert wanted in line
    assert "52 %" not in line  # a limit is named from 80 % of it on
