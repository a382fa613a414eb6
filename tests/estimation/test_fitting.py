"""Fitting a declared model, predicting with it, and running it live."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.cross_validation import held_out_error, live_half_width
from estimation.effects import effect
from estimation.estimators.model import Stream
from estimation.filters import LowPass
from estimation.fit_problem import FitError
from estimation.fitting import fit
from estimation.model import Estimate, Model, NotFittedError, Term, counted_error, predict
from estimation.model_file import read
from estimation.plant_models import declared
from estimation.recording import Flag, MissingChannelError, Recording, Stretch
from estimation.shape_search import descended
from estimation.within_bounds import solve_within
from tests.estimation.synthetic import TRUE, campaign, run
from tests.estimation.synthetic import runs as varied_runs
from tests.estimation.test_plant import SLIDE, slide

ONSET = {"onset": Estimate(0.082)}
"""Not quite where the stop is."""


def numbers(model: Model) -> dict[str, float]:
    return {name: e.value for term in model.terms for name, e in term.values.items()}


def test_a_declared_model_finds_the_true_parameters(motor):
    found = numbers(motor)
    assert {name: found[name] for name in TRUE} == pytest.approx(TRUE, rel=0.01)
    assert motor.is_fitted
    assert motor.evidence.rmse == pytest.approx(1e-3 * np.sqrt(2 * 50 / 1000), rel=0.2)
    assert len(motor.evidence.runs) == 9


def test_run_offsets_are_a_nuisance_only_when_declared(motor):
    together = fit(replace(read(Path("motor")), run_offsets=False), campaign(), bootstrap=0)
    assert together.evidence.rmse_with_means < motor.evidence.rmse_with_means
    assert abs(numbers(motor)["gain"] - 0.94) < abs(numbers(together)["gain"] - 0.94)
    assert numbers(together)["offset"] == pytest.approx(numbers(motor)["offset"], abs=2e-3)


def test_a_fit_is_repeatable_and_starts_from_known_shapes(motor):
    assert fit(read(Path("motor")), campaign()) == motor
    again = numbers(fit(motor, campaign(), bootstrap=0))
    assert again == pytest.approx(numbers(motor), rel=1e-3)


@pytest.mark.parametrize("constant", [0.012, -0.005])
def test_where_a_motor_turns_one_way_its_friction_has_the_whole_constant(constant):
    """The offset has it where it is not a friction; noise would decide their difference."""

    def ahead(one):
        speed = 30.0 + 10.0 * np.sin(one.time_s) + 5.0 * np.sin(2.7 * one.time_s)
        angle = np.cumsum(speed) / one.sample_rate_hz
        torque = 0.94 * one["motor_current_a"] - 4e-4 * speed - constant
        torque -= 2e-5 * np.gradient(speed, one.time_s)
        torque += np.random.default_rng(3).normal(0.0, 1e-3, len(one))
        return one.with_columns(motor_angle_rad=angle, proximal_torque_n_m=torque)

    runs = Campaign.of(ahead(one) for one in campaign().evidence)
    model = replace(read(Path("motor")), run_offsets=False)
    terms = {term.effect.id: term.values for term in fit(model, runs).terms}
    friction, offset = terms["friction.coulomb"]["friction"], terms["sensor.offset"]["offset"]
    which, none = (friction, offset) if constant > 0.0 else (offset, friction)
    assert abs(which.value) == pytest.approx(abs(constant), abs=2e-3)
    assert which.ci95 is not None
    assert (none.value, none.ci95) == (0.0, None)


def test_friction_never_comes_out_negative():
    runs = campaign(extra=lambda angle, speed, load: -8e-4 * speed)  # drives instead of braking
    damping = fit(read(Path("motor")), runs).terms[2].values["damping"]
    assert damping.value == 0.0
    assert damping.spread is None


def test_one_run_gives_values_without_spreads():
    model = fit(read(Path("motor")), Campaign.of([run("a", 0.3, 0.1, seed=1)]))
    assert numbers(model)["gain"] == pytest.approx(0.94, rel=0.01)
    assert all(e.spread is None for term in model.terms for e in term.values.values())


def test_excluded_runs_and_flagged_samples_do_not_count(motor):
    bad = run("bad", 0.3, 0.1, seed=1).with_columns(motor_current_a=np.full(8000, 9.0))
    good = list(campaign())
    broken = good[0].with_columns(
        motor_current_a=np.where(good[0].time_s > 7, 5.0, good[0]["motor_current_a"])
    )
    flagged = broken.with_stretch(Stretch(6.99, 8.0, Flag.SUSPECT, "runaway"))
    runs = Campaign.of([flagged, *good[1:], bad.exclude("for the test")])
    model = fit(read(Path("motor")), runs, bootstrap=0)
    assert numbers(model) == pytest.approx(numbers(motor), rel=0.02)
    assert "bad" not in model.evidence.runs


def test_collinear_columns_are_named():
    constant = Term(effect("motor.torque_constant"))
    twice = Model("twice", "motor", "proximal_torque_n_m", (constant, constant))
    with pytest.raises(FitError, match=r"motor\.torque_constant\.gain.* cannot be identified"):
        fit(twice, campaign())
    still = run("still", 0.3, 0.1, seed=1).with_columns(motor_current_a=np.zeros(8000))
    with pytest.raises(FitError, match="cannot be identified"):
        fit(read(Path("linear")), Campaign.of([still]))


def test_a_target_that_is_constant_is_refused():
    """All effects at zero fit it without error, which looks like a complete model."""
    stuck = [r.with_columns(proximal_torque_n_m=np.full(len(r), 0.12)) for r in campaign()]
    with pytest.raises(FitError, match=r"proximal_torque_n_m is constant at 0.12 N m.*connected"):
        fit(read(Path("motor")), Campaign.of(stuck))


def test_a_model_reports_what_is_missing(motor):
    recording = run("a", 0.3, 0.1, seed=1)
    with pytest.raises(NotFittedError, match="declared but not fitted"):
        predict(read(Path("motor")), recording)
    with pytest.raises(MissingChannelError, match="motor_angle_rad"):
        predict(motor, replace(recording, columns={"motor_current_a": recording.time_s}))


def test_prediction_needs_no_target_and_finds_the_torque(motor):
    recording = run("new", 0.27, 0.12, seed=99, noise_n_m=0.0, offset_n_m=0.02)
    truth = recording["proximal_torque_n_m"]
    seen = {name: recording[name] for name in ("motor_current_a", "motor_angle_rad")}
    blind = replace(recording, columns=seen)
    assert np.abs(predict(motor, blind) - truth)[100:-100].max() < 2e-3
    assert np.abs(predict(motor, blind, causal=True) - truth)[100:].max() < 2e-2


def test_live_takes_single_samples_and_gives_nan_where_an_input_is_lost(motor):
    recording = run("live", 0.4, 0.1, seed=5, seconds=0.1)
    current = recording["motor_current_a"].copy()
    current[50] = np.nan
    stream = Stream(motor, 1000.0)
    live = [
        stream.step(t, {"motor_current_a": i, "motor_angle_rad": a})
        for t, i, a in zip(recording.time_s, current, recording["motor_angle_rad"], strict=True)
    ]
    assert all(part.shape == (1,) for part in live)
    assert np.flatnonzero(np.isnan(np.concatenate(live))).tolist() == [50]


@pytest.mark.parametrize("seed", range(40))
def test_a_search_ends_where_the_error_changes_by_less_than_its_rounding(seed: int) -> None:
    random = np.random.default_rng(seed)

    def error(point):
        return float(abs(point[0] - 0.3) + 1e-6 * random.normal())

    (found,) = descended(error, [0.5], [1e-8], [(0.0, 1.0)])
    assert abs(found - 0.5) < 1e-6


def test_where_a_bound_is_active_the_others_are_the_best() -> None:
    random = np.random.default_rng(3)
    columns = random.normal(size=(400, 3))
    target = columns @ [1.0, -2.0, 3.0] + 0.5 * columns[:, 0]
    low, high = np.array([-9.0, 0.0, -9.0]), np.array([9.0, 9.0, 2.0])
    found = solve_within(columns.T @ columns, columns.T @ target, low, high)
    assert np.all((found >= low) & (found <= high))
    assert (found[1], found[2]) == (0.0, 2.0)
    left = target - columns[:, 1:] @ found[1:]
    assert found[0] == pytest.approx(columns[:, 0] @ left / (columns[:, 0] @ columns[:, 0]))


def negative_friction() -> list[Recording]:
    """Runs whose drive seems to push by itself: no friction of an allowed sign describes them."""
    return [
        r.with_columns(
            proximal_torque_n_m=r["proximal_torque_n_m"]
            + (0.05 + 0.01 * k) * np.sign(np.gradient(r["motor_angle_rad"]))
        )
        for k, r in enumerate(varied_runs(count=8, seconds=2.0))
    ]


def outside(model: Model) -> list[str]:
    """Parameters whose value or interval is beyond a bound, or whose interval lacks the value."""
    return [
        f"{term.effect.id}.{p.name}: {estimate}"
        for term in model.terms
        for p in term.parameters
        if (estimate := term.values[p.name]).ci95 is not None
        and not p.lower <= estimate.ci95[0] <= estimate.value <= estimate.ci95[1] <= p.upper
    ]


@pytest.mark.parametrize("recordings", [negative_friction(), varied_runs(count=3, seconds=2.0)])
def test_every_interval_of_a_fit_holds_its_value(recordings) -> None:
    assert outside(fit(read(Path("motor")), Campaign.of(recordings))) == []


@pytest.mark.parametrize("speed_m_s", [1e-3, 1.0])
def test_the_change_of_sign_of_friction_is_narrow_next_to_the_speeds_of_the_axis(speed_m_s):
    time_s = np.arange(2000) / 500
    position = speed_m_s * np.sin(0.7 * 2 * np.pi * time_s)
    speed = np.gradient(position, time_s)
    force = 5 * speed / speed_m_s + np.tanh(speed / (0.02 * speed_m_s))
    recording = Recording("x", time_s, {"carriage_position_m": position, "drive_force_n": force})
    (model,) = declared(SLIDE)
    values = numbers(fit(model, Campaign.of([recording]), bootstrap=0))
    assert values["width"] < 0.06 * speed_m_s


@pytest.mark.parametrize("width", [0.0, -1.0])
def test_a_width_that_no_friction_has_is_no_place_to_start(width: float):
    model, recordings = read(Path("motor")), Campaign.of(varied_runs(count=3, seconds=2.0))
    terms = tuple(
        replace(term, values={**term.values, "width": Estimate(width)})
        if term.effect.id == "friction.coulomb"
        else term
        for term in model.terms
    )
    found = fit(replace(model, terms=terms), recordings, bootstrap=0)
    assert numbers(found)["width"] == numbers(fit(model, recordings, bootstrap=0))["width"]


PERIOD_M = 0.005


def screw(order: float) -> Term:
    """Return a wave along the carriage's position."""
    channels = {"motor_angle": "carriage_position_m"}
    return Term(effect("ripple.motor"), channels=channels, values={"order": Estimate(order)})


