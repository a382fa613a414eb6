"""What changed between two campaigns: a planted change is named, and chance is not."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from estimation.changes.compare import ChangesError, compare
from estimation.effects import effect
from estimation.filters import LowPass
from estimation.model import Model, Term
from estimation.recording import Recording
from rig.reports.changes import change_table, lines

RATE_HZ = 200.0
TIME_S = np.arange(0, 12, 1 / RATE_HZ)
SPEEDS = (0.6, 0.8, 1.0, 1.2, 1.4, 1.6)
DECLARED = {"mass": 2.0, "damping": 5.0, "friction": 1.5, "offset": 0.2}
LACKING = ("asymmetry", "stiction", "knock", "ripple", "spot")
MACHINE = {**DECLARED, **dict.fromkeys(LACKING, 0.0), "noise": 0.1}


def equation(target: str, first: Term, friction: int, speed: str) -> Model:
    """Return an equation with friction, of a sign, and an offset."""
    rubbing = [
        Term(effect(f"friction.{kind}"), friction, {"speed": speed})
        for kind in ("viscous", "coulomb")
    ]
    return Model(
        name="declared",
        balance="motor",
        target=target,
        low_pass=LowPass(cutoff_hz=20.0),
        run_offsets=False,
        terms=(first, *rubbing, Term(effect("sensor.offset"), 1, {})),
    )


def axis() -> Model:
    inertia = Term(effect("inertia.missing"), 1, {"acceleration": "axis_acceleration_m_s2"})
    return equation("drive_force_n", inertia, 1, "axis_velocity_m_s")


def record(
    seed: int, only: int | None = None, speeds: Sequence[float] = SPEEDS, **changed: float
) -> list[Recording]:
    """Return a campaign of an axis that moves at six speeds."""
    machine = {**MACHINE, **changed}
    random = np.random.default_rng(seed)
    runs = []
    for k, scale in enumerate(speeds):
        if only is not None and k != only:
            continue
        phase = random.uniform(0, 2 * np.pi, 2)
        position = 0.2 * np.sin(2 * np.pi * 0.4 * scale * TIME_S + phase[0])
        position += 0.1 * np.sin(2 * np.pi * 0.13 * TIME_S + phase[1])
        speed = np.gradient(position, TIME_S)
        force = machine["mass"] * np.gradient(speed, TIME_S) + machine["damping"] * speed
        force += machine["friction"] * np.tanh(speed / 0.01) + machine["offset"]
        force += machine["asymmetry"] * np.abs(speed)
        force += machine["stiction"] * np.exp(-np.abs(speed) / 0.05) * np.tanh(speed / 0.01)
        force += machine["ripple"] * np.sin(2 * np.pi * position / 0.02)
        force += machine["knock"] * (TIME_S > 7.0)
        there = np.exp(-(((position - 0.1) / 0.03) ** 2))
        force += machine["spot"] * there * np.tanh(speed / 0.01)
        force += random.normal(0, machine["noise"], TIME_S.size) + random.normal(0, 0.02)
        columns = {"axis_position_m": position, "drive_force_n": force}
        conditions = {"speed_ratio": scale}
        runs.append(Recording(f"{k:02d}", TIME_S, columns, conditions=conditions))
    return runs


@pytest.mark.parametrize(
    ("changed", "name", "parameter", "change"),
    [
        ({"mass": 2.2}, "inertia.missing inertia of motor", "inertia", 0.2),
        ({"damping": 6.0}, "friction.viscous damping of motor", "damping", 1.0),
        ({"friction": 1.2}, "friction.coulomb friction of motor", "friction", -0.3),
        ({"offset": 0.5}, "sensor.offset offset of motor", "offset", 0.3),
    ],
)
def test_a_parameter_that_moved_is_named_with_its_size(changed, name, parameter, change):
    (found,) = compare(record(1), record(2, **changed), [axis()]).changes
    assert found.name == name
    assert found.verdict == ("moved" if found.confidence >= 0.9 else "one_of")
    low, high = found.ci95[parameter]
    assert low <= found.parameters[parameter] <= high
    assert found.parameters[parameter] == pytest.approx(change, rel=0.15)
    known = DECLARED[next(iter(changed))]
    assert found.before[parameter] == pytest.approx(known, rel=0.15)


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"mass": 2.2}, "inertia.missing inertia of motor"),
        ({"friction": 1.2}, "friction.coulomb friction of motor"),
    ],
)
def test_a_parameter_that_moved_is_named_where_each_campaign_has_a_speed_of_its_own(changed, name):
    """To leave out a level of the speed is then to leave out a campaign, and its change with it."""
    slow, fast = np.linspace(0.8, 0.82, 6), np.linspace(1.3, 1.32, 6)
    (found,) = compare(record(1, speeds=slow), record(2, speeds=fast, **changed), [axis()]).changes
    assert found.name == name


def test_a_drive_that_gives_another_torque_an_ampere_is_named_where_it_is_the_target():
    def currents(seed: int, ratio: float) -> list[Recording]:
        return [
            run.with_columns(drive_current_a=ratio * run["drive_force_n"]) for run in record(seed)
        ]

    model = replace(axis(), target="drive_current_a")
    (found,) = compare(currents(1, 1.0), currents(2, 1.25), [model]).changes
    assert found.name == "gain of actuator drive_current_a"
    assert found.parameters["gain"] == pytest.approx(1 / 1.25 - 1, abs=0.003)  # after over before
    low, high = found.ci95["gain"]
    assert low < 1 / 1.25 - 1 < high


def test_a_gain_of_the_cell_is_named_where_all_terms_differ_by_one_factor():
    def behind_a_drive(seed: int, gain: float) -> list[Recording]:
        random, out = np.random.default_rng(seed), []
        for run in record(seed):
            force = 3.0 * np.sin(2.0 * TIME_S + random.uniform(0.0, 6.0))
            current = (force + run["drive_force_n"]) / 2.0
            cell = gain * force + random.normal(0, 0.01, TIME_S.size)
            out.append(run.with_columns(drive_current_a=current, cell_force_n=cell))
        return out

    constant = Term(effect("motor.torque_constant"), 1, {"source": "drive_current_a"})
    model = equation("cell_force_n", constant, -1, "axis_velocity_m_s")
    mass = Term(effect("inertia.missing"), -1, {"acceleration": "axis_acceleration_m_s2"})
    model = replace(model, terms=(*model.terms, mass))
    (change,) = compare(behind_a_drive(1, 1.0), behind_a_drive(2, 1.05), [model]).changes
    assert change.name == "gain of sensor cell_force_n"
    assert change.parameters["gain"] == pytest.approx(0.05, abs=0.005)


def dated(runs: Sequence[Recording], day: int) -> list[Recording]:
    """Return runs that were recorded at noon of a day, an hour apart."""
    hours = 24 * (20_000 + day)  # since 1970
    return [replace(r, started_at_ns=(hours + k) * int(36e11)) for k, r in enumerate(runs)]


@pytest.mark.parametrize(
    ("before", "after", "day", "verdict", "family"),
    [
        ({}, {"asymmetry": 2.0}, 5, "came", "friction.viscous_asymmetry"),
        ({"asymmetry": 2.0}, {}, 3, "went", "friction.viscous_asymmetry"),  # recorded before
        ({}, {"knock": 1.0}, 3, "came", "change.step"),  # of the sensor, in every run
    ],
)
def test_an_effect_that_came_and_one_that_went(before, after, day, verdict, family):
    first, second = dated(record(1, **before), 4), dated(record(2, **after), day)
    third = dated(record(3, **after), 6)
    difference = compare(first, second, [axis()], on=third)
    (found,) = difference.changes
    assert (found.verdict, found.family) == (verdict, family)
    predicted = difference.predicted["motor"]
    assert predicted.as_b < 0.9 * predicted.as_a


def test_a_ripple_that_came_is_stated_with_its_period():
    found = compare(record(1), record(2, ripple=0.5), [axis()])
    sentence = next(lines(found))
    assert sentence.startswith("New effect: ripple.motor at motor, ")
    period = re.search(r", period (\S+) m \(confidence", sentence)
    assert float(period[1]) == pytest.approx(0.02, rel=0.005)
    (change,) = found.changes
    assert change.unit["order"] == "rad/m"
    assert 2.0 * np.pi / change.shape["order"] == pytest.approx(0.02, rel=0.002)


def test_a_change_of_unknown_form_is_stated_by_what_it_depends_on():
    difference = compare(record(1), record(2, spot=1.0), [axis()])
    (found,) = difference.changes
    assert (found.verdict, found.how) == ("depends_on", "came")
    assert {*found.depends_on} == {"velocity_sign", "axis_position"}
    sentence = next(lines(difference))
    stated = re.fullmatch(
        r"New effect: unknown at motor, of unknown form; it depends on (.*) \(.*\)\.", sentence
    )
    assert {*stated[1].split(" and ")} == {"velocity sign", "axis position"}
    (row,) = change_table(difference).rows
    assert row[0] == "unknown at motor"


def test_an_equation_that_fits_one_campaign_worse_is_remarked_on():
    difference = compare(record(1), record(2, noise=0.2), [axis()])
    assert not difference.changes
    assert "motor fits the second campaign worse than the first one" in difference.notes[-1]
    assert not compare(record(1), record(2), [axis()]).notes


@pytest.mark.long
def test_chance_is_not_a_change():
    pairs = [(record(seed), record(seed + 100)) for seed in range(20, 30)]
    wrong = [pair for pair in pairs if compare(*pair, [axis()]).changes]
    # at a level of 5 % more than three of ten has a probability of one in a thousand
    assert len(wrong) <= 3


@pytest.mark.long
def test_what_the_model_lacks_in_both_campaigns_is_no_change():
    alike = {"asymmetry": 2.0, "stiction": 1.0}
    pairs = [(record(seed, **alike), record(seed + 100, **alike)) for seed in range(20, 26)]
    assert not any(compare(*pair, [axis()]).changes for pair in pairs)


def test_a_small_change_is_named_next_to_a_friction_that_the_model_lacks():
    lacking = {"asymmetry": 2.0, "stiction": 1.0}
    found = compare(record(1, **lacking), record(2, damping=5.5, **lacking), [axis()]).changes
    assert found[0].name == "friction.viscous damping of motor"
    assert found[0].parameters["damping"] == pytest.approx(0.5, rel=0.3)


def test_a_third_campaign_is_predicted_best_by_the_changed_model():
    first, second = record(1), record(2, damping=6.0)
    third = [replace(run, name=f"c{run.name}") for run in record(3, damping=6.0)]
    predicted = compare(first, second, [axis()], on=third).predicted["motor"]
    assert predicted.as_b < 0.8 * predicted.with_a
    assert predicted.as_b < 0.8 * predicted.as_a
    assert predicted.as_b == pytest.approx(predicted.with_b, rel=0.05)
    assert predicted.unit == "N"


def test_other_conditions_are_remarked_on_and_too_few_runs_refused():
    found = compare(record(1), record(2)[:5], [axis()])
    assert "not recorded under the same conditions" in found.notes[0]
    again = [replace(r, name=f"{r.name} again") for r in record(1)[:2]]
    found = compare(record(1), [*again, *record(2)[2:]], [axis()])
    assert "the same, sample by sample: A:" in found.notes[0]
    assert "again. Is one campaign named twice" in found.notes[0]
    with pytest.raises(ChangesError, match="3 runs"):
        compare(record(1)[:3], record(2), [axis()])


def test_a_change_that_distorts_a_common_fit_does_not_hide_its_equation():
    def runs(scale: int, first: int, **changed: float) -> list[Recording]:
        seeds = range(first, first + 4)
        found = [record(seed, scale, friction=0.4, **changed)[0] for seed in seeds]
        return [replace(run, name=f"{k}") for k, run in enumerate(found)]

    # slow runs with little damping, fast ones with much: of both together friction is negative
    found = compare(runs(0, 1, damping=3.0), runs(5, 11, damping=12.0), [axis()])
    assert not any("not judged" in note for note in found.notes)
    assert found.changes[0].name == "friction.viscous damping of motor"


def held_loads(seed: int, torque_constant: float) -> list[Recording]:
    """Return a campaign whose load is held in each run, so current within runs is friction's."""
    random = np.random.default_rng(seed)
    runs = []
    for k in range(6):
        phase = random.uniform(0, 2 * np.pi, 2)
        angle = 8.0 * np.sin(2 * np.pi * 0.5 * TIME_S + phase[0])
        angle += 5.0 * np.sin(2 * np.pi * 0.17 * TIME_S + phase[1])
        speed = np.gradient(angle, TIME_S)
        torque = 0.02 + 0.008 * k + 5e-3 * np.tanh(speed / 0.3)
        torque += 1e-4 * speed + 1e-3 * np.sin(angle / 4.0)
        needed = torque + 8e-3 * np.tanh(speed / 0.3) + 6e-5 * speed
        columns = {
            "motor_angle_rad": angle,
            "motor_current_a": needed / torque_constant + random.normal(0, 0.02, TIME_S.size),
            "proximal_torque_n_m": torque + random.normal(0, 2e-4, TIME_S.size),
        }
        runs.append(Recording(f"{k:02d}", TIME_S, columns, conditions={"load": k}))
    return runs


