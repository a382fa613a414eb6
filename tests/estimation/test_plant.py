"""A machine as a value: its file, the equations that follow from it, and what it cannot measure."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import model_file
from estimation.campaign import Campaign
from estimation.derived import measured_channels, zero_phase_channels
from estimation.estimators.model import Stream
from estimation.fitting import fit
from estimation.noise import noise_width, white_noise
from estimation.plant import (
    Actuator,
    Axis,
    Load,
    Part,
    Plant,
    Sensor,
    Transmission,
    Written,
)
from estimation.plant_check import check
from estimation.plant_equations import equations, integrals, missing, signals, unused
from estimation.plant_file import PlantFileError, parse, shipped_plant, to_toml
from estimation.plant_models import declared
from estimation.recording import Recording
from estimation.signals import Combination, Direction, Reading, Share
from rig.reports.fit import parameter_table
from tests.estimation.causes.synthetic import HOIST, hoisted

REFERENCE = to_toml(shipped_plant("reference"))


finite = st.floats(-1e6, 1e6, allow_nan=False)
positive = st.floats(1e-6, 1e6)
words = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@st.composite
def plants(draw):
    """Draw a chain of axes, shafts and carriages, with sensors on some of them."""
    count = draw(st.integers(1, 4))
    units = [draw(st.sampled_from(["rad", "m"])) for _ in range(count)]
    axes = [
        Axis(f"axis_{k}", unit, draw(st.none() | positive | st.just(0.0)), draw(words))
        for k, unit in enumerate(units)
    ]
    joints = [
        Transmission(
            f"joint_{k}",
            f"axis_{k}",
            f"axis_{k + 1}",
            draw(st.none() | positive | positive.map(lambda x: -x)),
            draw(st.booleans()),
            draw(st.booleans()),
        )
        for k in range(count - 1)
    ]
    ends = {
        "rad": ("_angle_rad", "_velocity_rad_s", "_torque_n_m"),
        "m": ("_position_m", "_velocity_m_s", "_force_n"),
    }
    sensors = []
    for axis in axes:
        for reads, end in zip(("position", "speed", "effort"), ends[axis.unit], strict=True):
            if draw(st.booleans()):
                counts, noise = draw(st.none() | positive), draw(st.none() | positive)
                sensors.append(Sensor(f"{axis.name}{end}", axis.name, reads, counts, noise=noise))
    loads = [Load("weight_n_m", "axis_0")] if units[0] == "rad" else []
    parts = (Part("sensor.offset"), Part("friction.load", -1, {"speed": "a_velocity_m_s"}))
    own = (Written("mine", "mine_n", parts),)
    share = Share("a_a", draw(finite), draw(positive))
    direction = draw(st.none() | st.just(Direction("b_velocity_m_s", -1.0, 0.5)))
    bent = Combination("nominal_n", (share,), direction)
    return Plant(
        name=draw(words.map(lambda word: f"m{word}")),
        axes=tuple(axes),
        transmissions=tuple(joints),
        actuators=(Actuator("drive_a", "axis_0"),),
        sensors=tuple(sensors),
        loads=tuple(loads),
        equations=own if draw(st.booleans()) else (),
        derived=(bent,) if draw(st.booleans()) else (),
        description=draw(words),
        cutoff_hz=draw(positive),
        order=draw(st.integers(1, 5)),
        run_offsets=draw(st.booleans()),
    )


@given(plants())
def test_a_machine_file_gives_the_machine_back(plant):
    text = to_toml(plant)
    assert parse(text) == plant
    assert parse(text + '\n[data]\ncolumns = { anything = "at all" }\n') == plant


@given(plants())
def test_every_equation_is_one_that_the_sensors_can_feed(plant):
    known = {"time_s", "drive_a", *(part.name for part in (*plant.sensors, *plant.loads))}
    known |= integrals(plant).keys()  # the recordings of such a machine are opened with them
    own = {equation.name for equation in plant.equations}
    for model in declared(plant):
        needed = measured_channels([*model.channels, model.target], model.signals)
        assert model.balance in own or {*needed} <= known


@given(plants())
def test_a_declared_model_of_any_machine_survives_its_file(plant):
    models = declared(plant)
    if models:
        assert model_file.parse_all(model_file.to_toml(*models)) == models


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('reads = "position"', 'reads = "positon"', r"line \d+: reads.*Did you mean 'position'"),
        ("compliant =", "step =", r"has an unknown key 'step'. Known: name, input, output, ratio,"),
        ("compliant =", "compliannt =", r"line \d+ has an unknown key.*Did you mean 'compliant'"),
        ('input = "motor"', 'input = "moter"', r"line \d+: There is no axis 'moter'.*'motor'"),
        (
            'reads = "position"',
            'counts = 0.0\nreads = "position"',
            r"line \d+: .* has counts = 0. It is more than 0. Write counts = NUMBER",
        ),
        ('unit = "rad"', 'unit = "deg"', r"line \d+: The axis 'motor' has the unit 'deg'.*\"rad\""),
        ("ratio = 35.0", "ratio = 0.0", r"line \d+: The ratio of 'gearbox' is zero"),
        ('name = "spindle"', 'name = "motor"', r"line \d+: There are two of the name 'motor'"),
        ('"distal_torque_n_m"\naxis', '"distal_torque"\naxis', r"line \d+.*carries no unit"),
        ('"jaw_angle_rad"', '"jaw_angle_deg"', r"line \d+.*carries no unit"),
        (
            '"jaw_angle_rad"\naxis = "jaw"',
            '"jaw_rad"\naxis = "jaw"',
            r"line \d+.*ends in _angle_rad",
        ),
        ('deflection = "stretch"', 'deflection = "motor"', "Two equations are called 'motor'"),
        ("cutoff_hz = 50.0", "cutoff_hz = -5.0", r"line \d+: cutoff_hz = -5 is not a cutoff"),
        ("order = 3", "order = 0", r"line \d+: order = 0 is not the order of a filter"),
        ("[machine]", "[machine", "is not TOML"),
        ("rig.machine/1", "rig.machine/9", r"line 1: the schema is not.*Write schema = "),
        ("[[actuator]]", "[[actuater]]", r"line \d+ has an unknown key 'actuater'.*'actuator'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(old, new, message):
    before, _, after = REFERENCE.partition(old)
    assert after
    line = before.count("\n") + 1
    with pytest.raises(
        PlantFileError, match=message.replace(r"line \d+", f"mine.toml, line {line}")
    ):
        parse(before + new + after, "mine.toml")


def test_without_a_torque_sensor_the_drive_is_the_target_and_the_gap_is_named():
    whole = shipped_plant("reference")
    plant = replace(whole, sensors=tuple(s for s in whole.sensors if s.reads != "effort"))
    (drive,) = equations(plant)
    assert drive.target == "motor_current_a"
    assert [(part.id, part.sign, *part.channels.values()) for part in drive.parts] == [
        ("inertia.missing", 1, "motor_acceleration_rad_s2"),
        ("friction.viscous", 1, "motor_velocity_rad_s"),
        ("friction.coulomb", 1, "motor_velocity_rad_s"),
        ("inertia.missing", 1, "spindle_acceleration_rad_s2"),
        ("inertia.missing", 1, "jaw_acceleration_rad_s2"),
        ("sensor.offset", 1),
    ]
    gaps = " ".join(f"{gap.what} {gap.needed}" for gap in missing(plant))
    assert "A sensor of effort (N m) on one of motor, spindle, jaw" in gaps
    assert "The bend of cable cannot be identified" in gaps
    assert unused(plant) == []


def test_the_effort_that_is_needed_of_each_axis_is_in_the_unit_of_that_axis():
    plant = Plant(
        name="belt",
        axes=(Axis("motor", "rad"), Axis("carriage", "m")),
        transmissions=(Transmission("belt", "motor", "carriage", 80.0, compliant=True),),
        actuators=(Actuator("motor_current_a", "motor"),),
        sensors=(Sensor("motor_angle_rad", "motor", "position"),),
    )
    needed = [gap.needed for gap in missing(plant)]
    assert "A sensor of effort on one of motor (N m), carriage (N)." in needed


def test_torque_sensors_without_an_actuator_lead_to_what_drives():
    whole = shipped_plant("reference")
    links = tuple(replace(t, compliant=False) for t in whole.transmissions)
    plant = replace(whole, actuators=(), transmissions=links, loads=())
    assert not equations(plant)
    (gap,) = missing(plant)
    assert "An [[actuator]] in place of the [[sensor]]" in gap.needed


def test_a_parameter_that_comes_out_at_its_bound_is_marked():
    sound, broken = (
        check(SLIDE, Campaign.of([slide(k, viscous=viscous) for k in range(4)]))
        for viscous in (200.0, -60.0)
    )
    assert not any(one.at_bound for one in sound.equations[0].parameters)
    assert [one.name for one in broken.equations[0].parameters if one.at_bound] == ["damping"]


@pytest.mark.parametrize(("width", "is_shown"), [(2e-3, False), (0.02, True)])
def test_a_width_that_the_speeds_of_the_runs_do_not_show_is_marked(width, is_shown):
    runs = Campaign.of([slide(k, width=width) for k in range(4)])
    (equation,) = check(SLIDE, runs).equations
    unknown = [one.name for one in equation.parameters if not one.is_shown]
    assert unknown == ([] if is_shown else ["width"])
    intervals = {row[0]: row[3] for row in parameter_table(fit(declared(SLIDE)[0], runs)).rows}
    assert (intervals["friction.coulomb, width"] == "none") == (not is_shown)
    assert " to " in intervals["friction.coulomb, friction"]


def slide(seed, mass=90.0, viscous=200.0, coulomb=20.0, width=2e-3):
    """Return a run of a carriage in m, its drive in N."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 6.0, 1e-3)
    turns = 2 * np.pi * time_s
    position = 0.1 * np.sin(0.4 * turns) + 0.02 * np.sin(1.1 * turns + seed)
    speed = np.gradient(position, time_s)
    force = mass * np.gradient(speed, time_s) + viscous * speed + coulomb * np.tanh(speed / width)
    force = force + random.normal(0.0, 0.5, force.size)
    return Recording(
        f"run-{seed}", time_s, {"carriage_position_m": position, "drive_force_n": force}
    )


