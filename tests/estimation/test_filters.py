"""Filters, the noise-robust derivative, and live channels; the tracker is filterpy's filter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.derived import zero_phase_channels
from estimation.filters import (
    FilterError,
    LowPass,
    filter_recording,
    holoborodko_coefficients,
    holoborodko_derivative,
    zero_phase,
)
from estimation.kalman import steady_filter, tracker
from estimation.live_channels import CausalChannels, causal_channels
from estimation.recording import Flag, Recording, Stretch

RATE_HZ = 1000.0
PERIOD_S = 1e-3


def tone(frequency_hz: float, n: int = 4000) -> np.ndarray:
    return np.sin(2 * np.pi * frequency_hz * np.arange(n) * PERIOD_S)


@pytest.mark.parametrize(
    ("points", "degree", "expected"),
    [
        (3, 2, np.array([1]) / 2),
        (5, 2, np.array([2, 1]) / 8),
        (11, 2, np.array([42, 48, 27, 8, 1]) / 512),
        (5, 4, np.array([8, -1]) / 12),
        (7, 4, np.array([39, 12, -5]) / 96),
        (11, 4, np.array([322, 256, 39, -32, -11]) / 1536),
    ],
)
def test_coefficients_are_the_published_ones(points, degree, expected):
    assert holoborodko_coefficients(points, degree) == pytest.approx(expected, abs=1e-15)


@given(st.lists(st.floats(-3, 3), min_size=5, max_size=5))
def test_derivative_is_exact_on_polynomials_and_at_the_edges_on_parabolas(factors):
    x = np.linspace(-1, 1, 60)
    for degree, inside in ((4, slice(5, -5)), (2, slice(None))):
        polynomial = np.polynomial.Polynomial(factors[: degree + 1])
        found = holoborodko_derivative(polynomial(x), x[1] - x[0])
        assert found[inside] == pytest.approx(polynomial.deriv()(x)[inside], abs=1e-9)


def test_derivative_of_three_samples_and_of_fewer():
    assert holoborodko_derivative([0.0, 1.0, 4.0], 1.0) == pytest.approx([0.0, 2.0, 4.0])
    with pytest.raises(FilterError, match="three are needed"):
        holoborodko_derivative([0.0, 1.0], 1.0)
    with pytest.raises(FilterError, match="odd"):
        holoborodko_coefficients(10, 4)


def test_filter_passes_low_tones_without_lag_and_halves_amplitude_at_the_cutoff():
    middle = slice(500, -500)
    assert zero_phase(tone(2), RATE_HZ)[middle] == pytest.approx(tone(2)[middle], abs=1e-4)
    at_cutoff = zero_phase(tone(50), RATE_HZ)[middle]
    assert at_cutoff == pytest.approx(0.5 * tone(50)[middle], abs=1e-3)
    assert np.abs(zero_phase(tone(300), RATE_HZ)[middle]).max() < 1e-3


@pytest.mark.parametrize(
    ("count", "rate_hz", "message"),
    [
        (10, RATE_HZ, "too few"),
        (100, 80.0, "half the sample rate"),
        (100, np.nextafter(100.0, 101.0), "half the sample rate"),  # of rounded time stamps
    ],
)
def test_filter_names_what_it_cannot_do(count, rate_hz, message):
    with pytest.raises(FilterError, match=message):
        zero_phase(np.zeros(count), rate_hz)


def run_of(keep: np.ndarray | slice = slice(None)) -> Recording:
    time_s = np.arange(3000) * PERIOD_S
    angle = 0.5 * np.sin(2 * np.pi * time_s)
    return Recording(
        "r",
        time_s[keep],
        {
            "spindle_angle_rad": angle[keep],
            "motor_angle_rad": 35 * angle[keep],
            "motor_current_a": np.cos(2 * np.pi * time_s)[keep],
        },
    )


@pytest.mark.parametrize(("rate_hz", "fix"), [(0.25, "unit of time_s"), (80.0, "cutoff_hz = 16 ")])
def test_a_cutoff_far_above_the_rate_is_a_wrong_clock(rate_hz, fix):
    with pytest.raises(FilterError) as error:
        zero_phase(np.zeros(100), rate_hz, LowPass(cutoff_hz=50.0, order=3))
    assert fix in error.value.fix


def test_every_channel_of_a_recording_gets_the_same_filter():
    rows = np.random.default_rng(0).normal(size=2000)
    run = Recording("r", np.arange(2000) * PERIOD_S, {"fsr_v": rows, "motor_current_a": 3 * rows})
    filtered = filter_recording(run, LowPass(20.0))
    assert filtered["motor_current_a"] == pytest.approx(3 * filtered["fsr_v"])
    assert filtered["fsr_v"].std() < 0.3 * rows.std()


def test_flags_spread_over_what_the_filter_smears():
    run = run_of().with_stretch(Stretch(1.0, 1.1, Flag.SATURATED, "clipped"))
    flagged = np.flatnonzero(~filter_recording(run).valid)
    assert (flagged[0], flagged[-1]) == (980, 1120)


def test_lost_and_missing_samples_are_bridged():
    keep = np.ones(3000, bool)
    keep[1000:1010] = False
    whole, gappy = filter_recording(run_of()), filter_recording(run_of(keep=keep))
    assert len(gappy) == 2990
    assert gappy["spindle_angle_rad"] == pytest.approx(whole["spindle_angle_rad"][keep], abs=2e-4)
    broken = run_of().with_columns(
        spindle_angle_rad=np.where(keep, run_of()["spindle_angle_rad"], np.nan)
    )
    with pytest.raises(FilterError, match="carry no flag"):
        filter_recording(broken)
    flagged = broken.with_stretch(Stretch(1.0, 1.0091, Flag.MISSING, "lost"))
    bridged = filter_recording(flagged)
    assert bridged["spindle_angle_rad"] == pytest.approx(whole["spindle_angle_rad"], abs=2e-4)


JUMPS = np.concatenate([np.arange(100), 1e6 + np.arange(100)]) * PERIOD_S
JITTERS = np.arange(200) * 0.004
JITTERS[50:150:7] += 0.0025


@pytest.mark.parametrize(
    ("time_s", "why", "fix"),
    [
        (JUMPS, "200 samples span", "Split the run at the jump."),
        (JITTERS, "15 steps are shorter than half a period of 4 ms", "even_rate_hz = 250 under"),
    ],
)
def test_a_clock_that_jumps_is_to_be_cut_and_one_that_jitters_to_be_made_even(time_s, why, fix):
    with pytest.raises(FilterError, match="does not tick evenly") as error:
        filter_recording(Recording("r", time_s, {"fsr_v": np.zeros(200)}))
    assert why in error.value.why
    assert fix in error.value.fix


@pytest.mark.parametrize("seed", range(4))
def test_a_clock_of_its_own_that_jitters_is_even(seed):
    random = np.random.default_rng(seed)
    count = 14_000
    skew = 1.0 + 1e-4 * random.uniform(-1.0, 1.0)
    time_s = np.arange(count) * PERIOD_S * skew + 2e-5 * random.uniform(-1.0, 1.0, count)
    run = Recording("r", time_s, {"fsr_v": random.normal(size=count)})
    assert np.array_equal(run.ticks, np.arange(count))
    assert len(filter_recording(run)) == count


WANTED = ["motor_velocity_rad_s", "spindle_acceleration_rad_s2", "gearbox_differential_rad"]
WANTED_LIVE = [*WANTED, "spindle_travel_rad"]


@pytest.mark.parametrize(
    ("source", "tolerance"), [(zero_phase_channels, 1e-3), (causal_channels, 0.07)]
)
def test_derived_channels_are_the_derivatives(source, tolerance):
    found = source(run_of(), WANTED)
    w, t = 2 * np.pi, found.time_s
    for name, true, size in (
        ("motor_velocity_rad_s", 35 * 0.5 * w * np.cos(w * t), 110),
        ("spindle_acceleration_rad_s2", -0.5 * w**2 * np.sin(w * t), 20),
    ):
        assert np.abs(found[name] - true)[200:-200].max() < tolerance * size
    assert found["gearbox_differential_rad"] == pytest.approx(np.zeros(3000), abs=1e-9)


@settings(max_examples=30)
@given(
    cuts=st.lists(st.integers(0, 500), max_size=8), seed=st.integers(0, 5), tracked=st.booleans()
)
def test_causal_channels_do_not_care_how_samples_are_cut(cuts, seed, tracked):
    random = np.random.default_rng(seed)
    steps = random.choice([1, 2, 7, 400], size=500, p=[0.9, 0.05, 0.04, 0.01])
    time_s = np.cumsum(steps) * PERIOD_S
    angle = np.cumsum(random.normal(size=500))
    angle[random.integers(0, 500, 10)] = np.nan
    run = {"motor_angle_rad": angle, "spindle_angle_rad": angle / 7}
    whole = CausalChannels(WANTED_LIVE, RATE_HZ, tracked=tracked).step(time_s, run)
    stepper = CausalChannels(WANTED_LIVE, RATE_HZ, tracked=tracked)
    pieces = [
        stepper.step(time_s[part], {name: values[part] for name, values in run.items()})
        for part in np.split(np.arange(500), sorted(cuts))
    ]
    for name in WANTED_LIVE:
        joined = np.concatenate([piece[name] for piece in pieces])
        np.testing.assert_array_equal(joined, whole[name])
        assert np.array_equal(np.isnan(joined), np.isnan(angle))


def test_a_lost_sample_makes_no_spike_and_a_long_silence_starts_anew():
    keep = np.ones(3000, bool)
    keep[1000:1003] = False
    whole, gappy = causal_channels(run_of(), WANTED), causal_channels(run_of(keep=keep), WANTED)
    speeds = [r["motor_velocity_rad_s"] for r in (whole, gappy)]
    assert speeds[1] == pytest.approx(speeds[0][keep], abs=0.1)
    keep[1000:1600] = False
    after = causal_channels(run_of(keep=keep), WANTED)["motor_velocity_rad_s"]
    assert after[1000] == 0.0
    assert after[1100:] == pytest.approx(speeds[0][1700:], abs=0.1)


SPEED = ["motor_velocity_rad_s"]


def test_the_tracker_gives_what_filterpy_gives():
    motion = 0.4 * np.sin(np.linspace(0, 6, 400)) + np.random.default_rng(0).normal(0, 1e-3, 400)
    design, compiled = steady_filter(1000.0), tracker(1000.0)
    design.x = np.array([[motion[0]], [0.0], [0.0]])
    expected = []
    for angle in motion:
        design.predict()
        design.update(np.array([[angle]]))
        expected.append(design.x[:, 0].copy())
    found = compiled.track(motion, compiled.start(motion[0]))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("rate_hz", [500.0, 1000.0, 2000.0])
def test_an_even_rise_of_the_acceleration_is_followed_with_the_stated_lag(rate_hz):
    found = tracker(rate_hz)
    time_s = np.arange(round(rate_hz)) / rate_hz
    jerk = 300.0
    tracked = found.track(jerk * time_s**3 / 6, found.start(0.0))
    lag_s = time_s[-1] - tracked[-1, 2] / jerk
    assert lag_s == pytest.approx(found.acceleration_lag_s, rel=1e-3)
    assert 0.002 < lag_s < 0.02


def test_tracked_channels_follow_the_motion():
    true = np.gradient(run_of()["motor_angle_rad"], PERIOD_S)
    better, worse = (
        np.abs(causal_channels(run_of(), SPEED, tracked=tracked)[SPEED[0]] - true)[500:].max()
        for tracked in (True, False)
    )
    assert better < min(0.2, worse)
