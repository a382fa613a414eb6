"""Estimates from products of physical states: what they are, what they claim, how they adapt."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from estimation.bank.beyond import coordinates
from estimation.bank.edges import edges
from estimation.bank.fitting import AS_GOOD, CHOICES, Normal, Pool, Settings, Shape, chosen, solve
from estimation.bank.states import EFFECTS, NEUTRAL, POSED, RIPPLE, STATES, Bank, closed
from estimation.campaign import Campaign
from estimation.closing import closing_samples, processed
from estimation.derived import ago_of, causal_channels, fall_of, rise_of, zero_phase_channels
from estimation.estimator import load
from estimation.estimators.adaptation import adapted, evidence
from estimation.estimators.bank import (
    BankEstimator,
    BankRecipe,
    rows_of,
)
from estimation.estimators.instrument import InstrumentError
from estimation.estimators.network import NetworkEstimator
from estimation.networks.network import Network, NetworkError
from estimation.recording import Instrument, Recording
from tests.estimation.synthetic import campaign
from tests.estimation.synthetic import run as synthetic_run

TARGET = "proximal_torque_n_m"
BANK = Bank("motor_current_a")


@pytest.fixture(scope="module")
def runs() -> list[Recording]:
    return list(campaign())


@pytest.fixture(scope="module")
def fitted(runs) -> BankEstimator:
    return BankRecipe(TARGET, BANK).fit(Campaign.of(runs[1:]))


def closing_error(estimator: BankEstimator, run: Recording) -> np.ndarray:
    estimates = estimator.estimate(run)
    table = processed(run, [TARGET]).with_columns(
        estimate_n_m=estimates.value, width_n_m=estimates.half_width
    )
    kept = closing_samples(table)
    return np.array([kept["estimate_n_m"] - kept[TARGET], kept["width_n_m"]])


@pytest.mark.parametrize("pose", ["", "wrist_roll_rad"])
@pytest.mark.parametrize("turned_s", [0.2, 0.45, 0.499])
def test_a_design_is_its_products_of_states_and_its_series_in_the_angle(turned_s, pose):
    bank, p = Bank("motor_current_a", pose), 0.7 if pose else 0.0
    past = [0.2, 0.21, 0.22, 0.23, 0.24, 0.25, 0.26, 0.27]
    pushes = [100.0, 200.0, 300.0, 400.0, -100.0, -200.0, -300.0, -400.0]
    now = [-0.2, 0.3, 42.0, 500.0, *([p] if pose else [])]
    row = np.array([[*now, 2.5, turned_s, 0.05, 0.1, *past, *pushes]])
    q, c = (-0.2 + 0.5) / 0.5, 0.3 / 0.21 - 1
    v, a, i, d = 42 / 35 - 1, 0.5, 35 / 42, 0.05 / 0.21
    t = 2.5 + 20 * max(turned_s - 0.4, 0) / 0.1  # a turn about to leave the window was long ago
    k = [min(t / r, 1) - 0.5 for r in (1, 2, 3, 4)]
    n = [min(t / (r * 0.3 / 0.21), 1) - 0.5 for r in (1, 2, 3)]
    h = [0.1 / 0.21 * max(1 - t / r, 0) for r in (2, 4)]
    lags = [load / 0.21 - 1 for load in past] + [push / 1000 for push in pushes]
    values = [q, c, v, a, i, d, *k, *n, p, *h, *lags]
    state = dict(zip(STATES, values, strict=True))
    design = bank.design(row)[0]
    for product, value in zip(bank.products, design, strict=False):
        assert value == pytest.approx(np.prod([state[name] for name in product]), abs=1e-12)

    def series(orders: int, turn: float, amplitudes: list[float]) -> list[float]:
        return [
            amplitude * part
            for order in range(1, orders + 1)
            for amplitude in amplitudes
            for part in (np.sin(order * turn), np.cos(order * turn))
        ]

    ripple = series(bank.orders, 35 * 0.17 * -0.2, [1.0, c, v])
    wrist = series(bank.wrist_orders, 2 * np.pi / 3.3 * -0.2, [p**power for power in range(5)])
    np.testing.assert_allclose(design[len(bank.products) :], ripple + wrist, atol=1e-12)
    assert len(bank.shape.stiffness) == len(design) == bank.size


def test_products_come_after_what_they_are_made_of_and_an_effect_goes_with_all_its_products():
    products = closed([*NEUTRAL, *POSED])
    assert len(set(products)) == len(products)
    for place, product in enumerate(products[1:], start=1):
        assert product[:-1] in products[:place]
    for effect, states in EFFECTS.items():
        bank = Bank(without=(effect,))
        assert not any(set(states) & set(product) for product in bank.products)
        assert (bank.orders == 0) == (effect == RIPPLE)


def test_the_fall_of_a_channel_is_what_it_lacks_to_its_highest_value_of_the_window(runs):
    name = fall_of("motor_current_a")
    assert name == "motor_current_fall_a"
    found = zero_phase_channels(runs[0], [name, "motor_current_a"])
    current = found["motor_current_a"]
    expected = [current[max(k - 499, 0) : k + 1].max() - current[k] for k in range(1500)]
    np.testing.assert_allclose(found[name][:1500], expected, atol=1e-12)


def test_the_rise_of_a_channel_counts_from_where_the_motor_was_lowest_and_ago_looks_back(runs):
    rise, ago = rise_of("motor_current_a"), ago_of("motor_current_a", 80)
    assert (rise, ago) == ("motor_current_rise_a", "motor_current_80ms_ago_a")
    push = "motor_acceleration_rad_s2"
    pushed = ago_of(push, 80)
    assert pushed == "motor_acceleration_80ms_ago_rad_s2"
    for source in (zero_phase_channels, causal_channels, partial(causal_channels, tracked=True)):
        names = [rise, ago, "motor_turned_s", "motor_current_a", "motor_angle_rad", push, pushed]
        found = source(runs[0], names)
        current, angle = found["motor_current_a"], found["motor_angle_rad"]
        turns = []
        for k in range(2000):
            window = angle[max(k - 499, 0) : k + 1]
            turns.append(k - int(np.argmin(window[::-1])))  # the last one of equal values
        places = np.arange(2000)
        np.testing.assert_allclose(found["motor_turned_s"][:2000], (places - turns) / 1000)
        np.testing.assert_allclose(found[rise][:2000], current[:2000] - current[turns])
        np.testing.assert_allclose(found[ago][:2000], current[np.maximum(places - 80, 0)])
        before = found[push][np.maximum(places - 80, 0)]
        np.testing.assert_allclose(found[pushed][100:2000], before[100:])


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


def test_the_means_of_runs_are_fitted_once_more_by_few_weights():
    draw = np.random.default_rng(0)
    runs = []
    for centre in (-2.0, -1.0, 1.0, 2.0):
        x = centre + draw.normal(size=(400, 1))
        design = np.column_stack([np.ones(400), x, x**2])
        runs.append(Normal.of(design, 2 * x + 3 * centre))
    shape = Shape(np.ones(3), np.array([0, 1]))
    alone, both = (
        solve(Pool.of(runs), which, Settings(ridge=1e-9, offset_share=0.99))[:, 0]
        for which in (Shape.plain(3), shape)
    )
    assert alone[1] == pytest.approx(2, abs=0.2)
    assert both[1] > 3  # the runs' means rise by 5 in 1
    assert both[2] == alone[2]


def test_a_nearly_constant_column_gets_no_weight():
    rng = np.random.default_rng(0)
    slope = rng.normal(size=400)
    design = np.column_stack([np.ones(400), slope, 0.5 + 1e-6 * rng.normal(size=400)])
    truth = 2.0 + 3.0 * slope + 0.01 * rng.normal(size=400)
    weights = solve(
        Pool.of([Normal.of(design, truth[:, None])]), Shape.plain(3), Settings(offset_share=0.0)
    )[:, 0]
    assert weights[2] == 0.0
    np.testing.assert_allclose(weights[:2], [2.0, 3.0], rtol=2e-3)


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
        synthetic_run(
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


def test_levels_count_where_they_were_varied_on_purpose():
    drift = [{"load_command_a": 0.1 * (k % 3), "zero_rad": 0.01 * k} for k in range(12)]
    found = edges(drift, 5)
    assert [list(at) for at in found] == [[0, 3, 6, 9], [2, 5, 8, 11]]
    assert (
        edges([{**held, "load_command_a": 0.1 * (k % 2)} for k, held in enumerate(drift)], 5) == []
    )
    assert edges([*drift, {}], 5) == []
    assert edges(drift, 9) == []
    assert edges([], 5) == []


def test_samples_beyond_what_was_fitted_are_told(fitted, runs):
    closing = processed(runs[1], [])["spindle_velocity_rad_s"] > 0.3
    assert fitted.estimate(runs[1]).inside[closing].mean() > 0.9
    far = runs[1].with_columns(motor_current_a=runs[1]["motor_current_a"] + 5)
    assert not fitted.estimate(far).inside.any()
    assert np.isnan(fitted.estimate(far).half_width).all()


def test_no_interval_is_stated_at_rest_opening_or_on_another_instrument(fitted, runs):
    speed = processed(runs[1], [])["spindle_velocity_rad_s"]
    found = fitted.estimate(runs[1])
    assert np.isnan(found.half_width[speed < 0.05]).all()
    assert np.isfinite(found.half_width[speed > 0.3]).mean() > 0.9
    anywhere = fitted.for_any_instrument().estimate(runs[1])
    assert np.isnan(anywhere.half_width).all()
    assert not anywhere.inside.any()


def test_an_interval_grows_on_the_way_out_of_the_fitted_loads(fitted, runs):
    (closing,) = np.nonzero(processed(runs[1], [])["spindle_velocity_rad_s"] > 0.5)
    widths = []
    for more_a in (0.0, 0.02, 0.04, 0.06):
        off = runs[1].with_columns(motor_current_a=runs[1]["motor_current_a"] + more_a)
        places = coordinates(BANK, rows_of(zero_phase_channels(off, BANK.channels), BANK))
        widths.append(np.nanmean(fitted.interval.beyond.at(places[closing])))
    assert widths == sorted(widths)
    assert widths[-1] > widths[0]


def test_live_fits_have_a_target_without_lag(runs):
    live = BankRecipe(TARGET, BANK, causal=True).fit(Campaign.of(runs[1:]))
    truth = processed(runs[0], [TARGET])
    both = closing_samples(truth.with_columns(estimate_n_m=live.predict(runs[0], causal=True)))
    assert np.sqrt(np.mean((both["estimate_n_m"] - both[TARGET]) ** 2)) < 0.01


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


def test_a_file_of_an_older_version_must_be_fitted_again(fitted, tmp_path, monkeypatch):
    monkeypatch.setattr(BankEstimator, "SCHEMA", "rig.bank/1")
    fitted.save(tmp_path / "old.npz")
    monkeypatch.undo()
    with pytest.raises(NetworkError, match=r"rig\.bank/1, not rig\.bank/") as refused:
        load(tmp_path / "old.npz")
    assert "rig fit" in refused.value.fix


def test_a_network_refuses_another_instrument_too_also_after_loading(runs, tmp_path):
    own, other = Instrument(model="Maryland", serial="1"), Instrument(model="Maryland", serial="2")
    inputs, bounds = ("spindle_angle_rad", "motor_current_a"), np.array([[0.0, 0.0], [1.0, 1.0]])
    hidden, output = np.ones((2, 3)), np.ones((1, 3))
    network = Network(inputs, (TARGET,), bounds, np.array([[0.0], [1.0]]), hidden, output)
    NetworkEstimator(network, instrument="Maryland 1").save(tmp_path / "net.npz")
    kept = load(tmp_path / "net.npz")
    assert isinstance(kept, NetworkEstimator)
    assert np.isfinite(kept.predict(replace(runs[0], instrument=own))).all()
    with pytest.raises(InstrumentError, match="recording is of Maryland 2"):
        kept.predict(replace(runs[0], instrument=other))
    assert np.isfinite(kept.for_any_instrument().predict(replace(runs[0], instrument=other))).all()


def test_a_node_that_barely_varies_in_the_adaptation_keeps_its_weight(runs):
    draw = np.random.default_rng(0)
    inputs, bounds = ("spindle_angle_rad", "motor_current_a"), np.array([[-0.7, -0.2], [0.7, 0.5]])
    hidden = draw.normal(size=(4, 3))
    hidden[0] = [1e-3, 0.0, 1.0]  # all but constant
    target = np.array([[-0.1], [0.4]])
    source = NetworkEstimator(
        Network(inputs, (TARGET,), bounds, target, hidden, draw.normal(size=(1, 5)))
    )
    found = evidence(source, runs[0])
    assert found is not None
    moved = adapted(source, [found])
    assert isinstance(moved, NetworkEstimator)
    change = np.abs(moved.network.output - source.network.output)[0]
    assert change[0] < 0.3 * change.max()


def test_settings_are_chosen_by_runs_left_out(runs):
    bank = Bank("motor_current_a")
    recipe = BankRecipe(TARGET, bank)
    found = [run for run in map(recipe.evidence_of, runs) if run is not None]
    parts = [[run.normal for run in found[k::3]] for k in range(3)]
    whole, folds = Pool.of([n for part in parts for n in part]), [Pool.of(p) for p in parts]

    def error(settings: Settings) -> float:
        total = 0.0
        for k in range(3):
            rest = [run.normal for j in range(3) if j != k for run in found[j::3]]
            weights = solve(Pool.of(rest), bank.shape, settings)[:, 0]
            total += sum(float(np.sum((r.design @ weights - r.truth) ** 2)) for r in found[k::3])
        return total

    errors = [error(settings) for settings in CHOICES]
    first = next(k for k, value in enumerate(errors) if value <= AS_GOOD * min(errors))
    assert chosen(whole, folds, bank.shape) == CHOICES[first]


def test_one_run_adapts_it_to_an_instrument_of_another_zero_and_spring(fitted, runs):
    def other(run: Recording) -> Recording:
        angle = run["spindle_angle_rad"]
        return run.with_columns(**{TARGET: run[TARGET] + 0.02 + 0.03 * angle})

    one = evidence(fitted, other(runs[1]))
    assert one is not None
    new = adapted(fitted, [one])
    before, after = (
        np.sqrt(np.mean(closing_error(e, other(runs[6]))[0] ** 2)) for e in (fitted, new)
    )
    assert after < 0.5 * before
    assert isinstance(new, BankEstimator)
    assert new.interval is not None
    assert fitted.interval is not None
    # a run of one load does not make it surer of itself, and less so at the other loads
    assert (new.interval.beyond.values >= fitted.interval.beyond.values).all()
    assert new.interval.least >= fitted.interval.least
    assert one.covered(new).mean() > 0.99
    assert closing_error(new, other(runs[6]))[1].min() > 0
    with pytest.raises(NetworkError, match="No closing samples"):
        adapted(fitted, [])


def test_a_damaged_file_is_refused(fitted, tmp_path):
    path = tmp_path / "e.npz"
    fitted.save(path)
    with np.load(path) as content:
        arrays = {name: content[name] for name in content.files if name != "ranges"}
    np.savez(path, **arrays)
    with pytest.raises(NetworkError, match="holds no state estimator"):
        BankEstimator.load(path)
    with pytest.raises(NetworkError, match="weights"):
        replace(fitted, weights=fitted.weights[:-1])
    with pytest.raises(NetworkError, match="No closing samples"):
        BankRecipe(TARGET, BANK).fit(Campaign(()))