def faster_and_faster(friction_n: float, noise_n: float) -> Campaign:
    """Return six runs of a carriage with a wave of 6 N along its screw."""
    random, recordings = np.random.default_rng(3), []
    time_s = np.arange(4000) / 200
    for k in range(6):
        position_m = 0.012 * np.sin(2 * np.pi * (0.1 + 0.05 * k) * time_s)
        force_n = 6 * np.sin(2 * np.pi * position_m / PERIOD_M)
        force_n += friction_n * np.tanh(np.gradient(position_m, time_s) / 0.001)
        columns = {
            "carriage_position_m": position_m,
            "drive_force_n": force_n + random.normal(0.0, noise_n, len(time_s)),
        }
        recordings.append(Recording(f"{k}", time_s, columns))
    return Campaign.of(recordings)


@pytest.mark.parametrize("start_m", [0.00508, 0.00492])
def test_a_period_that_is_shorter_than_those_searched_is_fitted_from_its_value(start_m: float):
    (model,) = declared(SLIDE)
    model = replace(model, terms=(*model.terms, screw(2 * np.pi / start_m)))
    found = fit(model, faster_and_faster(20.0, 2.0)).terms[-1].values["order"]
    low, high = found.ci95
    assert found.value == pytest.approx(2 * np.pi / PERIOD_M, rel=2e-3)
    assert low < 2 * np.pi / PERIOD_M < high < 1.01 * low


