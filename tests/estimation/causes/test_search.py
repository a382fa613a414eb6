"""What the search over causes finds, and what it never reads."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.ndimage import gaussian_filter1d

from benchmarks.rigs import draw
from estimation import model_file, plant_file
from estimation.causes.blocks import block_of, errors_of
from estimation.causes.candidates import Claim, groups_of, without_declared
from estimation.causes.criterion import base_errors
from estimation.causes.findings import family_probabilities, others_in_set
from estimation.causes.folds import folds_of
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import Layout, lay_out
from estimation.causes.levels import with_levels
from estimation.causes.numbers import DEFAULT
from estimation.causes.offered import sources_at
from estimation.causes.places import places_of
from estimation.causes.remarks import pauses
from estimation.causes.scoring import assessed, best_of_each, tried
from estimation.causes.search import Found, search
from estimation.causes.verdict import answer, diagnose
from estimation.derived import CAMPAIGN_TIME
from estimation.diagnosis.result import Diagnosis, Finding
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.model import Model, Term
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import (
    AXIS,
    RATE_HZ,
    RATIO,
    axis,
    cable,
    cabled,
    gearbox,
    geared,
    hoist,
    hoisted,
    motor,
    recordings,
    resisting,
    sprung,
    turning,
)


def _only(runs: list[Recording], *models: Model) -> Finding:
    (finding,) = diagnose(runs, models, split(runs)).findings
    assert finding.no_effect <= 0.5
    return finding


def _laid(runs: list[Recording], *models: Model) -> Layout:
    """Return equations fitted on all runs, with the instruments."""
    names = [run.name for run in runs]
    layout = lay_out(models, runs, names)
    add_instruments(layout, names)
    return layout


def _asymmetric(angle: FloatArray, speed: FloatArray, load: FloatArray) -> FloatArray:
    return 4e-4 * np.abs(speed)


def _rippled(angle: FloatArray, speed: FloatArray, load: FloatArray) -> FloatArray:
    return 0.01 * np.sin(3 * angle)


@pytest.mark.parametrize(
    ("runs", "family", "parameter", "value"),
    [
        # where the speed never changes its sign, declared friction must not take the drag's form
        (
            turning(lambda _, speed, __: 0.02 * speed**2, always_ahead=True, size=3.0),
            *("friction.drag", "drag", 0.02),
        ),
        (
            turning(lambda x, v, a: 0.01 * (np.cos(x) * a - 0.5 * np.sin(x) * v**2)),
            *("inertia.position", "cosine", 0.01),
        ),
    ],
)
def test_a_cause_of_one_axis_is_named_with_its_size(runs, family, parameter, value):
    finding = _only(runs, axis())
    assert (finding.family, finding.verdict) == (family, "identified")
    assert finding.parameters[parameter].value == pytest.approx(value, rel=0.05)


def test_viscous_friction_that_varies_along_the_travel_is_named_with_its_variables():
    finding = _only(turning(lambda angle, speed, _: 0.01 * angle * speed, size=3.0), axis())
    assert (finding.form, finding.verdict) == ("friction.position.viscous", "identified")
    assert {*finding.depends_on} == {"velocity", "crank_angle"}
    assert finding.parameters["slope"].value == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("late_s", [0.01, 0.02])
def test_what_is_late_in_part_is_stated_by_how_much_it_is_late(late_s: float) -> None:
    """In slow motion only the product of the part and its time is known."""
    runs = [
        run.with_columns(
            crank_torque_n_m=np.interp(run.time_s - late_s, run.time_s, run["crank_torque_n_m"])
        )
        for run in turning()
    ]
    finding = _only(runs, axis())
    assert finding.family in ("sensor.delay", "sensor.lag")
    assert finding.parameters["lateness"].value == pytest.approx(late_s, rel=0.2)


def test_a_filtered_reading_of_a_fast_load_is_one_finding_that_removes_its_error() -> None:
    lag_s, runs = 0.05, []
    for k, run in enumerate(cabled()):
        fast = sum(0.02 * np.sin(2 * np.pi * f * run.time_s + k + f) for f in (0.7, 1.9, 3.3))
        kept = np.exp(-1.0 / (RATE_HZ * lag_s))
        distal = run["distal_torque_n_m"] + fast
        late, _ = signal.lfilter([1 - kept], [1, -kept], distal, zi=[kept * distal[0]])
        loaded = {
            "distal_torque_n_m": late,
            "proximal_torque_n_m": run["proximal_torque_n_m"] + RATIO * fast,
            "jaw_angle_rad": run["jaw_angle_rad"] - fast / 20.0,
        }
        runs.append(run.with_columns(**loaded))
    (finding,) = diagnose(runs, cable(), split(runs)).findings
    assert (finding.verdict, finding.family) == ("identified", "sensor.lag")
    assert finding.parameters["lateness"].value == pytest.approx(lag_s, rel=0.1)
    assert finding.rmse_after < 0.05 * finding.rmse_before


def test_a_cause_of_some_runs_has_its_size() -> None:
    """No model file holds it, so its amplitude is that of the refit."""
    bent = turning(lambda angle, *_: 0.2 * angle**2)
    runs = [*turning()[:3], *bent[3:8], *turning()[8:]]
    finding = _only(runs, axis())
    assert finding.form == "spring.position.curved"
    assert finding.parameters["bend"].value == pytest.approx(0.2, rel=0.1)


def test_a_curved_spring_takes_the_place_of_the_linear_one_that_is_declared() -> None:
    """A model file with both could not be fitted: they share a column."""
    spring = Term(effect("spring.position"), channels={"position": "crank_angle_rad"})
    model = replace(axis(), terms=(*axis().terms, spring))
    runs = turning(lambda angle, *_: 0.1 * angle + 0.2 * angle**2)
    found = answer(runs, [model], split(runs))
    (finding,) = found.diagnosis.findings
    assert finding.form == "spring.position.curved"
    assert finding.parameters["stiffness"].value == pytest.approx(0.1, rel=0.1)
    assert finding.parameters["bend"].value == pytest.approx(0.2, rel=0.1)
    (written,) = found.models
    assert [t.effect.id for t in written.terms if t.effect.family == "spring.position"] == [
        "spring.position.curved"
    ]


def test_a_rejected_form_of_what_is_found_is_called_a_second_one() -> None:
    runs = [
        run.with_columns(crank_torque_n_m=run["crank_torque_n_m"] + 0.05 * run.time_s)
        for run in turning()
    ]
    found = diagnose(runs, [axis()], split(runs))
    (finding,) = found.findings
    rejected = [note for note in found.notes if "was found in the training runs" in note]
    assert finding.family == "sensor.drift"
    assert all(note.startswith("A second form of ") for note in rejected if finding.family in note)


def test_an_error_of_an_encoder_has_its_size_where_its_rates_alone_enter() -> None:
    runs = [
        run.with_columns(crank_angle_rad=run["crank_angle_rad"] + 2e-3 * np.sin(4 * angle))
        for run in turning(size=6.0)
        for angle in [run["crank_angle_rad"]]
    ]
    finding = _only(runs, axis())
    sizes = finding.parameters
    assert finding.family == "sensor.encoder_inl"
    assert sizes["sine"].unit == "rad"
    assert np.hypot(sizes["sine"].value, sizes["cosine"].value) == pytest.approx(2e-3, rel=0.2)


def test_an_inertia_over_a_small_angle_is_constant() -> None:
    runs = turning(lambda angle, speed, acc: angle * acc + 0.5 * speed**2, size=0.15)
    families = {finding.family for finding in diagnose(runs, [axis()], split(runs)).findings}
    assert families
    assert "inertia.position" not in families


@pytest.mark.long
def test_three_causes_of_two_variables_keep_their_names() -> None:
    """One function of the angle explains more than each of the two causes that act over it."""
    random, runs = np.random.default_rng(6), []
    for k in range(12):
        drawn, time = np.random.default_rng(300 + k), np.arange(4000) / 400.0
        angle = np.zeros(len(time))
        for _ in range(5):
            size, pace, phase = drawn.normal(), drawn.uniform(0.3, 1.0), drawn.uniform(0.0, 6.3)
            angle += size * np.sin(np.pi * pace * time + phase)
        angle *= 2.0 / np.abs(angle).max()
        speed = np.gradient(angle, time)
        torque = 0.02 * np.gradient(speed, time) + 0.1 * speed + 0.2 * angle
        torque += 0.12 * np.sin(6.0 * angle)
        torque += (0.3 + 0.15 * np.exp(-((speed / 0.5) ** 2))) * np.tanh(speed / 0.03)
        torque += random.normal(0.0, 0.004, len(time))
        columns = {"crank_torque_n_m": torque, "crank_angle_rad": angle}
        runs.append(Recording(f"{k:02d}", time, columns))
    families = {finding.family for finding in diagnose(runs, [axis()], split(runs)).findings}
    assert families == {"spring.position", "ripple.motor", "friction.stribeck"}


@pytest.mark.parametrize(
    ("other", "family", "change"),
    [
        (lambda _, __, acceleration: 0.008 * acceleration, "inertia.missing", 0.008),
        (lambda _, speed, __: -0.02 * speed, "friction.viscous", -0.02),
    ],
)
def test_a_declared_term_may_differ_in_some_of_the_runs(other, family, change):
    """A payload's torque, over the frequencies of a run, is nearly that of a spring."""
    has = [k in (1, 2, 5, 8, 9) for k in range(10)]
    pairs = zip(turning(), turning(other), has, strict=True)
    runs = [two if with_it else one for one, two, with_it in pairs]
    finding = _only(runs, axis())
    assert finding.family == family
    names = {run.name for run, with_it in zip(runs, has, strict=True) if with_it}
    if len(names ^ {*finding.runs_affected}) > 5:  # the others have the opposite change
        names, change = {run.name for run in runs} - names, -change
    assert finding.parameters["change"].value == pytest.approx(change, rel=0.1)
    assert len(names ^ {*finding.runs_affected}) <= 1


