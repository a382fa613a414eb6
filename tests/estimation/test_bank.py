"""Estimates from products of physical states: what they are, what they claim, how they adapt."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.bank.fitting import Normal, Pool, Settings, Shape, solve
from estimation.bank.interval import covered_share
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.closing import closing_samples, processed
from estimation.estimator import load
from estimation.estimators.adaptation import adapted, evidence
from estimation.estimators.bank import BankEstimator, BankRecipe
from estimation.estimators.instrument import InstrumentError
from estimation.networks.network import NetworkError
from estimation.recording import Instrument, Recording
from tests.estimation import synthetic

TARGET = "proximal_torque_n_m"
BANK = Bank("motor_current_a")


def closing_error(estimator: BankEstimator, run: Recording, causal: bool = False) -> np.ndarray:
    estimates = estimator.estimate(run, causal)
    table = processed(run, [TARGET]).with_columns(
        estimate_n_m=estimates.value, width_n_m=estimates.half_width
    )
    kept = closing_samples(table)
    return np.array([kept["estimate_n_m"] - kept[TARGET], kept["width_n_m"]])


def closing_rms(estimator: BankEstimator, run: Recording, causal: bool = False) -> float:
    return float(np.sqrt(np.mean(closing_error(estimator, run, causal)[0] ** 2)))


def test_a_run_s_own_offset_does_not_bend_the_slope():
    draw = np.random.default_rng(0)
    runs = []
    for offset, centre in ((5.0, 3.0), (-5.0, -3.0), (0.0, 0.0)):
        x = centre + draw.normal(size=400)
        design = np.column_stack([np.ones(400), x])
        runs.append(Normal.of(design, (2 * x + offset)[:, None]))
    plain, mixed = (
        solve(Pool.of(runs), Shape.plain(2), Settings(ridge=1e-9, offset_share=share))[1, 0]
        for share in (0.0, 0.99)
    )
    assert abs(plain - 2) > 1
    assert mixed == pytest.approx(2, abs=0.2)


def test_its_interval_holds_on_a_run_it_has_not_seen(runs):
    inside = []
    for k in (0, 4, 8):
        rest = [run for j, run in enumerate(runs) if j != k]
        error, width = closing_error(BankRecipe(TARGET, BANK).fit(Campaign.of(rest)), runs[k])
        inside.append(np.abs(error) <= width)
        assert np.all(width > 0)
    assert np.concatenate(inside).mean() > 0.8


def test_an_interval_looks_beyond_the_levels_that_were_fitted():
    # the zero bends with the frequency, which no state shows
    levels = [0.2 + 0.1 * f for f in range(6)]
    known = [
        synthetic.run(
            f"{f:.1f} {load}", f, load, seed=k, seconds=6.0, offset_n_m=0.2 * (f - 0.45) ** 2
        )
        for k, (f, load) in enumerate((f, load) for f in levels for load in (0.05, 0.1))
    ]
    rest = [run for run in known if run.conditions["frequency_hz"] < 0.65]
    silent = [replace(run, conditions={}) for run in rest]
    plain, looking = (BankRecipe(TARGET, BANK).fit(Campaign.of(part)) for part in (silent, rest))
    np.testing.assert_array_equal(plain.weights, looking.weights)
    shares = []
    for estimator in (plain, looking):
        errors = np.hstack([closing_error(estimator, run) for run in known[-2:]])
        shares.append(np.mean(np.abs(errors[0]) <= errors[1]))
    assert shares[1] > shares[0]


def test_no_interval_is_stated_at_a_second_level_of_a_condition_fitted_at_one(runs, tmp_path):
    one = [r for r in runs if r.conditions["frequency_hz"] == runs[0].conditions["frequency_hz"]]
    again = [replace(run, name=f"again {run.name}") for run in one]
    BankRecipe(TARGET, BANK).fit(Campaign.of([*one, *again])).save(tmp_path / "one.npz")
    fitted = BankEstimator.load(tmp_path / "one.npz")
    (other, *_) = [r for r in runs if r not in one]
    assert np.isfinite(fitted.estimate(one[0]).half_width).any()
    assert np.isfinite(fitted.estimate(replace(other, conditions={})).half_width).any()
    assert np.isnan(fitted.estimate(other).half_width).all()
    assert np.isfinite(fitted.estimate(other).value).all()
    both = BankRecipe(TARGET, BANK).fit(Campaign.of(runs))
    slow = replace(other, conditions={**other.conditions, "frequency_hz": 0.01})
    assert np.isfinite(both.estimate(slow).half_width).any()


def test_no_interval_is_stated_at_rest_opening_far_away_or_on_another_instrument(states, runs):
    speed = processed(runs[1], [])["spindle_velocity_rad_s"]
    found = states.estimate(runs[1])
    assert np.isnan(found.half_width[speed < 0.05]).all()
    assert np.isfinite(found.half_width[speed > 0.3]).mean() > 0.9
    assert found.inside[speed > 0.3].mean() > 0.9
    far = runs[1].with_columns(motor_current_a=runs[1]["motor_current_a"] + 5)
    for unknown in (states.estimate(far), states.for_any_instrument().estimate(runs[1])):
        assert np.isnan(unknown.half_width).all()
        assert not unknown.inside.any()


def test_live_fits_have_a_target_without_lag(runs):
    live = BankRecipe(TARGET, BANK, causal=True).fit(Campaign.of(runs[1:]))
    assert closing_rms(live, runs[0], causal=True) < 0.01


def test_another_instrument_is_refused_unless_allowed(runs):
    own, other = Instrument(model="Maryland", serial="1"), Instrument(model="Maryland", serial="2")
    mine = [replace(run, instrument=own) for run in runs[1:5]]
    fitted = BankRecipe(TARGET, BANK).fit(Campaign.of(mine))
    assert fitted.instrument == "Maryland 1"
    foreign = replace(runs[0], instrument=other)
    with pytest.raises(InstrumentError, match="fitted on Maryland 1"):
        fitted.predict(foreign)
    again = replace(runs[0], instrument=replace(own, mounting="2"))
    with pytest.raises(InstrumentError, match=r"Maryland 1 \(mounting 2\)"):
        fitted.predict(again)
    np.testing.assert_array_equal(
        fitted.for_any_instrument().predict(foreign),
        fitted.predict(replace(foreign, instrument=own)),
    )


def test_one_run_adapts_it_to_an_instrument_of_another_zero_and_spring(states, runs):
    def other(run: Recording) -> Recording:
        angle = run["spindle_angle_rad"]
        return run.with_columns(**{TARGET: run[TARGET] + 0.02 + 0.03 * angle})

    one = evidence(states, other(runs[1]))
    new = adapted(states, [one])
    assert closing_rms(new, other(runs[6])) < 0.5 * closing_rms(states, other(runs[6]))
    # a run of one load does not make it surer of itself, and less so at the other loads
    assert (new.interval.beyond.values >= states.interval.beyond.values).all()
    assert new.interval.least >= states.interval.least
    found = new.of_rows(one.rows)
    assert covered_share(found.value - one.truth, found.half_width) > 0.99
    width = closing_error(new, other(runs[6]))[1]
    assert np.isfinite(width).mean() > 0.8
    assert np.nanmin(width) > 0
    with pytest.raises(NetworkError, match="No closing samples"):
        adapted(states, [])


def test_an_instrument_far_from_the_source_gets_a_wide_interval_away_from_its_run(states, runs):
    """One run cannot show how wrong the estimate is elsewhere; the source's error there can."""

    def other(run: Recording, more: float) -> Recording:
        return run.with_columns(**{TARGET: run[TARGET] + more * run["motor_current_a"]})

    widths = []
    for more in (0.0, 5.0):
        new = adapted(states, [evidence(states, other(runs[1], more))])
        widths.append(np.nanmean(closing_error(new, other(runs[6], more))[1]))
    assert widths[1] > widths[0]


