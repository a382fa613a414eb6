"""FSR curves: the paper's cubic recovered, its range kept, bad data refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.fsr import FsrRun, fit_fsr, hysteresis_ratio, measure_creep
from calibration.fsr_curve import ZHANG_2022, FsrCurve, FsrRangeError
from calibration.quality import BadDataError


def press(seed, *, noise_n=0.005, top_v=0.98, width_n=0.0):
    """A run that loads and unloads slowly; force on loading is `width_n` above unloading."""
    rng = np.random.default_rng(seed)
    time = np.arange(400) * 0.01
    phase = np.pi * (time / time[-1])
    volts = top_v * rng.uniform(0.97, 1.0) * np.sin(phase) ** 2
    force = ZHANG_2022.force_n(volts) + width_n * np.cos(phase) * np.sin(phase)
    return FsrRun(f"press {seed}", time, volts, force + rng.normal(0, noise_n, 400))


def presses(count=6, **changes):
    return [press(seed, **changes) for seed in range(count)]


def kept(run, samples):
    return FsrRun(run.name, run.time_s[samples], run.fsr_v[samples], run.force_n[samples])


def test_the_papers_cubic_is_recovered_with_its_degree():
    result = fit_fsr(presses())
    error = np.abs(np.subtract(result.curve.coefficients, [0.105, 2.57, -4.63, 3.71]))
    deviation = np.sqrt(np.diag(result.curve.fit.covariance))
    assert (error < np.minimum(5 * deviation, 0.1)).all()
    assert result.held_out_rmse_n[3] < result.held_out_rmse_n[2]
    assert result.curve.fit.residual_rms == pytest.approx(0.005, rel=0.1)


def test_the_force_at_zero_can_be_held():
    curve = fit_fsr(presses(), degree=3, force_at_zero_n=0.105).curve
    assert curve.coefficients[0] == 0.105
    assert np.array(curve.fit.covariance)[0].tolist() == [0, 0, 0, 0]
    low, high = curve.interval_n(0.5)
    assert low < ZHANG_2022.force_n(0.5) < high


@pytest.mark.parametrize("volts", [-0.001, 1.001, np.nan])
def test_the_papers_cubic_is_refused_outside_0_to_1_v(volts):
    with pytest.raises(FsrRangeError, match=r"outside 0 \.\. 1 V"):
        ZHANG_2022.force_n([0.5, volts])


def test_a_curve_is_good_for_the_voltages_it_was_fitted_on():
    pressed = [kept(run, run.fsr_v > 0.2) for run in presses(top_v=0.6)]
    curve = fit_fsr(pressed).curve
    volts = np.concatenate([run.fsr_v for run in pressed])
    assert (curve.low_v, curve.high_v) == (volts.min(), volts.max())
    curve.force_n(volts)
    for outside in (0.19, 0.61):
        with pytest.raises(FsrRangeError):
            curve.force_n(outside)


@settings(max_examples=10)
@given(st.integers(100, 10_000))
def test_new_forces_lie_in_the_interval_as_often_as_it_says(seed):
    curve = fit_fsr(presses(), degree=3).curve
    new = press(seed, top_v=0.9)
    low, high = curve.interval_n(np.clip(new.fsr_v, curve.low_v, curve.high_v))
    assert np.mean((new.force_n >= low) & (new.force_n <= high)) > 0.93


def test_hysteresis_is_measured():
    assert hysteresis_ratio(presses()) < 0.01
    # loading is above unloading by width * sin(2 phase), at most by the width; the span is 1.7 N
    assert hysteresis_ratio(presses(width_n=0.2)) == pytest.approx(0.2 / 1.7, rel=0.25)
    one_way = [kept(run, slice(200)) for run in presses(noise_n=0.0)]
    assert hysteresis_ratio(one_way) is None


def test_creep_is_measured_by_the_decade():
    rng = np.random.default_rng(1)
    time = np.geomspace(1.0, 1000.0, 500)
    volts = 0.4 * (1 + 0.05 * np.log10(time)) + rng.normal(0, 1e-4, 500)
    hold = FsrRun("hold", time, volts, np.full(500, 2.0))
    creep = measure_creep(hold, 1.0)
    assert creep.rate == pytest.approx(0.05, abs=4 * creep.standard_error)
    slipping = replace(hold, force_n=np.linspace(2.0, 1.8, 500))
    with pytest.raises(BadDataError, match="constant force"):
        measure_creep(slipping, 1.0)
    with pytest.raises(BadDataError, match="decade"):
        measure_creep(hold, 150.0)


def changed(change):
    return [change(run) for run in presses()]


@pytest.mark.parametrize(
    ("runs", "rule"),
    [
        (presses(2), "points"),
        (changed(lambda r: replace(r, fsr_v=np.full(400, 0.3))), "no_change"),
        (changed(lambda r: replace(r, force_n=np.zeros(400))), "no_change"),
        (changed(lambda r: replace(r, fsr_v=np.minimum(1.3 * r.fsr_v, 1.0))), "saturated"),
        (changed(lambda r: replace(r, fsr_v=np.minimum(r.fsr_v, 0.7))), "clipped"),
        (changed(lambda r: replace(r, force_n=np.minimum(r.force_n, 1.0))), "clipped"),
        (changed(lambda r: replace(r, fsr_v=np.where(r.fsr_v > 0.5, 0.9, 0.1)
                                   + 1e-3 * r.fsr_v)), "levels"),
        (presses(width_n=0.5), "hysteresis"),
        (changed(lambda r: replace(r, force_n=-r.force_n)), "not_monotone"),
        ([*presses(5), replace(press(9), force_n=press(9).force_n + 0.2)], "drift"),
    ],
)  # fmt: skip
def test_bad_data_is_refused_with_the_reason(runs, rule):
    with pytest.raises(BadDataError) as refusal:
        fit_fsr(runs)
    assert refusal.value.rule == rule


def test_a_curve_that_falls_is_refused():
    with pytest.raises(BadDataError, match="falls somewhere"):
        FsrCurve((0.0, 1.0, -1.0), 0.0, 1.0)