@pytest.mark.parametrize("stiffness_n_m_rad", [6.0, 10.0])
def test_a_spring_that_spoils_the_fit_of_the_drive_is_found(stiffness_n_m_rad: float) -> None:
    runs = [
        run.with_columns(
            drive_command_v=run["drive_command_v"] + stiffness_n_m_rad * run["drum_angle_rad"] / 3.0
        )
        for run in hoisted()
    ]
    (finding,) = diagnose(runs, [hoist()], split(runs)).findings
    assert finding.family == "spring.position"
    assert finding.parameters["stiffness"].value == pytest.approx(400 * stiffness_n_m_rad, rel=0.02)
    assert finding.rmse_after < 0.05 * finding.rmse_before


def test_a_drive_that_saturates_is_found_where_it_is_the_target() -> None:
    """Nothing but the drive reads an effort, so it is what the equation explains."""
    runs = []
    for run in turning(size=3.0):
        torque = run["crank_torque_n_m"]
        current = torque / 0.8 * (1.0 + 0.05 * (torque / 0.5) ** 2)
        runs.append(Recording(run.name, run.time_s, run.columns | {"crank_current_a": current}))
    finding = _only(runs, axis("crank_current_a"))
    assert finding.family == "motor.saturation"
    assert "sensor.gain_nonlinear" in finding.alternatives  # of the current: the same column


def test_a_drive_may_give_another_torque_an_ampere_in_some_of_the_runs() -> None:
    has = (1, 4, 5, 8)
    runs = []
    for k, run in enumerate(turning(size=3.0)):
        current = run["crank_torque_n_m"] / (0.75 if k in has else 0.8)
        runs.append(Recording(run.name, run.time_s, run.columns | {"crank_current_a": current}))
    finding = _only(runs, axis("crank_current_a"))
    assert finding.family == "motor.torque_constant"
    assert finding.parameters["change"].value == pytest.approx(0.75 / 0.8 - 1.0, rel=0.05)
    assert {*finding.runs_affected} == {runs[k].name for k in has}


def test_the_gain_of_a_sensor_that_is_the_target_competes_with_that_of_the_drive() -> None:
    """Nearly all of the reading comes from the drive, and one equation alone reads the sensor."""
    random, has, runs = np.random.default_rng(0), (1, 4, 6, 8), []
    for k, run in enumerate(turning(lambda angle, speed, acceleration: 0.0 * speed, size=0.2)):
        load = (1.0 + 0.1 * (3 * k % 10)) * (2.0 + np.sin(1.3 * run.time_s + k))
        columns = {
            "crank_current_a": (load + run["crank_torque_n_m"]) / 0.8,
            "crank_torque_n_m": (0.92 if k in has else 1.0) * load
            + random.normal(0, 0.01, len(load)),
        }
        runs.append(Recording(run.name, run.time_s, run.columns | columns))
    sensor = '[[sensor]]\nname = "crank_torque_n_m"\naxis = "crank"\nreads = "effort"\n'
    models = declared(plant_file.parse(AXIS.replace("DRIVE", "crank_current_a") + sensor))
    (finding,) = diagnose(runs, models, split(runs)).findings
    assert {"sensor.gain", "motor.torque_constant"} <= {finding.family, *finding.alternatives}
    assert {*finding.runs_affected} == {runs[k].name for k in has}
    change = {"sensor.gain": -0.08, "motor.torque_constant": -0.08 * 0.8}[finding.family]
    assert finding.parameters["change"].value == pytest.approx(change, rel=0.05)


