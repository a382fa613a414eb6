"""A regressor's noise is not taken for an effect: it is projected where an effect could fit it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.bent import bent_losses
from estimation.diagnosis.candidate import Candidate, projected
from estimation.diagnosis.design import prepare, tables
from estimation.diagnosis.endogeneity import kept_share, noise_share, own_share
from estimation.diagnosis.evidence import leave_one_run_out
from estimation.diagnosis.instruments import instruments, projection, stand_in
from estimation.effects import effect
from estimation.effects.roles import MOTOR_LOAD
from estimation.fitting import fit
from estimation.model import Term
from estimation.model_file import read
from estimation.recording import Recording
from tests.estimation.synthetic import TRUE, run

NOISE_A = 5e-3
MEASURED = (
    "motor_angle_rad",
    "spindle_angle_rad",
    "motor_current_a",
    "proximal_torque_n_m",
    "distal_torque_n_m",
)
CURRENT = "motor_current_a"
LAGS = [
    Candidate.of(Term(effect("motor.electrical"), 1, {}), [0.008]),
    Candidate.of(Term(effect("sensor.lag"), 1, {"reading": CURRENT}), [0.008]),
    Candidate.of(Term(effect("sensor.delay"), 1, {"reading": CURRENT}), [0.019]),
]


def quiet(k: int) -> Recording:
    """Return a run whose current has no noise."""
    return run(f"r{k}", 0.1, 0.05 + 0.01 * k, seed=k, noise_n_m=1e-4)


@pytest.fixture(scope="module")
def noisy():
    runs = []
    for k in range(5):
        made = quiet(k)
        noise = NOISE_A * np.random.default_rng(100 + k).normal(size=len(made))
        runs.append(made.with_columns(**{CURRENT: made[CURRENT] + noise}))
    model = fit(read(Path("motor")), Campaign.of(runs), bootstrap=0)
    names = [*model.channels, model.target, *instruments(MEASURED)]
    return model, [prepare(r, names, model) for r in runs]


def gains(model, runs) -> np.ndarray:
    balance = lay_out(model, runs)
    left = [r[:, None] for r in balance.left(balance.terms)]
    table = tables(runs, LAGS, balance.demean)
    return leave_one_run_out(balance.base(balance.terms), table, [1] * len(LAGS), left).gain[:, 0]


def test_a_lag_of_a_noisy_regressor_gains_only_by_its_noise(noisy):
    model, runs = noisy
    told = projection(runs, LAGS, model.target)
    assert gains(model, runs).max() > 0.04
    assert gains(model, [told(r) for r in runs]).max() < 0.005


def test_the_projection_carries_the_motion_and_less_noise(noisy):
    model, runs = noisy
    told = projection(runs, LAGS, model.target)(runs[0])
    clean, measured, true = told.channels[projected(CURRENT)], told.channels[CURRENT], quiet(0)
    wrong = [np.std((x - true[CURRENT])[runs[0].used]) for x in (clean, measured)]
    assert wrong[0] < 0.5 * wrong[1]


def test_without_other_sensors_the_reading_stays_as_it_is(noisy):
    model, runs = noisy
    alone = [prepare_without(r) for r in runs]
    told = projection(alone, LAGS, model.target)
    assert projected(CURRENT) not in told(alone[0]).channels
    assert instruments(["joint_1_angle_rad"]) == []


def prepare_without(prepared):
    left = {k: v for k, v in prepared.channels.items() if k != "distal_torque_n_m"}
    return replace(prepared, channels=left)


LOOP = Candidate.of(
    Term(effect("hysteresis.bouc_wen"), -1, {"travel": "spindle_angle_rad"}), [0.02, 2.0]
)
STIFFNESS_N_M_RAD = 2.0


def stretched(k: int, noise_n_m: float, loop_rad: float) -> Recording:
    """Return a run with a jaw behind an elastic cable, and slow noise in its torque sensor."""
    made = run(f"r{k}", 0.1 + 0.02 * k, 0.1, seed=k, noise_n_m=1e-4)
    speed = np.gradient(made["motor_angle_rad"], made.time_s)
    distal = made["distal_torque_n_m"] + 0.05 * np.tanh(speed)
    white = np.random.default_rng(200 + k).normal(size=len(made))
    slow = signal.lfilter([np.sqrt(1 - 0.98**2)], [1.0, -0.98], white)
    jaw = 1.4 * made["spindle_angle_rad"] - distal / STIFFNESS_N_M_RAD
    return made.with_columns(
        jaw_angle_rad=jaw - loop_rad * np.tanh(speed),
        distal_torque_n_m=distal + noise_n_m * slow,
    )


@pytest.mark.parametrize(
    ("noise_n_m", "loop_rad", "low", "high"), [(0.03, 0.0, -0.4, 0.4), (0.002, 0.02, 0.8, 1.2)]
)
def test_a_loop_made_of_slow_noise_is_lost_through_instruments_and_a_true_one_is_not(
    noise_n_m, loop_rad, low, high
):
    recordings = [stretched(k, noise_n_m, loop_rad) for k in range(5)]
    model = fit(read(Path("stretch")), Campaign.of(recordings), bootstrap=0)
    names = [*model.channels, model.target, *instruments(MEASURED)]
    balance = lay_out(model, [prepare(r, names, model) for r in recordings])
    assert 1 - balance.loss([*balance.terms, LOOP]) / balance.loss(balance.terms) > 0.05
    share = kept_share(balance, balance.terms, [LOOP])
    assert share is not None
    assert low < share < high


def test_without_other_sensors_nothing_is_said_of_the_noise(noisy):
    model, runs = noisy
    balance = lay_out(model, [prepare_without(r) for r in runs])
    assert kept_share(balance, balance.terms, LAGS[:1]) is None


def test_the_motors_own_idea_of_its_load_is_fitted_to_the_rig_and_hears_no_other_sensor():
    told, spoilt = {}, {}
    for shift in (0.0, 0.05):
        runs = [quiet(k) for k in range(5)]
        runs = [
            r.with_columns(distal_torque_n_m=r["distal_torque_n_m"] * (1 + shift)) for r in runs
        ]
        model = fit(read(Path("motor")), Campaign.of(runs), bootstrap=0)
        names = [*model.channels, model.target, MOTOR_LOAD, *instruments(MEASURED)]
        made = [prepare(r, names, model) for r in runs]
        put = stand_in(made, model.target)
        told[shift], spoilt[shift] = put(made[0]).channels[MOTOR_LOAD], made[0]
    used, true = spoilt[0.0].used, spoilt[0.0].channels["proximal_torque_n_m"]
    nominal = spoilt[0.0].channels[MOTOR_LOAD]
    assert told[0.0][used] == pytest.approx(told[0.05][used], abs=1e-9)
    assert np.std((told[0.0] - true)[used]) < 0.5 * np.std((nominal - true)[used])


def test_an_effect_compared_in_any_form_does_as_well_as_the_form_of_the_truth():
    def lost(motor, speed, load):
        return 0.8 * load**2 * np.tanh(speed / 3.0)

    runs = [
        run(f"r{k}", 0.2, 0.05 + 0.02 * k, seed=k, noise_n_m=1e-4, extra=lost) for k in range(6)
    ]
    model = fit(read(Path("motor")), Campaign.of(runs), bootstrap=0)
    names = [*model.channels, model.target, MOTOR_LOAD, *instruments(MEASURED)]
    made = [prepare(r, names, model) for r in runs]
    put = stand_in(made, model.target)
    balance = lay_out(model, [put(r) for r in made])
    friction = Candidate.of(Term(effect("friction.load"), -1, {}), [3.0])
    left = balance.left(balance.terms)
    columns = balance.columns([friction])
    aims = [r[:, None] for r in left]
    plain = leave_one_run_out(balance.base(balance.terms), columns, [1], aims)
    bent = bent_losses(balance, balance.base(balance.terms), friction, left)
    assert bent.joint.sum() < 0.7 * plain.joint.sum()


@pytest.mark.parametrize("slow", [False, True])
@pytest.mark.parametrize("slips", [False, True])
def test_what_tells_a_force_without_its_noise_removes_that_noise_and_a_true_effect_does_not(
    slips, slow
):
    def ripple(motor, speed, load):
        return 2e-3 * np.sin(0.3 * motor)

    runs = []
    for k in range(5):
        clean = pushed(run(f"r{k}", 0.1, 0.05, seed=3, extra=ripple if slips else None))
        noise = 4 * NOISE_A * np.random.default_rng(100 + k).normal(size=len(clean))
        if slow:  # of a time constant of 50 ms, and the same power below the filter
            noise = signal.lfilter([0.1], [1.0, -0.98], noise)
        runs.append(clean.with_columns(**{CURRENT: clean[CURRENT] + noise}))
    model = fit(read(Path("motor")), Campaign.of(runs), bootstrap=0)
    wanted = [*model.channels, model.target, "motor_angle_rad", CURRENT]
    balance = lay_out(model, [prepare(r, wanted, model) for r in runs])

    def columns(values):
        kept = [values[r.kept][:, None] for r in balance.runs]
        return [c - c.mean() for c in kept]

    if slips:
        found = columns(np.sin(0.3 * clean["motor_angle_rad"]))
        assert noise_share(balance, balance.terms, found) < 0.1
    else:  # all runs are alike, so the place in a run tells the current
        least = 0.4 if slow else 0.5  # half a second's course takes some of the slow noise
        assert noise_share(balance, balance.terms, columns(clean[CURRENT])) > least


def pushed(recording: Recording) -> Recording:
    """Return a run against a further load, the same in every run and no function of the motion."""
    white = np.random.default_rng(1).normal(size=len(recording))
    load = signal.sosfiltfilt(signal.butter(2, 1.0, fs=1000.0, output="sos"), white)
    return recording.with_columns(
        **{
            CURRENT: recording[CURRENT] + load / TRUE["gain"],
            "proximal_torque_n_m": recording["proximal_torque_n_m"] + load,
        }
    )


def test_a_gain_is_hardly_told_where_the_force_goes_with_the_direction(noisy):
    model, runs = noisy
    assert own_share(lay_out(model, runs)) > 0.01
    steady = [with_current_of_direction(r) for r in runs]
    assert own_share(lay_out(model, steady)) < 0.01


def with_current_of_direction(prepared):
    width = 2.0 * np.std(prepared.channels["motor_velocity_rad_s"])
    of_sign = np.tanh(prepared.channels["motor_velocity_rad_s"] / width)
    return replace(prepared, channels={**prepared.channels, CURRENT: 0.1 * of_sign})