SLIDE = Plant(
    name="slide",
    axes=(Axis("carriage", "m"),),
    actuators=(Actuator("drive_force_n", "carriage"),),
    sensors=(Sensor("carriage_position_m", "carriage", "position", counts=1e6),),
    run_offsets=False,
)


@pytest.mark.parametrize(("noise_m", "is_named"), [(1e-5, True), (1e-7, False)])
def test_noise_of_an_acceleration_that_swamps_the_drive_is_named(noise_m, is_named):
    plant = replace(SLIDE, cutoff_hz=40.0, sensors=(replace(SLIDE.sensors[0], counts=None),))
    runs = []
    for k in range(4):
        run, random = slide(k), np.random.default_rng(k)
        position = run["carriage_position_m"] + random.normal(0.0, noise_m, len(run))
        runs.append(run.with_columns(carriage_position_m=position))
    (equation,) = check(plant, Campaign.of(runs)).equations
    said = " ".join(equation.limits)
    lead = "Most of the residual is noise of carriage_position_m in carriage_acceleration_m_s2."
    assert (lead in said) == is_named
    proposed = re.search(r"cutoff_hz = (\S+) under \[machine\] removes enough", said)
    assert bool(proposed) == is_named
    if proposed:
        lower = replace(plant, cutoff_hz=float(proposed[1]))
        (equation,) = check(lower, Campaign.of(runs)).equations
        assert not equation.limits


