"""FSR curves: the paper's cubic recovered, its range kept, bad data refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.fsr import FsrRun, fit_fsr, hysteresis_ratio, measure_creep
from calibration.fsr_curve import ZHANG_2022, FsrCurve, FsrRangeError
from calibration.quality import BadDataError

COEFFICIENTS = np.array([0.105, 2.57, -4.63, 3.71])


def press(seed, *, noise_n=0.005, top_v=0.98, width_n=0.0, n=400):
    """A run that loads and unloads slowly; force on loading is `width_n` above unloading."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.01
    phase = np.pi * (time / time[-1])
    volts = top_v * rng.uniform(0.97, 1.0) * np.sin(phase) ** 2
    force = np.polynomial.polynomial.polyval(volts, COEFFICIENTS)
    force += width_n * np.cos(phase) * np.sin(phase) + rng.normal(0, noise_n, n)
    return FsrRun(f"press {seed}", time, volts, force)


def presses(count=6, **changes):
    return [press(seed, **changes) for seed in range(count)]


def test_the_papers_cubic_is_recovered_with_its_degree():
    result = fit_fsr(presses())
    assert len(result.curve.coefficients) == 4
    error = np.array(result.curve.coefficients) - COEFFICIENTS
    deviation = np.sqrt(np.diag(result.curve.fit.covariance))
    assert (np.abs(error) < 5 * deviation).all()
    assert (np.abs(error) < 0.1).all()
    assert result.held_out_rmse_n[3] < result.held_out_rmse_n[2]
    assert result.curve.fit.residual_rms == pytest.approx(0.005, rel=0.1)


def test_the_force_at_zero_can_be_held():
    curve = fit_fsr(presses(), degree=3, force_at_zero_n=0.105).curve
    assert curve.coefficients[0] == 0.105
    assert np.array(curve.fit.covariance)[0].tolist() == [0, 0, 0, 0]
    low, high = curve.interval_n(0.5)
    assert low < ZHANG_2022.force_n(0.5) < high


@given(st.floats(0.0, 1.0))
def test_the_inverse_of_the_curve_is_its_inverse(volts):
    assert ZHANG_2022.fsr_v(ZHANG_2022.force_n(volts)) == pytest.approx(volts, abs=1e-9)


@pytest.mark.parametrize("volts", [-0.001, 1.001, np.nan])
def test_the_papers_cubic_is_refused_outside_0_to_1_v(volts):
    with pytest.raises(FsrRangeError, match=r"outside 0 \.\. 1 V"):
        ZHANG_2022.force_n([0.5, volts])
    with pytest.raises(FsrRangeError, match="N"):
        ZHANG_2022.fsr_v(1.7551)


def test_a_curve_is_good_for_the_voltages_it_was_fitted_on():
    pressed = [
        FsrRun(r.name, r.time_s[keep], r.fsr_v[keep], r.force_n[keep])
        for r in presses(top_v=0.6)
        for keep in [r.fsr_v > 0.2]
    ]
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
    inside = (new.force_n >= low) & (new.force_n <= high)
    assert inside.mean() > 0.93


def test_hysteresis_is_measured():
    assert hysteresis_ratio(presses()) < 0.01
    width = 0.2
    span = 1.7
    measured = hysteresis_ratio(presses(width_n=width))
    # loading is above unloading by width * sin(2 phase), at most by the width
    assert measured == pytest.approx(width / span, rel=0.25)
    one_way = [replace(r, time_s=r.time_s[:200], fsr_v=r.fsr_v[:200], force_n=r.force_n[:200])
               for r in presses(noise_n=0.0)]  # fmt: skip
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
