"""Torque sensors: the shunt against the certificate, weights on an arm, bad data refused."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.quality import BadDataError
from calibration.torque import Step, check_shunt, fit_torque, weight_torque_n_m

MASSES_KG = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0])
SLOPE, ZERO = 4e-5, 37.0
CERTIFICATE_V_V = 350.0 / (4 * 60_400.0 + 2 * 350.0)


def series(seed=0, *, bend=0.0, hysteresis_n_m=0.0, drift_counts=0.0):
    rng = np.random.default_rng(seed)
    torques = weight_torque_n_m(MASSES_KG, 0.05)
    way = np.where(torques > 0, np.where(np.diff(torques, prepend=0) < 0, 0.5, -0.5), 0.0)
    felt = torques + bend * torques * (torques.max() - torques) + hysteresis_n_m * way
    counts = felt / SLOPE + ZERO + np.linspace(0, drift_counts, len(torques))
    readings = np.round(counts[:, None] + rng.normal(0, 2.0, (len(counts), 400)))
    return [Step(float(t), row) for t, row in zip(torques, readings, strict=True)]


def shunted(gain=1.0):
    rest = np.random.default_rng(0).normal(10, 2, 500)
    return rest, rest[::-1] + gain * CERTIFICATE_V_V * 2e6


def test_a_healthy_sensor_passes_its_shunt_check():
    assert check_shunt(*shunted(), CERTIFICATE_V_V, 2e6) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("unloaded", "loaded", "rule"),
    [
        (shunted()[0], shunted()[0], "no_change"),
        (shunted()[0], np.full(500, 32767.0), "saturated"),
        (shunted()[0] + np.linspace(0, 50, 500), shunted()[1], "not_steady"),
        (shunted()[0][:50], shunted()[1], "points"),
        (shunted()[0], np.full(500, np.nan), "points"),
        (*shunted(gain=0.97), "shunt"),
    ],
)
def test_a_bad_shunt_check_is_refused(unloaded, loaded, rule):
    with pytest.raises(BadDataError) as refusal:
        check_shunt(unloaded, loaded, CERTIFICATE_V_V, 2e6)
    assert refusal.value.rule == rule


def test_the_line_is_recovered_and_its_covariance_is_right():
    fits = [fit_torque(series(seed)).fit for seed in range(200)]
    estimates = np.array([(fit.parameters["slope"], fit.parameters["zero"]) for fit in fits])
    assert estimates.mean(axis=0) == pytest.approx([SLOPE, ZERO], rel=1e-3)
    stated = np.mean([np.array(fit.covariance) for fit in fits], axis=0)
    measured = np.cov(estimates.T)
    np.testing.assert_allclose(np.diag(stated), np.diag(measured), rtol=0.35)
    assert np.sign(stated[0, 1]) == np.sign(measured[0, 1])


def test_hysteresis_and_drift_are_measured():
    span = series()[5].torque_n_m
    loose, drifting = series(hysteresis_n_m=0.008 * span), series(drift_counts=20.0)
    assert fit_torque(loose).hysteresis == pytest.approx(0.008, abs=0.001)
    assert fit_torque(drifting).drift == pytest.approx(20 * SLOPE / span, abs=0.001)


@pytest.mark.parametrize(
    ("steps", "rule"),
    [
        (series()[:4], "points"),
        ([replace(s, torque_n_m=float(k % 2)) for k, s in enumerate(series())], "levels"),
        ([replace(s, counts=series()[0].counts) for s in series()], "no_change"),
        ([replace(s, counts=np.minimum(8 * s.counts, 32767)) for s in series()], "saturated"),
        ([replace(s, counts=s.counts + np.linspace(0, 30, 400)) for s in series()], "not_steady"),
        (series(bend=0.8), "not_linear"),
        (series(hysteresis_n_m=0.01), "hysteresis"),
        (series(drift_counts=100.0), "drift"),
    ],
)
def test_bad_data_is_refused_with_the_reason(steps, rule):
    with pytest.raises(BadDataError) as refusal:
        fit_torque(steps)
    assert refusal.value.rule == rule