def _read_behind_a_drive(gains: Sequence[float], late_s: float = 0.0) -> Diagnosis:
    """Return the diagnosis of a drive with friction whose load is read with little noise.

    Args:
        gains: Of the sensor of the load, one a run.
        late_s: How late the current is read.
    """
    random, runs = np.random.default_rng(0), []
    for k, (run, gain) in enumerate(zip(turning(), gains, strict=False)):
        load = 0.3 * (1.0 + 0.1 * (3 * k % 10)) * (2.0 + np.sin(11.0 * run.time_s + k))
        current = (load + run["crank_torque_n_m"]) / 0.8 + random.normal(0, 0.01, len(load))
        columns = {
            "crank_current_a": np.interp(run.time_s - late_s, run.time_s, current),
            "crank_torque_n_m": gain * load + random.normal(0, 0.002, len(load)),
        }
        runs.append(Recording(run.name, run.time_s, run.columns | columns))
    sensor = '[[sensor]]\nname = "crank_torque_n_m"\naxis = "crank"\nreads = "effort"\n'
    models = declared(plant_file.parse(AXIS.replace("DRIVE", "crank_current_a") + sensor))
    return diagnose(runs, models, split(runs))


def test_the_gain_of_a_sensor_with_little_noise_is_named_where_it_differs_in_some_runs() -> None:
    """All terms of its equation differ by one factor, and no other sensor predicts its reading."""
    has = (1, 4, 6, 8)
    found = _read_behind_a_drive([1.1 if k in has else 1.0 for k in range(12)])
    (finding,) = found.findings
    assert finding.family == "sensor.gain"
    assert finding.parameters["change"].value == pytest.approx(0.1, rel=0.05)
    assert {*finding.runs_affected} == {f"{k:02d}" for k in has}


def test_a_late_reading_of_the_drive_is_one_finding_that_removes_its_error() -> None:
    """Its reading comes late, so its whole form is an advance."""
    found = _read_behind_a_drive([1.0] * 12, late_s=0.02)
    (finding,) = found.findings
    assert finding.family in ("sensor.delay", "sensor.lag")
    assert finding.rmse_after < 0.15 * finding.rmse_before


