"""What changed between calibrations of one sensor."""

from dataclasses import replace

import pytest

from calibration.history import MOST, changes, deviation, earlier_ones
from calibration.record import LINE, CalibrationRecord, Fit
from calibration.store import CalibrationStore


def record(day: int, slope: float = 1.0, spread: float = 0.01, **other) -> CalibrationRecord:
    fit = Fit(LINE, {"slope": slope, "zero": 100.0 * day}, ((spread**2, 0.0), (0.0, 1.0)))
    whole = {
        "kind": "torque",
        "channel": "proximal_torque_n_m",
        "input": "proximal",
        "made_at": f"2026-01-{day:02d}T00:00:00+00:00",
        "operator": "Ada",
        "fit": fit,
        "tared": True,
    }
    return CalibrationRecord(**{**whole, **other})


def test_the_latest_five_of_the_same_sensor_are_compared():
    stored = [record(day) for day in range(1, 9)]
    others = [
        record(3, channel="distal_torque_n_m"),
        record(3, instrument="0042"),
        record(3, kind="certificate"),
        record(20),
    ]
    found = earlier_ones(stored[-1], [*stored, *others])
    assert [one.made.day for one in found] == [7, 6, 5, 4, 3]
    assert len(found) == MOST


@pytest.mark.parametrize(("slope", "drifted"), [(1.0, False), (1.02, False), (1.05, True)])
def test_a_change_beyond_both_uncertainties_is_a_drift(slope, drifted):
    (change,) = changes(record(1), record(2, slope))
    assert change.parameter == "slope"
    assert change.drifted is drifted
    assert change.uncertainty == pytest.approx(2 * 0.01 * 2**0.5)


def test_the_zero_counts_where_it_is_not_measured_again():
    names = [c.parameter for c in changes(record(1, tared=False), record(2, tared=False))]
    assert names == ["slope", "zero"]


def test_without_an_uncertainty_nothing_is_called_a_drift():
    plain = replace(record(1), fit=Fit(LINE, {"slope": 5.0, "zero": 0.0}))
    (change,) = changes(plain, record(2))
    assert change.normalised_error is None
    assert not change.drifted


def test_a_stored_record_keeps_the_uncertainty_of_each_parameter(tmp_path):
    fit = Fit("current", {"slope": 1.0, "friction": 2.0}, ((0.25, 0.1), (0.1, 4.0)))
    store = CalibrationStore(tmp_path)
    kept = store.get(store.add(record(1, fit=fit)))
    assert {name: deviation(kept, name) for name in fit.parameters} == {
        "slope": 0.5,
        "friction": 2.0,
    }
