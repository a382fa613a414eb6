"""Effects that remember, and those that came with them: what was put in is what a fit finds."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.verdict import diagnose
from estimation.derived import zero_phase_channels
from estimation.diagnosis.split import split
from estimation.effects import catalogue, effect
from estimation.estimators.model import Stream
from estimation.fitting import fit
from estimation.model import Model, Term, predict
from estimation.recording import Recording
from tests.estimation import synthetic
from tests.estimation.test_effects import typical

pytestmark = pytest.mark.integration

REMEMBERING = [n for n, kind in catalogue().items() if kind.start() and "sticking" not in n]


def slow_motion(k: int, rate_hz: float = 1000.0, seconds: float = 12.0) -> dict[str, np.ndarray]:
    """Return one run's channels: slow sweeps, rests between them, loads of both signs."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    # a rest after each half turn of the sweep: 0.5 s, 1.1 s, ... of standing still
    pace = 0.5 + 0.5 * np.tanh(4 * np.sin(2 * np.pi * (0.21 + 0.02 * k) * t + 0.6 * k))
    phase = 2 * np.pi * 0.5 * np.cumsum(pace) / rate_hz
    angle = (0.5 - 0.05 * k) * np.sin(phase) + 0.15 * np.sin(0.37 * phase + k)
    return {
        "time_s": t,
        "campaign_time_s": t + 60.0 * k,
        "motor_angle_rad": 35 * angle,
        "spindle_angle_rad": angle,
        "jaw_angle_rad": 0.913 * angle + 0.65,
        "wrist_pitch_rad": 0.6 * np.sin(2 * np.pi * 0.05 * t + k),
        "proximal_torque_n_m": 0.1 * np.sin(2 * np.pi * 0.33 * t + 2 * k) + 0.03 * k,
        "distal_torque_n_m": 0.1 * np.sin(2 * np.pi * 0.29 * t + k) + 0.02 * k,
    }


@cache
def runs() -> tuple[Recording, ...]:
    recordings = []
    for k in range(4):
        channels = slow_motion(k)
        time_s = channels.pop("time_s")
        recordings.append(Recording(f"run{k}", time_s, channels))
    return tuple(recordings)


def inputs_of(kind, channels) -> dict[str, np.ndarray]:
    channels = dict(channels)
    step_s = channels["time_s"][1] - channels["time_s"][0]
    channels["motor_velocity_rad_s"] = np.gradient(channels["motor_angle_rad"], step_s)
    other = 0.1 * np.sin(2.5 * channels["time_s"])
    return {role: channels.get(name, other) for role, name in kind.roles.items()}


@pytest.mark.parametrize("name", REMEMBERING)
def test_columns_do_not_depend_on_the_rate_of_the_samples(name):
    kind = effect(name)
    shape = typical(kind)
    fast = inputs_of(kind, slow_motion(2))
    thinned = {role: values[::10] for role, values in fast.items()}
    expected = kind.columns(fast, shape)[::10]
    error = kind.columns(thinned, shape) - expected
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize(
    "name", [n for n in REMEMBERING if n.startswith("hysteresis") and not n.endswith("twist")]
)
def test_friction_with_memory_takes_work_out_of_a_closed_path(name):
    kind = effect(name)
    inputs = inputs_of(kind, slow_motion(0))
    t = np.arange(4000) * 1e-3
    inputs["travel"] = 0.3 * np.sin(2 * np.pi * t)
    if "speed" in inputs:
        inputs["speed"] = 35 * 0.3 * 2 * np.pi * np.cos(2 * np.pi * t)
    torque = kind.columns(inputs, typical(kind)).sum(axis=1)
    assert np.sum(torque[1000:-1] * np.diff(inputs["travel"])[1000:]) > 0


@pytest.mark.parametrize(
    ("name", "balance", "side"),
    [
        ("hysteresis.bouc_wen.twist", "gearbox", 1),
        ("hysteresis.bouc_wen.twist", "stretch", -1),  # the jaw's angle is what stretch takes away
        ("hysteresis.presliding", "gearbox", 1),
        ("transmission.relaxation", "gearbox", 1),
        ("transmission.relaxation", "stretch", -1),
    ],
)
def test_a_loop_of_deflection_against_load_takes_work_too(name, balance, side):
    kind = effect(name)
    t = np.arange(4000) * 1e-3
    load = 0.1 * np.sin(2 * np.pi * t)
    inputs = dict.fromkeys(kind.roles, load) | ({"clock": t} if "clock" in kind.roles else {})
    deflection = side * kind.balances[balance] * kind.columns(inputs, typical(kind)).sum(axis=1)
    assert np.sum(load[1000:-1] * np.diff(deflection)[1000:]) > 0


def test_relaxation_answers_a_step_by_the_exact_exponential_at_any_rate():
    kind = effect("transmission.relaxation")
    time_s = np.array([0.0, 0.5, 0.5001, 0.7, 1.4, 3.0])
    load = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    left = kind.columns({"load": load, "clock": time_s}, (0.8,))[:, 0]
    assert left[2:] == pytest.approx(np.exp(-(time_s[2:] - 0.50005) / 0.8), rel=1e-4)