def test_a_tight_spot_in_every_turn_depends_on_the_angle_and_the_direction() -> None:
    def rubs(angle: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        spot = np.exp(-(((np.mod(angle, 2 * np.pi) - 3.0) / 0.4) ** 2))
        return 1.5 * spot * np.tanh(speed / 0.2)

    finding = _only(turning(rubs, size=12.0), axis())
    assert finding.verdict == "depends_on"
    assert {*finding.depends_on} == {"velocity_sign", "crank_angle"}


@pytest.mark.long
def test_coloured_noise_of_a_torque_is_no_other_compliance_in_some_of_the_runs() -> None:
    """Within runs a noisy torque is better left out; the means of the runs hold its factor."""
    runs = list(draw(22_067, "clean", gear_ratio=35.0).recordings)
    rig = model_file.reference_rig()
    assert diagnose(runs, rig, split(runs)).findings == ()


@pytest.mark.long
def test_a_part_of_a_period_is_named_by_its_variables() -> None:
    """Over fewer than two periods a wave is any smooth function of the position."""
    runs = list(draw(1_120_002, "outside", gear_ratio=35.0).recordings)
    finding = _only(runs, *model_file.reference_rig())
    assert finding.verdict == "depends_on"
    variables = {*finding.depends_on}
    assert variables in ({"spindle_angle", "load"}, {"jaw_angle", "load"})  # of one shaft


def test_a_weight_behind_a_gear_depends_on_the_angle_that_the_gear_gives() -> None:
    """Only the motor has an encoder: the arm turns by its angle over the ratio."""
    arm = '[[axis]]\nname = "arm"\nunit = "rad"\n'
    gear = '[[transmission]]\nname = "gear"\ninput = "crank"\noutput = "arm"\nratio = 10.0\n'
    text = AXIS.replace("DRIVE", "crank_torque_n_m") + arm + gear
    runs = turning(lambda angle, *_: 3.0 * np.sin(angle / 10.0), size=15.0)
    finding = _only(runs, *declared(plant_file.parse(text)))
    assert finding.family == "gravity.payload"
    assert finding.depends_on == ("arm_angle",)
    assert finding.parameters["sine"].value == pytest.approx(3.0, rel=0.05)


TWO_ENCODERS = """
schema = "rig.machine/1"
machine = { name = "joint" }
axis = [{ name = "motor", unit = "rad" }, { name = "arm", unit = "rad" }]
transmission = [{ name = "belt", input = "motor", output = "arm", ratio = 8.0, compliant = true }]
actuator = [{ name = "motor_current_a", axis = "motor" }]
sensor = [
  { name = "motor_angle_rad", axis = "motor", reads = "position" },
  { name = "arm_angle_rad", axis = "arm", reads = "position" },
  { name = "arm_torque_n_m", axis = "arm", reads = "effort" },
]
"""


def test_a_belt_that_stiffens_is_the_only_explanation_of_the_angle_between_two_encoders() -> None:
    """The angle between them is computed: no actuator and no sensor has a gain in it."""
    random, time = np.random.default_rng(0), np.arange(3000) / 250
    runs = []
    for k in range(10):
        waves = zip(random.uniform(0.1, 0.7, 8), random.uniform(0, 2 * np.pi, 8), strict=True)
        parts = [np.sin(2 * np.pi * f * time + p) for f, p in waves]
        arm, load = sum(parts[:4]), 0.5 * sum(parts[4:])
        motor_angle = 8.0 * (arm + 0.01 * load - 0.001 * load * np.abs(load))
        speed = np.gradient(motor_angle, time)
        lost = 0.02 * np.tanh(speed) + 0.002 * speed + 1e-4 * np.gradient(speed, time)
        channels = {
            "motor_current_a": 10.0 * (lost + load / 8.0) + random.normal(0, 0.02, len(time)),
            "motor_angle_rad": motor_angle + random.normal(0, 1e-4, len(time)),
            "arm_angle_rad": arm + random.normal(0, 1e-5, len(time)),
            "arm_torque_n_m": load + random.normal(0, 2e-3, len(time)),
        }
        runs.append(Recording(f"{k:02d}", time, channels, started_at_ns=int(1e10 * k) + 1))
    finding = _only(runs, *declared(plant_file.parse(TWO_ENCODERS)))
    assert (finding.family, finding.verdict) == ("transmission.stiffening", "identified")


def test_the_width_of_a_declared_friction_is_another_next_to_a_cause() -> None:
    """Fitted without the drag, the width makes up for a part of it."""
    finding = _only(turning(lambda angle, speed, _: 0.1 * speed * np.abs(speed)), axis())
    assert finding.family == "friction.drag"
    assert finding.rmse_after < 0.05 * finding.rmse_before


def test_no_axis_of_the_reference_rig_is_apart_from_another() -> None:
    """The equations relate its shafts one after the other, so none is an axis of its own."""
    runs = list(draw(1_000_000, "clean").recordings)[:6]
    layout = _laid(runs, *model_file.reference_rig())
    assert not any(place.others for place in places_of(layout))


def _searched(runs: list[Recording]) -> Found:
    sealed = split(runs)
    layout = lay_out([motor()], runs, sealed.discover)
    add_instruments(layout, sealed.discover)
    return search(layout.select(sealed.discover))


@pytest.fixture(scope="module")
def found() -> Found:
    return _searched(recordings(_rippled))


def test_a_loss_is_identified_where_a_run_has_too_few_samples() -> None:
    runs = recordings(_asymmetric)
    runs[3] = runs[3].at(np.flatnonzero(runs[3].time_s < 0.3))
    answer = diagnose(runs, [motor()], split(runs))
    (finding,) = answer.findings
    assert (finding.family, finding.verdict) == ("friction.viscous_asymmetry", "identified")
    assert finding.rmse_after < 0.5 * finding.rmse_before
    assert answer.errors["motor"].after < answer.errors["motor"].before
    assert any("Left out" in note and "'03'" in note for note in answer.notes)


def test_many_runs_take_no_more_samples_than_some() -> None:
    samples = []
    for count in (12, 60, 120):
        runs = recordings(_asymmetric, count)
        layout = lay_out([motor()], runs, [run.name for run in runs])
        samples.append(sum(len(run.used["motor"]) for run in layout.runs))
        assert len(layout.runs) == count
    few, some, many = samples
    assert few < many < 1.2 * some


@pytest.mark.long
def test_an_effect_is_found_in_many_runs() -> None:
    runs = recordings(_asymmetric, 90)
    assert _only(runs, motor()).family == "friction.viscous_asymmetry"


def _coarse(seed: int, count_rad: float = 0.01) -> list[Recording]:
    """Return runs whose motor's encoder is coarse."""
    return [
        run.with_columns(motor_angle_rad=np.round(run["motor_angle_rad"] / count_rad) * count_rad)
        for run in recordings(seed=seed)
    ]


def _noisy() -> list[Recording]:
    """Return runs of one axis whose acceleration is mostly noise of the encoder."""
    random, runs = np.random.default_rng(5), []
    for k in range(12):
        time = np.arange(5000) / 250.0
        angle = sum(
            random.uniform(0.5, 2.0)
            * np.sin(random.uniform(1.0, 6.0) * time + random.uniform(0, 6))
            for _ in range(4)
        )
        speed = np.gradient(angle, time)
        torque = 0.02 * np.gradient(speed, time) + 0.1 * speed + 0.2 * np.tanh(speed / 0.05)
        torque += random.normal(0.0, 0.1, len(time))
        angle = angle + random.normal(0.0, 8e-3, len(time))
        columns = {"crank_torque_n_m": torque, "crank_angle_rad": angle}
        runs.append(Recording(f"{k:02d}", time, columns))
    return runs


@pytest.mark.parametrize("seed", [12, 13, 19, 29])
def test_terms_at_their_bounds_are_those_of_the_least_error(seed: int) -> None:
    """Of two frictions that come out negative together, only one has to be zero."""
    joint = Joint(_laid(resisting(seed), motor()))
    kinds = joint.layout.equations["motor"].kinds
    bounded = [k for k, column in enumerate(kinds) if column.is_bounded]
    errors = []
    for some in itertools.product((False, True), repeat=len(bounded)):
        held = np.zeros_like(joint.held)
        held[bounded] = some
        fitted = joint.holding(held).left_out([[]]).base[0]
        if (joint.whole(fitted)[bounded] >= -1e-9)[~held[bounded]].all():
            errors.append(_squared_error(joint, fitted))
    chosen = _squared_error(joint, joint.left_out([[]]).base[0])
    assert len(errors) > 1
    assert chosen == pytest.approx(min(errors), rel=0.01)


def _squared_error(joint: Joint, base: FloatArray) -> float:
    """Return the weighted squared error of a base of all runs."""
    vector = np.append(base, -1.0)
    parts = (joint.weights[p] * joint.gram[p].sum(axis=0) for p in joint.parts)
    return float(sum(vector @ gram @ vector for gram in parts))


@pytest.mark.parametrize("noise_n_m", [1e-4, 3e-4])
def test_slow_noise_of_a_load_that_the_motion_predicts_is_no_late_encoder(noise_n_m: float) -> None:
    """The jaw's speed stands in for the load's reading, and has none of its noise."""
    runs = sprung(noise_n_m)
    assert diagnose(runs, cable(), split(runs)).findings == ()


def test_a_noisy_encoder_is_no_slow_one() -> None:
    """The inertia comes out too small, and a lag of the angle would make up for it."""
    runs = _noisy()
    assert diagnose(runs, [axis()], split(runs)).findings == ()


SPRUNG = partial(recordings, spring=True)
"""Runs against a spring: the angle follows the load."""


@pytest.mark.parametrize(
    "made",
    [
        recordings,
        SPRUNG,
        partial(_coarse, 0),
        pytest.param(partial(_coarse, 1), marks=pytest.mark.long),
    ],
)
def test_nothing_is_found_where_nothing_is_missing(made: Callable[[], list[Recording]]) -> None:
    runs = made()
    found = diagnose(runs, [motor()], split(runs))
    assert found.findings == ()
    # slow noise of the current is none that a reading shows
    assert found.verdict == ("unexplained" if made is SPRUNG else "nothing_missing")
    assert found.errors["motor"].after == found.errors["motor"].before
    assert not any("times what" in note for note in found.notes)


@pytest.mark.parametrize(
    "having",
    [
        (2, 4, 7, 11),
        pytest.param((1, 2, 5, 6, 7, 10), marks=pytest.mark.long),
        pytest.param((0, 3, 5, 8, 9), marks=pytest.mark.long),
    ],
)
def test_a_test_run_decides_itself_where_the_training_runs_do_not(having: tuple[int, ...]) -> None:
    plain, rippled = recordings(), recordings(_rippled)
    runs = [rippled[k] if k in having else plain[k] for k in range(12)]
    found = answer(runs, [motor()], split(runs))
    (finding,) = found.diagnosis.findings
    assert finding.family == "ripple.motor"
    assert {*finding.runs_affected} == {f"{k:02d}" for k in having}
    assert any("these test runs themselves" in note for note in found.diagnosis.notes)
    # the runs without it would be worse with it, so it is in no model file
    assert [len(written.terms) for written in found.models] == [len(motor().terms)]


def test_a_loss_at_a_spot_that_grows_with_the_load_is_found_with_both_variables() -> None:
    def spot(angle: FloatArray, speed: FloatArray, load: FloatArray) -> FloatArray:
        there = np.exp(-0.5 * ((angle - 3.0) / 1.2) ** 2)
        return 0.3 * load * there * np.tanh(speed / 2.0)

    runs = recordings(spot)
    found = answer(runs, [motor()], split(runs))
    finding = found.diagnosis.findings[0]
    assert (finding.family, finding.verdict, finding.confidence) == ("unknown", "depends_on", None)
    assert {*finding.depends_on} == {"velocity_sign", "motor_angle", "load"}
    assert finding.rmse_after < 0.7 * finding.rmse_before
    assert [len(written.terms) for written in found.models] == [len(motor().terms)]
    assert any("not added to the model file" in note for note in found.diagnosis.notes)


@pytest.mark.parametrize(
    ("fault", "family"),
    [
        ({"slow": 0.3}, "transmission.relaxation"),
        pytest.param({"bend": 0.1}, "sensor.gain_nonlinear", marks=pytest.mark.long),
        # a torque sensor that is slow by a share is not late
        pytest.param({"creep": 0.1}, "sensor.creep", marks=pytest.mark.long),
        ({"wave": 0.03}, "sensor.encoder_inl"),  # its acceleration hides the rotor's inertia
    ],
)
def test_a_gear_and_its_sensors_are_kept_apart(fault: dict[str, float], family: str) -> None:
    finding = _only(geared(**fault), motor(), gearbox())
    assert finding.family == family
    assert finding.rmse_after < (0.6 if "slow" in fault else 1.0) * finding.rmse_before


def test_a_wave_has_its_size_before_the_filter() -> None:
    """Twelve waves a turn pass the cutoff of the channels in the fast parts of a run."""
    finding = _only(recordings(lambda angle, *_: 0.02 * np.sin(12.0 * angle)), motor())
    assert finding.family == "ripple.motor"
    assert finding.parameters["sine"].value == pytest.approx(0.02, rel=0.03)


def test_crosstalk_has_the_size_of_the_equation_that_identifies_it() -> None:
    """In the motor's equation crosstalk of the current is a larger constant of the drive."""
    runs = [
        run.with_columns(
            proximal_torque_n_m=run["proximal_torque_n_m"] + 0.1 * run["motor_current_a"]
        )
        for run in geared()
    ]
    finding = _only(runs, motor(), gearbox())
    assert (finding.family, finding.error_of) == ("sensor.crosstalk", "gearbox")
    assert finding.depends_on == ("motor_current",)
    assert finding.parameters["share"].value == pytest.approx(0.1, rel=0.1)


def test_an_encoder_that_slips_at_one_time_of_each_run_is_found() -> None:
    runs = [
        run.with_columns(spindle_angle_rad=run["spindle_angle_rad"] + 2e-4 * (run.time_s > 3.0))
        for run in geared()
    ]
    finding = _only(runs, motor(), gearbox())
    assert (finding.family, finding.place) == ("change.step", "sensor spindle_angle_rad")
    assert finding.parameters["offset"].value == pytest.approx(2e-4, rel=0.1)
    assert finding.parameters["since"].value == pytest.approx(3.0, abs=0.2)


def _three_encoders(late_s: float) -> list[Recording]:
    """Return runs of motor, spindle and jaw; the spindle's encoder is late."""
    random, runs = np.random.default_rng(1), []
    for one in cabled():
        spindle = one["spindle_angle_rad"]
        late = np.interp(one.time_s - late_s, one.time_s, spindle)
        columns = {
            "motor_angle_rad": 35.0 * (spindle + one["proximal_torque_n_m"] / 50.0),
            "spindle_angle_rad": late + random.normal(0.0, 1e-5, len(late)),
        }
        runs.append(one.with_columns(**columns))
    return runs


@pytest.mark.long
def test_the_middle_one_of_three_encoders_is_late_and_not_the_others_early() -> None:
    finding = _only(_three_encoders(0.004), gearbox(), *cable())
    assert {finding.family, *finding.alternatives} == {"sensor.delay", "sensor.lag"}
    assert finding.place == "sensor spindle_angle_rad"
    assert finding.parameters["lateness"].value == pytest.approx(0.004, rel=0.02)


@pytest.mark.long
def test_an_encoder_that_is_late_by_a_millisecond_is_remarked_on() -> None:
    runs = _three_encoders(0.001)
    diagnosis = diagnose(runs, [gearbox(), *cable()], split(runs))
    assert not diagnosis.findings
    (note,) = (n for n in diagnosis.notes if "later than the other angles" in n)
    assert note.startswith("spindle_angle_rad: 1 ms")


def test_a_wave_of_the_slow_shaft_is_no_broken_order_of_the_fast_one() -> None:
    runs = []
    for one in geared():
        wave = 0.01 * np.sin(23.0 * one["spindle_angle_rad"] + 0.4)
        runs.append(one.with_columns(motor_current_a=one["motor_current_a"] + wave))
    finding = _only(runs, motor(), gearbox())
    assert (finding.family, finding.verdict) == ("ripple.output", "identified")
    assert finding.parameters["order"].value == pytest.approx(23.0)


@pytest.mark.long
def test_a_cause_of_several_equations_does_not_stand_in_for_one_of_a_single_equation() -> None:
    runs = [
        r.with_columns(
            proximal_torque_n_m=r["proximal_torque_n_m"] + 5e-4 * r["motor_angle_rad"],
            motor_current_a=r["motor_current_a"] + 1e-3 * r["motor_angle_rad"],
        )
        for r in geared()
    ]
    diagnosis = diagnose(runs, [motor(), gearbox()], split(runs))
    assert {f.family for f in diagnosis.findings} == {"sensor.crosstalk", "spring.position"}


@pytest.mark.long
def test_a_pulley_that_is_not_round_is_one_cause_and_holds_in_both_equations() -> None:
    runs = cabled(wave=0.05)
    found = answer(runs, cable(), split(runs))
    (finding,) = found.diagnosis.findings
    assert (finding.family, finding.verdict) == ("eccentric.load", "identified")
    assert all(e.after < 0.5 * e.before for e in found.diagnosis.errors.values())
    torque, travel = (m.terms[-1] for m in found.models)
    assert (torque.effect.id, travel.effect.id) == (
        "eccentric.load.harmonics",
        "eccentric.load.pulley",
    )
    sine, cosine = (travel.values[f"{wave}_1"].value for wave in ("sine", "cosine"))
    lever_sine, lever_cosine = (torque.values[f"{wave}_1"].value for wave in ("sine", "cosine"))
    order = travel.values["order"].value
    assert (order * sine, -order * cosine) == pytest.approx((lever_cosine, lever_sine), abs=0.01)


def _ratios(runs: list[Recording]) -> tuple[float, float]:
    """Return the cable's ratio from the changes within runs, and with the runs' means as well."""
    names = [run.name for run in runs]
    within = lay_out(cable(), runs, names)
    layouts = within, with_levels(within, names)
    before, after = (x.equations["cable"].channels["distal_torque_n_m"] for x in layouts)
    return before, after


def test_a_load_that_is_held_in_each_run_has_its_ratio_from_the_runs_means() -> None:
    before, after = _ratios(cabled(held=True))
    assert after == pytest.approx(RATIO, rel=0.01)
    assert before < 0.98 * RATIO


def test_zeros_that_scatter_between_runs_leave_a_ratio_as_it_was_within_runs() -> None:
    random = np.random.default_rng(4)
    before, after = _ratios(
        [
            run.with_columns(proximal_torque_n_m=run["proximal_torque_n_m"] + random.normal(0, 0.5))
            for run in cabled()
        ]
    )
    assert after == pytest.approx(before, rel=1e-3)


def test_a_cause_of_some_runs_does_not_free_a_slope_within_runs_from_their_means() -> None:
    """The drag of the load is in its reading, so the slope within runs is another than between."""
    runs = []
    for run in cabled(held=True):
        way = np.tanh(np.gradient(run["spindle_angle_rad"], run.time_s) / 0.06)
        load = run["distal_torque_n_m"]
        torque = run["proximal_torque_n_m"] + (0.003 * RATIO + 0.4 * load) * way
        runs.append(
            run.with_columns(distal_torque_n_m=load + 0.003 * way, proximal_torque_n_m=torque)
        )
    layout = _laid(runs, *cable())
    joint = Joint(layout)
    (place,) = [p for p in places_of(layout) if p.name == "cable"]
    # as good as constant while the cable moves, and present where the load is large
    sources = [s for s in sources_at(layout, place) if s.family == "friction.coulomb_asymmetry"]
    acts = tuple(run.conditions["load_command_a"] > 0.15 for run in runs)
    claims = [Claim(source, acts) for source in sources]
    (one, *_) = best_of_each(assessed(joint, groups_of(joint, claims), folds_of(layout)))
    assert abs(one.gain) < 0.1  # it hardly shows within a run, and changes no error


def test_runs_without_a_cause_show_nothing_of_its_size() -> None:
    """Fitted without the runs that have it, a cause predicts as little for them as no cause."""
    rubs = recordings(lambda angle, speed, load: 0.01 * np.tanh(speed / 2.0))
    runs = [*rubs[:3], *recordings()[3:]]
    layout = _laid(runs, motor())
    joint = Joint(layout)
    place = next(p for p in places_of(layout) if p.name == "motor")
    acts = tuple(k < 3 for k in range(len(runs)))
    claims = [Claim(s, acts) for s in sources_at(layout, place) if s.family == "friction.warmup"]
    found = assessed(joint, groups_of(joint, claims), [[[0, 1, 2]]])
    assert max(abs(one.gain) for one in found) < 0.05
    assert max(one.gain for one in assessed(joint, groups_of(joint, claims), folds_of(layout))) > 1


@pytest.mark.parametrize("known", [True, False])
def test_a_time_over_the_campaign_is_stated_to_lack_pauses_that_are_not_known(known: bool) -> None:
    runs = [r if known else replace(r, started_at_ns=None) for r in recordings()]
    layout = _laid(runs, motor())
    place = next(p for p in places_of(layout) if p.name == "motor")
    sources = list(sources_at(layout, place))

    def said(effect_id: str) -> list[str]:
        (source, *_) = [s for s in sources if s.effect.id == effect_id]
        return list(pauses(runs, [source]))

    assert len(said("friction.warmup.campaign")) == (not known)
    assert not said("friction.warmup")


@pytest.mark.parametrize(
    ("shares", "others"),
    [
        ({"a": 0.92, "b": 0.06}, []),
        ({"a": 0.85, "b": 0.06, "c": 0.03}, ["b"]),  # not sure, though most of what an effect has
        ({"a": 0.42}, []),  # the rest is that of no effect
    ],
)
def test_a_set_has_nearly_all_that_effects_have_unless_one_is_sure(
    shares: dict[str, float], others: list[str]
) -> None:
    assert others_in_set("a", shares) == others


@pytest.mark.parametrize("alike", [1.0, 1e-3, 1e-5])
def test_causes_are_fitted_as_exactly_as_the_base(alike: float) -> None:
    """The residual may be a millionth of its target, and the columns of a cause much alike."""
    random, fine = np.random.default_rng(1), list[Recording]()
    for run in recordings():
        torque = 1.2 * run["motor_current_a"]
        torque += random.normal(0, 1e-6, len(torque))
        fine.append(run.with_columns(proximal_torque_n_m=torque))
    layout = _laid(fine, motor())
    joint = Joint(layout)
    waves = [np.sin(0.07 * np.arange(len(run.grid[run.used["motor"]]))) for run in layout.runs]
    pairs = [
        {"motor": np.column_stack([own, own + alike * random.normal(size=len(own))])}
        for own in waves
    ]
    laid = without_declared(joint, [pairs], [], "each")
    precision = np.full((1, 2), 4.0 / joint.power)
    (apart,) = errors_of(joint, block_of(joint, laid), folds_of(layout)[:1], precision)
    (grown,) = base_errors(joint.with_cause(laid, precision[0]), folds_of(layout)[:1])
    for part in joint.parts:
        assert apart[part][:, 0] == pytest.approx(grown[part], rel=1e-2)


def test_a_cause_that_comes_once_costs_less_than_one_that_comes_and_goes() -> None:
    layout = _laid(recordings(runs=9), motor())
    joint = Joint(layout)
    place = next(p for p in places_of(layout) if p.name == "motor")
    (source, *_) = [s for s in sources_at(layout, place) if s.family == "friction.drag"]
    once = (False,) * 6 + (True,) * 3
    comes_and_goes = (False, True, False) * 3
    claims = [Claim(source, acts) for acts in (once, comes_and_goes)]
    found = {
        one.candidate.acts: one.price.score(DEFAULT)
        for one in tried(joint, groups_of(joint, claims), folds_of(layout))
    }
    assert found[once] < found[comes_and_goes]


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "family"), [(1_175_013, "friction.load"), (1_176_005, "sensor.crosstalk")]
)
def test_a_cause_of_some_runs_is_found(seed: int, family: str) -> None:
    """The first one has an impossible sign in all runs; the second moves their means, too."""
    runs = list(draw(seed, "some_runs", gear_ratio=35.0).recordings)
    finding = _only(runs, *model_file.reference_rig())
    assert finding.family == family