def moved(run: Recording, angle_rad: float) -> Recording:
    """Return a run as if it were made elsewhere along the travel."""
    return run.with_columns(spindle_angle_rad=run["spindle_angle_rad"] + angle_rad)


def test_a_run_at_other_angles_leaves_the_estimates_elsewhere_as_wrong_as_before(states, runs):
    def other(run: Recording) -> Recording:
        return run.with_columns(**{TARGET: run[TARGET] + 0.02})

    new = adapted(states, [evidence(states, other(moved(runs[1], -1.3)))])
    for angle_rad in (0.0, 1.3):
        run = other(moved(runs[6], angle_rad))
        assert closing_rms(new, run) < 1.5 * closing_rms(states, run)


def test_no_interval_is_stated_at_angles_that_no_run_had(states, runs):
    closing = processed(runs[1], [])["spindle_velocity_rad_s"] > 0.3
    far = runs[1]["spindle_angle_rad"] + 1.0 > 0.9
    width = states.estimate(moved(runs[1], 1.0)).half_width
    assert np.isnan(width[far]).all()
    assert np.isfinite(width[closing & ~far]).mean() > 0.5


def test_an_estimate_beyond_the_fitted_angles_is_that_at_the_nearest_one(states, runs):
    """A polynomial of the angle, carried on, would grow to many times the largest torque."""
    low, high = states.ranges[:, 0]
    rows = np.random.default_rng(0).uniform(*states.ranges, (20, BANK.judged))
    rows = np.hstack([rows, np.zeros((20, len(BANK.channels) - BANK.judged))])
    for far, near in ((high + 3.0, high), (low - 3.0, low)):
        there, here = rows.copy(), rows.copy()
        there[:, 0], here[:, 0] = far, near
        found = states.of_rows(there)
        np.testing.assert_array_equal(found.value, states.of_rows(here).value)
        assert not found.inside.any()
        assert np.isnan(found.half_width).all()


def test_a_file_of_an_older_version_and_a_damaged_one_are_refused(states, tmp_path, monkeypatch):
    path = tmp_path / "e.npz"
    with monkeypatch.context() as older:
        older.setattr(BankEstimator, "SCHEMA", "rig.bank/1")
        states.save(path)
    with pytest.raises(NetworkError, match=r"rig\.bank/1, not rig\.bank/.*rig fit"):
        load(path)
    states.save(path)
    with np.load(path) as content:
        arrays = {name: content[name] for name in content.files if name != "ranges"}
    np.savez(path, **arrays)
    with pytest.raises(NetworkError, match="holds no state estimator"):
        BankEstimator.load(path)
    with pytest.raises(NetworkError, match="weights"):
        replace(states, weights=states.weights[:-1])
    with pytest.raises(NetworkError, match="No closing samples"):
        BankRecipe(TARGET, BANK).fit(Campaign(()))