def test_a_wave_that_is_partly_beyond_the_cutoff_has_its_whole_size() -> None:
    """The filter takes most of it off the target where the axis is fast, none where it is slow."""
    (model,) = declared(SLIDE)
    wave = screw(2 * np.pi / PERIOD_M)
    model = replace(model, terms=(wave,), low_pass=LowPass(4.0), run_offsets=False)
    found = fit(model, faster_and_faster(0.0, 0.5), bootstrap=0, shapes="keep")
    assert numbers(found)["sine"] == pytest.approx(6.0, rel=0.03)
    assert found.evidence.rmse < 0.3  # 1.0 with the wave as the axis is, unfiltered


def test_friction_has_the_form_of_its_change_of_sign_where_no_viscous_friction_is_declared():
    time_s = np.arange(4000) / 500
    position = np.cumsum(1.5 + np.sin(0.7 * 2 * np.pi * time_s)) / 500
    force = np.tanh(np.gradient(position, time_s) / 1.2)
    recording = Recording("x", time_s, {"carriage_position_m": position, "drive_force_n": force})
    (model,) = declared(SLIDE)
    terms = tuple(term for term in model.terms if term.effect.id != "friction.viscous")
    found = fit(replace(model, terms=terms), Campaign.of([recording]), bootstrap=0)
    assert numbers(found)["width"] == pytest.approx(1.2, rel=0.05)