@pytest.mark.long
def test_friction_that_jumps_at_random_times_is_found_without_a_name() -> None:
    random = np.random.default_rng(3)

    def jumping(angle: FloatArray, speed: FloatArray, load: FloatArray) -> FloatArray:
        level = np.repeat(random.choice([-0.008, 0.008], 8), len(speed) // 8)
        return level * np.tanh(speed / 2.0)

    runs = recordings(jumping)
    answer = diagnose(runs, [motor()], split(runs))
    (finding,) = answer.findings
    assert finding.family == "unknown"
    assert finding.depends_on == ("velocity_sign",)
    assert any("changes within runs" in note for note in answer.notes)


def at_levels(levels: Sequence[float], seed: int = 0) -> list[Recording]:
    """Return runs with Coulomb friction that is so much larger in each of them."""
    each = iter(levels)

    def of_run(angle: FloatArray, speed: FloatArray, load: FloatArray) -> FloatArray:
        return next(each) * np.tanh(speed / 2.0)

    return recordings(of_run, seed=seed)


@pytest.mark.parametrize("seed", [1, 2, 3, 8])
def test_friction_of_another_level_in_each_run_has_no_sure_name(seed: int) -> None:
    levels = np.random.default_rng(seed).normal(0.0, 0.008, 12)
    runs = at_levels(list(levels), seed)
    findings = diagnose(runs, [motor()], split(runs)).findings
    assert not [f for f in findings if f.confidence is not None and f.confidence >= 0.9]


@pytest.mark.parametrize("size_n_m", [0.004, 0.015])
def test_friction_of_another_level_in_four_runs_does_not_change_within_runs(
    size_n_m: float,
) -> None:
    sealed = split(at_levels([0.0] * 12))
    names = {*sealed.discover[:2], *sealed.confirm[:2]}
    runs = at_levels([size_n_m * (f"{k:02d}" in names) for k in range(12)])
    answer = diagnose(runs, [motor()], split(runs))
    assert not any("changes within runs" in note for note in answer.notes)
    assert answer.verdict != "nothing_missing"


@pytest.mark.parametrize("size", [0.0, 0.004])
def test_an_error_that_a_finding_leaves_above_the_noise_is_stated(size: float) -> None:
    """A disturbance of random course has no explanation; without one, nothing is stated."""
    random, runs = np.random.default_rng(0), []
    for run in recordings(_rippled):
        steps = random.normal(0.0, 1.0, len(run) + 49)
        slow = size * np.convolve(steps, np.ones(50) / 50**0.5, "valid")
        runs.append(run.with_columns(motor_current_a=run["motor_current_a"] + slow))
    found = diagnose(runs, [motor()], split(runs))
    assert [f.family for f in found.findings] == ["ripple.motor"]
    left = [note for note in found.notes if "times the noise" in note]
    assert bool(left) == bool(size)
    for note in left:
        assert "the error left on the test runs is" in note
        assert "Most of it has no explanation here." in note


@pytest.mark.parametrize("width", [30, 100, 200])
def test_a_disturbance_of_random_course_is_no_friction_that_changes(width: int) -> None:
    random = np.random.default_rng(8)

    def pushed(angle: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        course = gaussian_filter1d(random.normal(size=len(angle)), width)
        return 0.04 * course / course.std()

    runs = turning(pushed)
    assert not diagnose(runs, [axis()], split(runs)).findings


def test_the_test_runs_do_not_reach_the_choice(found: Found) -> None:
    runs = recordings(_rippled)
    held_out = set(split(runs).confirm)
    random = np.random.default_rng(5)
    spoilt = [
        replace(
            r,
            columns={n: random.normal(0, np.std(v), len(v)) for n, v in r.columns.items()},
        )
        if r.name in held_out
        else r
        for r in runs
    ]
    again = _searched(spoilt)
    assert [c.candidate.name for c in again.causes] == [c.candidate.name for c in found.causes]


NOT_DECLARED = """
bearing_angle_rad jaw_angle_rad spindle_angle_rad distal_torque_n_m
hidden_n_m other_a winding_temperature_k extra_position_m
"""
COPIES = st.fixed_dictionaries(
    {
        "name": st.sampled_from(NOT_DECLARED.split()),
        "delay": st.integers(0, 40),
        "scale": st.floats(-5, 5).filter(lambda x: abs(x) > 0.1),
        "integrated": st.booleans(),
        "filtered": st.booleans(),
        "noise": st.floats(0, 0.1),
    }
)
"""A channel that no equation declares, made of an equation's target."""


@settings(max_examples=10)
@given(copy=COPIES)
def test_no_candidate_reads_a_channel_that_no_equation_declares(copy):
    _assert_not_read(**copy)


@pytest.mark.long
@settings(max_examples=500)
@given(copy=COPIES)
def test_no_candidate_reads_any_of_500_copies_of_a_target(copy):
    _assert_not_read(**copy)


def _assert_not_read(name, delay, scale, integrated, filtered, noise):
    random = np.random.default_rng(delay)
    runs = []
    for run in recordings(runs=6):
        values = np.roll(run["proximal_torque_n_m"], delay)
        values = np.cumsum(values) / 250 if integrated else values
        values = np.convolve(values, np.ones(9) / 9, "same") if filtered else values
        noisy = scale * values + random.normal(0, noise, len(values))
        runs.append(run.with_columns(**{name: noisy}))
    layout = _laid(runs, motor())
    read = {
        channel
        for place in places_of(layout)
        for source in sources_at(layout, place)
        for _, channel in source.channels
    }
    assert name not in read


def test_a_known_load_has_no_errors_of_a_sensor() -> None:
    runs, channel = recordings(runs=6), "proximal_torque_n_m"
    known = replace(motor(), signals=replace(motor().signals, loads=(channel,)))
    read, stated = (
        {place.name for place in places_of(lay_out([model], runs, [r.name for r in runs]))}
        for model in (motor(), known)
    )
    assert read - stated == {f"sensor {channel}"}


def test_a_drive_that_is_stated_as_a_torque_has_the_errors_of_a_drive_and_of_a_sensor() -> None:
    runs, channel = recordings(runs=6), "proximal_torque_n_m"
    rest = tuple(t for t in motor().terms if t.effect.id != "motor.torque_constant")
    signals = replace(motor().signals, actuators=(channel,))
    driven = replace(motor(), terms=rest, signals=signals)
    places = {place.name for place in places_of(lay_out([driven], runs, [r.name for r in runs]))}
    assert {f"actuator {channel}", f"sensor {channel}"} <= places


def test_no_candidate_carries_the_noise_of_its_own_equations_torque_sensor() -> None:
    quiet, random = recordings(runs=6), np.random.default_rng(1)
    noisy = []
    for run in quiet:
        torque = run["proximal_torque_n_m"]
        noise = random.normal(0, np.std(torque), len(torque))
        noisy.append(run.with_columns(proximal_torque_n_m=torque + noise))
    names = [r.name for r in quiet]
    layouts = [lay_out([motor()], quiet, names), _laid(noisy, motor())]
    run, channel = layouts[1].runs[0], "proximal_torque_n_m"
    added = (run.channels[channel] - layouts[0].runs[0].channels[channel])[run.grid]
    for place in places_of(layouts[1]):
        for source in sources_at(layouts[1], place):
            columns = source.columns(run)
            for column in [] if columns is None else columns["motor"].T:
                if np.std(column) > 0.0:
                    assert abs(np.corrcoef(column, added[run.used["motor"]])[0, 1]) < 0.3


@pytest.mark.parametrize("every", [1, 2])
def test_a_wave_in_an_encoder_is_differentiated_as_the_channels_are(every: int) -> None:
    """At a low rate the differentiator of the channels takes much off a fast wave."""
    sound = [run.at(np.arange(0, len(run.time_s), every)) for run in recordings(runs=6)]
    order, names = 8.0 / every, [run.name for run in sound]
    waved = [
        run.with_columns(motor_angle_rad=angle + 1e-3 * np.sin(order * angle))
        for run in sound
        for angle in [run["motor_angle_rad"]]
    ]
    layouts = [lay_out([motor()], runs, names) for runs in (sound, waved)]
    add_instruments(layouts[0], names)
    (place,) = [p for p in places_of(layouts[0]) if p.name == "sensor motor_angle_rad"]
    source = next(
        s
        for s in sources_at(layouts[0], place)
        if s.family == "sensor.encoder_inl" and s.shape == (order,)
    )
    left, made = [], []
    for before, after in zip(*(layout.runs for layout in layouts), strict=True):
        columns = source.columns(before)
        made.append(columns["motor"])
        at = before.grid[before.used["motor"]]
        equation = layouts[0].equations["motor"].channels
        left.append(
            sum(w * (after.channels[c][at] - before.channels[c][at]) for c, w in equation.items())
        )
    shown, columns = np.concatenate(left), np.concatenate(made)
    rest = shown - columns @ np.linalg.lstsq(columns, shown, rcond=None)[0]
    assert np.std(rest) < 0.1 * np.std(shown)


def test_each_family_of_folds_leaves_every_run_out_once() -> None:
    families = folds_of(_laid(recordings(runs=9), motor()))
    assert len(families) >= 2
    for family in families:
        assert sorted(k for fold in family for k in fold) == list(range(9))


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_runs_at_a_level_of_the_load_are_left_out_together(count: int) -> None:
    made = recordings(runs=4 * count)
    levels = {r.name: 0.1 + 0.2 * (k % count) for k, r in enumerate(made)}
    layout = _laid(made, motor())
    for run in layout.runs:
        load = run.channels["proximal_torque_n_m"]
        run.channels["proximal_torque_n_m"] = load - load.mean() + levels[run.name]
    by_load = folds_of(layout)[1]
    at = [{levels[layout.runs[k].name] for k in fold} for fold in by_load]
    assert sum(map(len, at)) == count  # no level is in two folds


def test_probabilities_of_families_and_of_no_cause_sum_to_one(found: Found) -> None:
    for ranked in found.conditional:
        assert 0.9 < sum(p.share for p in family_probabilities(ranked, DEFAULT)) <= 1.0


def test_readings_have_noise_and_clocks_have_none() -> None:
    runs = recordings(runs=2)
    for run in lay_out([motor()], runs, [r.name for r in runs]).runs:
        shaken = run.shaken()
        changed = {n for n, x in run.channels.items() if not np.array_equal(x, shaken.channels[n])}
        assert {"motor_current_a", "proximal_torque_n_m"} <= changed
        assert not changed & {"time_s", CAMPAIGN_TIME}


@pytest.mark.long
@pytest.mark.parametrize("seed", [1_050_000, 1_060_004])
def test_nothing_stands_in_for_a_noisy_reading(seed: int) -> None:
    """The load is a spring or a ramp in time, so an angle or a clock has it without its noise."""
    runs = list(draw(seed, "confounded", gear_ratio=35.0).twin.evidence)
    assert diagnose(runs, model_file.reference_rig(), split(runs)).findings == ()


def test_an_offset_of_some_runs_is_found_where_the_means_of_runs_count() -> None:
    runs = [
        run.with_columns(rope_force_n=run["rope_force_n"] + 40.0 * (k >= 7))
        for k, run in enumerate(hoisted())
    ]
    finding = _only(runs, hoist())
    # a friction that is larger in one direction is an offset where the hoist moves
    assert "sensor.offset" in (finding.family, *finding.alternatives)
    assert finding.runs_affected == tuple(run.name for run in runs[7:])
    assert finding.rmse_after < 0.1 * finding.rmse_before