@pytest.mark.parametrize(("masses", "is_named"), [((60.0,), True), ((20.0, 40.0, 80.0), False)])
def test_amplitudes_that_one_load_does_not_separate_are_named(masses, is_named):
    runs = [
        replace(run, conditions={"load_mass_kg": masses[k % len(masses)]})
        for k, run in enumerate(hoisted(masses))
    ]
    (equation,) = check(parse(HOIST), Campaign.of(runs)).equations
    said = " ".join(equation.limits)
    named = "motor.torque_constant gain, inertia.missing inertia"
    assert (f"{named}, friction.viscous damping" in said) == is_named
    assert ("In all of them load_mass_kg is 60." in said) == is_named


def test_the_unit_of_a_travel_does_not_matter():
    sensor = Sensor("carriage_angle_rad", "carriage", "position", counts=1e3)
    shaft = replace(SLIDE, axes=(Axis("carriage", "rad"),), sensors=(sensor,))
    runs = [slide(k) for k in range(4)]
    other = [r.with_columns(carriage_angle_rad=1e3 * r["carriage_position_m"]) for r in runs]
    errors = [
        fit(declared(plant)[0], Campaign.of(recordings), bootstrap=0).evidence.rmse
        for plant, recordings in ((SLIDE, runs), (shaft, other))
    ]
    assert errors[0] == pytest.approx(errors[1], rel=1e-4)