def test_the_interval_is_that_of_live_errors_in_runs_not_fitted_on():
    """A causal filter lags by more than a fit on filtered channels leaves."""
    (carriage,) = declared(SLIDE)
    found = held_out_error(carriage, Campaign.of([slide(k) for k in range(4)]), folds=2)
    fitted = fit(carriage, Campaign.of([slide(k) for k in range(4)]), bootstrap=0)
    error = np.abs(counted_error(fitted, slide(9), causal=True))
    assert np.mean(error < 2 * fitted.evidence.rmse_with_means) < 0.8
    assert np.mean(error < found.half_width) > 0.95
    assert live_half_width([np.ones(9)]) is None
    assert live_half_width([np.ones(9)] * 20) < live_half_width([np.ones(9)] * 3)


def stopped(meeting: tuple[int, ...]) -> Campaign:
    """Runs of a slide whose travel meets a stop at .08 m in some of them."""
    random, time_s = np.random.default_rng(0), np.arange(2000) / 500
    runs = []
    for k in range(8):
        travel = 0.05 + 0.07 * (k in meeting)
        position = travel * np.sin((0.5 + 0.1 * k) * 2 * np.pi * time_s)
        speed = np.gradient(position, time_s)
        force = 5 * speed + np.sign(speed) + 40 * np.maximum(position - 0.08, 0.0)
        force += random.normal(0, 0.05, len(time_s))
        columns = {"carriage_position_m": position, "drive_force_n": force}
        runs.append(Recording(f"{k}", time_s, columns))
    return Campaign.of(runs)


@pytest.mark.parametrize(("meeting", "known"), [((2,), False), ((0, 2, 3, 5, 7), True)])
def test_an_interval_needs_runs_that_show_the_parameter(meeting: tuple[int, ...], known: bool):
    (without,) = declared(SLIDE)
    without = fit(without, stopped(meeting), bootstrap=0)
    stop = Term(effect("spring.end_stop"), 1, {"stop": "carriage_position_m"}, ONSET)
    found = fit(replace(without, terms=(*without.terms, stop)), stopped(meeting), shapes="keep")
    stiffness = found.terms[-1].values["stiffness"]
    assert stiffness.value == pytest.approx(40.0, rel=0.2)
    if not known:
        assert stiffness.ci95 is None
        return
    assert 20.0 < stiffness.ci95[0] < stiffness.value < stiffness.ci95[1] < 80.0


def test_a_model_of_an_offset_alone_is_fitted():
    offset = Term(effect("sensor.offset"), 1, {"clock": "time_s"})
    found = fit(Model("m", "carriage", "drive_force_n", (offset,)), stopped((2,)))
    assert found.terms[0].values["offset"].ci95 is not None


@pytest.mark.parametrize("noise_a", [0.0, 0.03])
def test_intervals_hold_what_the_noise_of_a_reading_has_hidden(motor, noise_a: float) -> None:
    """The more noise the current has, the smaller is the drive's constant that fits best."""
    random, made = np.random.default_rng(0), []
    for one in campaign(noise_n_m=0.0):
        current = one["motor_current_a"] + random.normal(0.0, noise_a, len(one))
        made.append(one.with_columns(motor_current_a=current))
    fitted = fit(motor, Campaign.of(made))
    low, high = {name: e.ci95 for t in fitted.terms for name, e in t.values.items()}["gain"]
    assert low <= TRUE["gain"] <= high
    assert high - low < 0.05 * TRUE["gain"]


def test_a_shape_at_its_bound_has_no_interval() -> None:
    """Friction that grows with the root of the load is below the least power of a contact."""
    declared_motor, power = read(Path("motor")), effect("friction.load.power")
    channels = {"load": "proximal_torque_n_m", "speed": "motor_velocity_rad_s"}
    model = replace(
        declared_motor, terms=(*declared_motor.terms, Term(power, sign=-1, channels=channels))
    )
    runs = varied_runs(lambda _, speed, load: 0.05 * np.sqrt(load) * np.tanh(speed / 3.0))
    values = fit(model, Campaign.of(runs)).terms[-1].values
    assert values["exponent"].value == pytest.approx(power.shape[0].lower, rel=1e-3)
    assert values["exponent"].ci95 is None
    assert values["friction"].ci95 is not None