def test_break_away_is_higher_after_a_longer_rest_and_is_worn_off_by_sliding():
    kind = effect("friction.dwell")
    peaks = []
    for rest_s in (0.1, 1.0, 5.0):
        t = np.arange(0.0, 4.0 + rest_s, 1e-3)
        speed = np.where((t < 2.0) | (t > 2.0 + rest_s), 10.0, 0.0)
        column = kind.columns({"speed": speed, "clock": t}, (1.0, 3.0, 1.0))[:, 0]
        peaks.append(column[t > 2.0 + rest_s][0])
        assert column[-1] < 0.5
    assert peaks == sorted(peaks)
    assert peaks[-1] > 0.95


def started(recording: Recording, start_s: float | None) -> Recording:
    columns = {k: v for k, v in recording.columns.items() if k != "campaign_time_s"}
    start_ns = None if start_s is None else 1_700_000_000_000_000_000 + round(start_s * 1e9)
    return replace(recording, columns=columns, started_at_ns=start_ns)


def test_a_campaign_whose_starts_are_known_has_a_clock_of_its_own():
    recordings = [started(r, s) for r, s in zip(runs(), (90.0, 30.0, 0.0, 200.0), strict=True)]
    timed = list(Campaign.of(recordings).timed())
    firsts = [recording["campaign_time_s"][0] for recording in timed]
    assert firsts == pytest.approx([90.0, 30.0, 0.0, 200.0])
    assert np.ptp(timed[0]["campaign_time_s"]) == pytest.approx(recordings[0].duration_s)
    unknown = Campaign.of([*recordings[:3], started(recordings[3], None)])
    assert all("campaign_time_s" not in recording for recording in unknown.timed())


def test_the_time_of_the_campaign_alone_is_a_channel():
    (run,) = Campaign.of([started(runs()[0], 0.0)]).timed()
    assert zero_phase_channels(run, ["campaign_time_s"])["campaign_time_s"][0] >= 0.0


def test_a_model_of_warm_up_is_fitted_on_the_campaign_and_runs_live():
    kind = effect("friction.warmup.campaign")
    made = [
        recording.with_columns(
            made_torque_n_m=0.02
            * np.exp(-recording["campaign_time_s"] / 120.0)
            * np.tanh(np.gradient(recording["motor_angle_rad"], recording.time_s) / 2.0)
        )
        for recording in runs()
    ]
    bare = [started(recording, 60.0 * k) for k, recording in enumerate(made)]
    declared = Model("warm-up", "motor", "made_torque_n_m", (Term(kind),), run_offsets=False)
    fitted = fit(declared, Campaign.of(bare), every=20, bootstrap=0)
    assert fitted.terms[0].values["time"].value == pytest.approx(120.0, rel=0.05)
    live = Stream(fitted, 1000.0)
    assert live.channels == ("motor_angle_rad",)
    first = made[0]  # the campaign's clock starts with it, as the live one with its first sample
    there = {name: first[name] for name in live.channels}
    steps = [
        live.step(first.time_s[part], {name: values[part] for name, values in there.items()})
        for part in (slice(0, 1), slice(1, 700), slice(700, None))
    ]
    offline = predict(fitted, first, causal=True)
    assert np.concatenate(steps) == pytest.approx(offline, rel=1e-9, abs=1e-12)


@pytest.mark.long
def test_a_change_between_runs_is_found_by_the_diagnosis():
    def rubs(motor_rad, speed_rad_s, load_n_m):
        return 0.01 * np.tanh(speed_rad_s / 3.0)

    recordings = []
    for k in range(12):
        run = synthetic.run(
            f"run{k:02d}",
            0.2 + 0.15 * (k % 3),
            0.05 * (1 + k // 3),
            seed=k,
            seconds=4.0,
            extra=rubs if k >= 5 else None,
        )
        recordings.append(started(run, 60.0 * k))
    motor = model_file.read(Path("motor"))
    sealed = split(recordings, 1)
    diagnosis = diagnose(recordings, [motor], sealed)
    assert [finding.family for finding in diagnosis.findings] == ["change.step"]
    (finding,) = diagnosis.findings
    # run04, the only one between, is a test run
    assert 180 < finding.parameters["since"].value <= 300
    assert finding.rmse_after < 0.5 * finding.rmse_before


@pytest.mark.parametrize("name", ["transmission.relaxation", "sensor.creep"])
def test_a_run_begins_as_settled_under_its_first_load_as_declared(name):
    kind = effect(name)
    time_s = np.linspace(0.0, 3.0, 301)
    load = next(role for role in kind.roles if role != "clock")
    inputs = {load: np.ones(301), "clock": time_s}
    size = np.exp(-time_s / 0.8)
    for settled in (0.0, 0.25, 1.0):
        column = kind.columns(inputs, (0.8, settled))[:, 0]
        assert np.abs(column) == pytest.approx((1.0 - settled) * size, abs=1e-9)