def motor() -> Model:
    constant = Term(effect("motor.torque_constant"), 1, {"source": "motor_current_a"})
    return equation("proximal_torque_n_m", constant, -1, "motor_velocity_rad_s")


def test_a_torque_constant_that_moved_is_named_where_friction_could_stand_in_for_the_current():
    difference = compare(held_loads(1, 0.02), held_loads(2, 0.011), [motor()])
    (found,) = difference.changes
    assert found.name == "motor.torque_constant gain of motor"
    assert "arameter: motor.torque_constant gain of motor, gain -0.00" in next(lines(difference))
    assert found.parameters["gain"] == pytest.approx(-0.009, rel=0.2)
    assert not compare(held_loads(1, 0.02), held_loads(2, 0.02), [motor()]).changes


def test_a_torque_constant_that_moved_is_named_where_all_torque_is_friction_of_the_load():
    """A negative friction of the motor would describe both campaigns without the current."""

    def rubbing(seed: int, torque_constant: float) -> list[Recording]:
        runs, random = [], np.random.default_rng(seed)
        for run in held_loads(seed, torque_constant):
            speed = np.gradient(run["motor_angle_rad"], TIME_S)
            torque = 6e-3 * np.tanh(speed / 0.3) + 1e-4 * speed
            noise = random.normal(0, [[1e-3], [7e-5]], (2, TIME_S.size))
            columns = {
                "motor_current_a": torque / torque_constant + noise[0],
                "proximal_torque_n_m": torque + noise[1],
            }
            runs.append(run.with_columns(**columns))
        return runs

    (found,) = compare(rubbing(1, 0.02), rubbing(2, 0.011), [motor()]).changes
    assert found.name == "motor.torque_constant gain of motor"
    assert not compare(rubbing(1, 0.02), rubbing(2, 0.02), [motor()]).changes