def test_what_is_stated_of_a_sensor_replaces_what_its_readings_show():
    exact = replace(SLIDE.sensors[0], noise=2e-5, counts=None, rate_hz=250.0)
    known = signals(replace(SLIDE, sensors=(exact,)))
    made = white_noise(slide(1), ["carriage_position_m"], known)["carriage_position_m"]
    assert np.std(made) == pytest.approx(2e-5, rel=0.1)
    assert np.ptp(made[:4000].reshape(-1, 4), axis=1).max() == 0.0  # held for four samples
    coarse = signals(replace(SLIDE, sensors=(replace(exact, noise=0.0, counts=1e3),)))
    made = white_noise(slide(1), ["carriage_position_m"], coarse)["carriage_position_m"]
    assert np.std(made) == pytest.approx(1e-3 / np.sqrt(12.0), rel=0.1)


def test_a_delay_that_is_stated_is_taken_out():
    late = slide(1)
    shifted = np.roll(late["carriage_position_m"], 20)
    shifted[:20] = shifted[20]
    late = late.with_columns(carriage_position_m=shifted)
    sensor = replace(SLIDE.sensors[0], delay_s=0.0155, rate_hz=100.0)  # and held for 10 ms
    known = signals(replace(SLIDE, sensors=(sensor,)))
    found, wanted = (
        zero_phase_channels(r, ["carriage_velocity_m_s"], signals=s)["carriage_velocity_m_s"]
        for r, s in ((late, known), (slide(1), signals(SLIDE)))
    )
    assert np.abs(found - wanted)[200:-200].max() < 1e-4
    (model,) = declared(replace(SLIDE, sensors=(sensor,)))
    assert model_file.parse(model_file.to_toml(model)) == model


@given(ratio=st.floats(0.5, 200.0), sign=st.sampled_from([1.0, -1.0]))
def test_the_bend_of_a_gear_follows_its_ratio_offline_and_live(ratio, sign):
    whole = shipped_plant("reference")
    gearbox, cable = whole.transmissions
    geared = replace(whole, transmissions=(replace(gearbox, ratio=sign * ratio), cable))
    time_s = np.arange(0.0, 1.0, 1e-3)
    spindle = 0.5 * np.sin(2 * np.pi * time_s)
    bend = 0.01 * np.cos(2 * np.pi * time_s)
    run = Recording(
        "a",
        time_s,
        {
            "motor_angle_rad": sign * ratio * (spindle + bend),
            "spindle_angle_rad": spindle,
            "proximal_torque_n_m": bend / 0.02,
        },
    )
    channels = zero_phase_channels(run, ["gearbox_differential_rad"], signals=signals(geared))
    assert np.abs(channels["gearbox_differential_rad"] - bend)[50:-50].max() < 1e-4
    model = next(m for m in declared(geared) if m.balance == "gearbox")
    fitted = fit(model, Campaign.of([run]), bootstrap=0)
    assert fitted.terms[0].values["compliance"].value == pytest.approx(0.02, rel=1e-2)
    assert Stream(fitted, 1000.0).channels == ("proximal_torque_n_m",)


def test_two_drives_of_one_axis_are_in_one_equation():
    drives = tuple(Actuator(f"{side}_current_a", "carriage") for side in ("left", "right"))
    (equation,) = equations(replace(SLIDE, actuators=drives))
    assert equation.target == "left_current_a"
    assert (equation.parts[0].sign, equation.parts[0].channels) == (
        -1,
        {"source": "right_current_a"},
    )
    cell = Sensor("carriage_force_n", "carriage", "effort")
    (equation,) = equations(replace(SLIDE, actuators=drives, sensors=(*SLIDE.sensors, cell)))
    sources = [p.channels["source"] for p in equation.parts if p.id == "motor.torque_constant"]
    assert sources == ["left_current_a", "right_current_a"]


@pytest.mark.parametrize("count", [0.0, 1e-3])
def test_the_least_change_of_a_moving_axis_is_a_count_only_if_all_changes_are_multiples(count):
    time_s = np.arange(2000) / 500
    position = 10.0 * time_s + np.sin(time_s)
    read = np.round(position / count) * count if count else position
    noise = noise_width(read, Reading())
    assert noise == pytest.approx(count / np.sqrt(12.0), rel=0.2, abs=1e-6)
