"""Machines other than the reference rig: cylinders, winches, belts, joints with a torque cell."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from estimation import plant_file
from estimation.causes.candidates import candidates, every_claim
from estimation.causes.folds import folds_of, unvaried
from estimation.causes.instruments import add_instruments
from estimation.causes.joint import Joint
from estimation.causes.layout import lay_out
from estimation.causes.ranking import Ranking
from estimation.causes.verdict import diagnose
from estimation.diagnosis.result import Finding
from estimation.diagnosis.split import split
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import axis, turning

pytestmark = pytest.mark.long

RATE_HZ, SECONDS, RUNS = 100.0, 12.0, 10

CYLINDER = """
schema = "rig.machine/1"
machine = { name = "cylinder", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "piston", unit = "m" }]
sensor = [
  { name = "piston_position_m", axis = "piston", reads = "position" },
  { name = "head_pressure_pa", reads = "other" },
  { name = "rod_pressure_pa", reads = "other" },
]
[[equation]]
name = "cylinder"
target = "head_pressure_pa"
effects = [
  { id = "transmission.ratio", channels = { load = "rod_pressure_pa" } },
  { id = "friction.coulomb", channels = { speed = "piston_velocity_m_s" } },
  { id = "friction.viscous", channels = { speed = "piston_velocity_m_s" } },
  { id = "sensor.offset" },
]
"""

WINCH = """
schema = "rig.machine/1"
machine = { name = "winch", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "motor", unit = "rad" }]
actuator = [{ name = "motor_current_a", axis = "motor" }]
sensor = [
  { name = "motor_angle_rad", axis = "motor", reads = "position" },
  { name = "rope_torque_n_m", axis = "motor", reads = "effort" },
]
"""

PRESS = """
schema = "rig.machine/1"
machine = { name = "press", cutoff_hz = 20.0 }
axis = [{ name = "ram", unit = "m" }]
actuator = [{ name = "motor_current_a", axis = "ram" }]
sensor = [
  { name = "ram_position_m", axis = "ram", reads = "position" },
  { name = "load_force_n", axis = "ram", reads = "effort" },
]
"""

BELT = """
schema = "rig.machine/1"
machine = { name = "belt", cutoff_hz = 20.0 }
axis = [{ name = "pulley", unit = "rad" }, { name = "carriage", unit = "m" }]
sensor = [
  { name = "pulley_angle_rad", axis = "pulley", reads = "position" },
  { name = "carriage_position_m", axis = "carriage", reads = "position" },
]
[[equation]]
name = "scale"
target = "carriage_position_m"
samples = "all"
effects = [
  { id = "transmission.ratio", channels = { load = "pulley_angle_rad" } },
  { id = "inertia.missing", sign = -1, channels = { acceleration = "carriage_acceleration_m_s2" } },
  { id = "sensor.offset" },
]
"""

Motion = Callable[..., dict[str, FloatArray]]


def recorded(columns_of: Motion) -> list[Recording]:
    """Return runs of random waves, whose columns follow from the motion and the run's number."""
    random = np.random.default_rng(4)
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    out = []
    for k in range(RUNS):
        parts = [
            (random.uniform(0.5, 1.0), random.uniform(0.2, 0.9), random.uniform(0.0, 6.0))
            for _ in range(4)
        ]
        position = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in parts)
        speed = np.gradient(position, time)
        columns = columns_of(k, random, position, speed, np.gradient(speed, time))
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(2e10 * k) + 1))
    return out


def noisy(
    random: np.random.Generator, made: Mapping[str, tuple[FloatArray, float]]
) -> dict[str, FloatArray]:
    """Return columns with white noise; each is given with its noise's standard deviation."""
    return {name: x + random.normal(0.0, noise, len(x)) for name, (x, noise) in made.items()}


def found_in(machine: str, recordings: Sequence[Recording]) -> tuple[Finding, ...]:
    models = declared(plant_file.parse(machine))
    return diagnose(recordings, models, split(recordings)).findings


def test_friction_grows_with_a_pressure():
    def columns(k, random, position, speed, acceleration):
        rod = 1e5 * (60.0 + 40.0 * (k % 3)) + 2e5 * position
        head = 0.6 * rod + (5e4 + 0.02 * rod) * np.tanh(speed / 0.05) + 2e4 * speed
        return {
            "piston_position_m": 0.1 * position,
            "rod_pressure_pa": rod + random.normal(0.0, 3e3, len(rod)),
            "head_pressure_pa": head + random.normal(0.0, 3e3, len(rod)),
        }

    (finding,) = found_in(CYLINDER, recorded(columns))
    assert (finding.verdict, finding.family) == ("identified", "friction.load")
    assert finding.parameters["friction"].value == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize(
    ("rubs", "grows", "family"),
    [(0.08, 0.0, "friction.load"), (0.0, 0.02, "motor.gain_by_position")],
)
def test_a_load_that_is_held_in_each_run_shows_by_what_it_does(rubs, grows, family):
    """The drive's constant is known from the runs' means alone: within a run the load is held."""

    def columns(k, random, position, speed, acceleration):
        load = 20.0 * (k % 5 + 1) + 0.2 * acceleration
        rub = (3.0 + rubs * load) * np.tanh(speed / 0.1)
        current = (load + rub) * (1.0 + grows * position) / 2.0
        return {
            "motor_angle_rad": 3.0 * position,
            "motor_current_a": current + random.normal(0.0, 0.05, len(load)),
            "rope_torque_n_m": load + random.normal(0.0, 0.1, len(load)),
        }

    findings = found_in(WINCH, recorded(columns))
    assert findings[0].family == family
    assert findings[0].confidence > 0.5


def test_play_of_a_carriage_follows_the_pull_of_its_own_mass():
    def columns(k, random, position, speed, acceleration):
        travel = 0.1 * position
        pull = 0.1 * acceleration
        scale = travel - 1e-5 * pull - 4e-5 * np.tanh(pull / 0.02)
        noise = random.normal(0.0, 5e-6, len(travel))
        return {"pulley_angle_rad": travel / 0.02, "carriage_position_m": scale + noise}

    (finding,) = found_in(BELT, recorded(columns))
    assert finding.family == "transmission.backlash"
    assert finding.parameters["gap"].value == pytest.approx(4e-5, rel=0.2)


LEAD_M = 0.005


def _screwed(wave=lambda turns: 0.0, rubs=lambda k: 1.0) -> list[Recording]:
    """Return runs of a press.

    `wave` gives a force over the turns of its screw; the friction of run k has a factor.
    """

    def columns(k, random, position, speed, acceleration):
        travel_m, speed_m_s = 0.01 * position, 0.01 * speed
        load = 100.0 * np.sin(0.6 * position + k)
        pull = load + 30.0 * rubs(k) * np.tanh(speed_m_s / 0.001) + 1.8 * acceleration
        pull += wave(travel_m / LEAD_M)
        made = {
            "motor_current_a": (pull / 400.0, 2e-3),
            "ram_position_m": (travel_m, 1e-6),
            "load_force_n": (load, 1.5),
        }
        return noisy(random, made)

    return recorded(columns)


def test_the_wave_of_a_screw_has_its_period_with_an_interval():
    waves = _screwed(lambda turns: 9.0 * np.sin(2 * np.pi * turns + 0.7))
    (finding,) = found_in(PRESS, waves)
    assert finding.form == "ripple.motor"
    order = finding.parameters["order"]
    low, high = order.ci95
    assert order.value == pytest.approx(2 * np.pi / LEAD_M, rel=3e-3)
    assert low < 2 * np.pi / LEAD_M < high < 1.02 * low


def test_a_dent_that_every_turn_passes_is_a_wave_that_is_not_a_pure_sine():
    dents = _screwed(lambda turns: 25.0 * np.exp(-(((turns % 1.0 - 0.4) / 0.08) ** 2)))
    (finding,) = found_in(PRESS, dents)
    assert (finding.verdict, finding.form) == ("identified", "ripple.motor.harmonics")
    order = finding.parameters["order"].value
    assert order == pytest.approx(2 * np.pi / LEAD_M, rel=3e-3)


def test_a_weight_that_is_stated_has_no_sensor():
    machine = CYLINDER.replace("rod_pressure_pa", "weight_n")

    def columns(k, random, position, speed, acceleration):
        weight = np.full(len(position), 50.0 * k)
        return {
            "piston_position_m": 0.1 * position,
            "weight_n": weight,
            "head_pressure_pa": 500.0 * weight + random.normal(0.0, 3e3, len(weight)),
        }

    runs = recorded(columns)
    laid = lay_out(declared(plant_file.parse(machine)), runs, [run.name for run in runs])
    places = {claim.cause.place.name for claim in every_claim(laid)}
    assert "sensor weight_n" not in places


def test_a_drive_of_another_machine_may_change_its_gain_along_the_travel_whatever_its_name():
    def columns(k, random, position, speed, acceleration):
        torque = 2.0 * position + 0.2 * acceleration + random.normal(0.0, 0.1, len(position))
        current = torque + 0.3 * np.tanh(speed / 0.1)
        return {
            "motor_angle_rad": position,
            "motor_current_a": current,
            "rope_torque_n_m": torque,
        }

    runs = recorded(columns)
    laid = lay_out(declared(plant_file.parse(WINCH)), runs, [run.name for run in runs])
    assert [*laid.equations] == ["motor"]
    assert "motor.gain_by_position" in {claim.cause.family for claim in every_claim(laid)}


def winches(loads: Sequence[float], **more: FloatArray) -> list[Recording]:
    """Return runs of a winch, each at one load."""

    def columns(k, random, position, speed, acceleration):
        load = loads[k % len(loads)] + 0.2 * acceleration + random.normal(0.0, 0.1, len(position))
        current = (load + 3.0 * np.tanh(speed / 0.1)) / 2.0
        return {
            "motor_angle_rad": 3.0 * position,
            "motor_current_a": current + random.normal(0.0, 0.05, len(load)),
            "rope_torque_n_m": load,
            **more,
        }

    return recorded(columns)


def test_a_channel_that_no_equation_reads_may_have_values_that_are_not_numbers():
    size = round(SECONDS * RATE_HZ)
    spoilt = {"oil_temperature_k": np.full(size, np.nan), "pan_angle_rad": np.full(size, np.nan)}
    spoilt["pan_angle_rad"][5:] = 1.0
    models = declared(plant_file.parse(WINCH))
    runs = winches((20.0, 60.0), **spoilt)
    layout = lay_out(models, runs, [run.name for run in runs])
    assert [run.name for run in layout.runs] == [run.name for run in runs]
    assert "rope_torque_n_m" in layout.measured
    assert not {*spoilt} & {*layout.measured}


@pytest.mark.parametrize(
    ("loads", "alike"), [((20.0, 100.0, 180.0), []), ((20.0,), ["rope_torque_n_m"])]
)
def test_a_condition_that_varies_over_few_runs_is_not_called_alike(loads, alike):
    models = declared(plant_file.parse(WINCH))
    runs = winches(loads)[:5]
    layout = lay_out(models, runs, [run.name for run in runs])
    assert [name for name in unvaried(layout) if name.endswith("_n_m")] == alike


def test_two_equations_may_read_the_same_current():
    (one,) = declared(plant_file.parse(WINCH))
    runs = winches((20.0, 60.0, 100.0))
    layout = lay_out([one, replace(one, balance="again")], runs, [run.name for run in runs])
    add_instruments(layout, [run.name for run in runs])
    joint = Joint(layout)
    ranked = Ranking(joint, candidates(joint), folds_of(layout)).next_to([])
    assert ranked


LIFT = """
schema = "rig.machine/1"
machine = { name = "lift", cutoff_hz = 25.0, run_offsets = true }
[[axis]]
name = "carriage"
unit = "m"
[[actuator]]
name = "motor_current_a"
axis = "carriage"
[[sensor]]
name = "carriage_position_m"
axis = "carriage"
reads = "position"
[[sensor]]
name = "load_force_n"
axis = "carriage"
reads = "effort"
"""


def _lifted(
    seed: int, *, gain: float = 0.0, ripple_n: float = 0.0, load_friction: float = 0.0
) -> list[Recording]:
    """Return runs of a lift with three masses.

    Args:
        seed: Of the motion and the noise.
        gain: Share by which the drive is stronger at some places.
        ripple_n: Force that repeats every 10 mm.
        load_friction: Friction for each newton of the load.
    """
    random, time = np.random.default_rng(seed), np.arange(1500) / 250.0
    out = []
    for k in range(14):
        mass, period = (0.0, 16.0, 8.0)[k % 3], (4.0, 3.0, 2.0, 1.5, 1.1)[k % 5]
        phase = (time % period) / period
        share = np.clip((1.0 - np.abs(2.0 * phase - 1.0) - 0.08) / 0.84, 0.0, 1.0)
        size = 0.12 * random.uniform(0.5, 1.1) * (1.0 if period > 1.9 else 0.6)
        place = size * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)
        speed = np.gradient(place, time)
        acceleration = np.gradient(speed, time)
        force = mass * (9.81 + acceleration)
        lost = 22.0 * (9.81 + acceleration) + 180.0 * speed + 28.0 * np.tanh(speed / 0.002)
        lost += ripple_n * np.sin(2.0 * np.pi * place / 0.01 + 0.7)
        lost += load_friction * np.abs(force) * np.tanh(speed / 0.002)
        constant = 90.0 * (1.0 + gain * np.cos(2.0 * np.pi * place / 0.12))
        columns = {
            "motor_current_a": (force + lost) / constant + random.normal(0, 0.015, len(time)),
            "carriage_position_m": place + random.normal(0, 1e-6, len(time)),
            "load_force_n": force + random.normal(0, 1.5, len(time)),
        }
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(1e10 * k) + 1))
    return out


@pytest.mark.parametrize("seed", [0, 1])
def test_the_mass_behind_a_load_cell_is_no_inertia_that_differs(seed: int) -> None:
    """Within a run the cell reads mass times acceleration: as if the drive had less inertia."""
    (model,) = declared(plant_file.parse(LIFT))
    runs = _lifted(seed, gain=0.05)
    found = diagnose(runs, [model], split(runs)).findings
    assert not any(one.verdict == "identified" for one in found)
    assert any("carriage_position" in one.depends_on for one in found)


@pytest.mark.parametrize(
    ("seed", "least"), [(0, set()), (2, {"ripple.motor"}), (5, {"ripple.motor", "friction.load"})]
)
def test_two_effects_of_a_lift_are_not_explained_by_its_load_cell(seed: int, least: set) -> None:
    """Without them the drive's constant is far too small: without its load the cell fits better."""
    (model,) = declared(plant_file.parse(LIFT))
    runs = _lifted(seed, ripple_n=8.0, load_friction=0.08)
    found = {one.family for one in diagnose(runs, [model], split(runs)).findings}
    assert least <= found <= {"ripple.motor", "friction.load", "unknown"}


@pytest.mark.parametrize("factor", [0.3, 0.6, 3.0])
def test_a_load_cell_may_have_another_gain_in_some_runs(factor: float) -> None:
    runs = [
        run.with_columns(crank_torque_n_m=run["crank_torque_n_m"] * (factor if k in has else 1.0))
        for has in [(1, 4, 5)]
        for k, run in enumerate(turning(size=3.0))
    ]
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert (finding.family, finding.runs_affected) == ("sensor.gain", ("01", "04", "05"))
    assert finding.parameters["change"].value == pytest.approx(factor - 1.0, rel=0.02)


CONTACT = """
schema = "rig.machine/1"
machine = { name = "belt", cutoff_hz = 30.0, run_offsets = true }
[[axis]]
name = "motor"
unit = "rad"
[[axis]]
name = "carriage"
unit = "m"
[[transmission]]
name = "belt"
input = "motor"
output = "carriage"
ratio = 83.333333
compliant = false
[[actuator]]
name = "motor_voltage_v"
axis = "motor"
[[sensor]]
name = "motor_angle_rad"
axis = "motor"
reads = "position"
counts = 318.3098861837907
[[sensor]]
name = "carriage_position_m"
axis = "carriage"
reads = "position"
counts = 100000
[[sensor]]
name = "tool_force_n"
axis = "carriage"
reads = "effort"
[[derived]]
name = "belt_stretch_m"
shares = [
  { channel = "motor_angle_rad", over = 83.333333 },
  { channel = "carriage_position_m", times = -1.0 },
]
[[equation]]
name = "stretch"
target = "belt_stretch_m"
effects = [
  { id = "compliance.link", channels.load = "tool_force_n" },
  { id = "inertia.missing", channels.acceleration = "carriage_acceleration_m_s2" },
  { id = "friction.viscous", channels.speed = "carriage_velocity_m_s" },
  { id = "friction.coulomb", channels.speed = "carriage_velocity_m_s" },
  { id = "sensor.offset" },
]
"""


def _touching(seed: int, *, wall_m: float = 0.03, jump_n: float = 0.0) -> list[Recording]:
    """Return runs of a carriage that touches a spring at one end; its encoders count.

    Friction may be larger by a jump on one half of the travel, in one direction.
    """
    random, time = np.random.default_rng(seed), np.arange(4000) / 500.0
    out = []
    for k in range(12):
        waves = zip(random.uniform(0.15, 0.9, 3), random.uniform(0, 2 * np.pi, 3), strict=True)
        place = 0.06 * sum(np.sin(2 * np.pi * f * time + p) for f, p in waves) / 3
        speed = np.gradient(place, time)
        acceleration = np.gradient(speed, time)
        force = 600.0 * (1 + k % 3) * np.maximum(0.0, place - wall_m)
        belt = force + 1.0 * acceleration + 8.0 * speed + 2.0 * np.tanh(speed / 0.005)
        angle = 83.333333 * (place + 1.7e-5 * belt)
        belt += jump_n * ((place > 0.0) & (speed > 0.0))
        turned = np.gradient(np.gradient(angle, time), time)
        volts = (belt + 1.5 * turned / 83.333333 + 15.0 * speed) / 4.0
        counts = [np.round(x * c) / c for x, c in ((angle, 318.3098861837907), (place, 100000))]
        columns = {
            "motor_voltage_v": volts + random.normal(0, 0.02, len(time)),
            "motor_angle_rad": counts[0],
            "carriage_position_m": counts[1],
            "tool_force_n": force + random.normal(0, 0.25, len(time)),
        }
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(1e10 * k) + 1))
    return out


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_force_of_one_sign_that_another_sensor_predicts_is_not_an_effect(seed: int) -> None:
    """The prediction has the noise of the encoder that the stretch is read by."""
    models = declared(plant_file.parse(CONTACT))
    runs = _touching(seed)
    assert diagnose(runs, models, split(runs)).findings == ()


@pytest.mark.parametrize("seed", [0, 3])
def test_what_depends_on_the_place_does_not_depend_on_the_load_by_its_estimate(seed: int) -> None:
    """Where nothing is touched, the estimate of the force is the effect itself."""
    (model,) = declared(plant_file.parse(CONTACT.partition("[[derived]]")[0]))
    runs = _touching(seed, wall_m=0.045, jump_n=2.0)
    found = diagnose(runs, [model], split(runs)).findings
    assert "carriage_position" in found[0].depends_on
    assert not any("load" in one.depends_on for one in found)


TWO_LOADS = """
schema = "rig.machine/1"
machine = { name = "press of two cells", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "ram", unit = "m" }]
sensor = [
  { name = "ram_position_m", axis = "ram", reads = "position" },
  { name = "drive_force_n", reads = "other" },
  { name = "left_force_n", reads = "other" },
  { name = "right_force_n", reads = "other" },
]
[[equation]]
name = "ram"
target = "drive_force_n"
effects = [
  { id = "transmission.ratio", channels = { load = "left_force_n" } },
  { id = "transmission.ratio", channels = { load = "right_force_n" } },
  { id = "friction.coulomb", channels = { speed = "ram_velocity_m_s" } },
  { id = "sensor.offset" },
]
"""


@pytest.mark.parametrize("loaded", ["left", "right"])
def test_friction_may_grow_with_either_of_two_loads(loaded):
    def columns(k, random, position, speed, acceleration):
        loads = {
            "left": 40.0 + 20.0 * (k % 3) + 10.0 * position,
            "right": 40.0 + 20.0 * ((k // 3) % 3) + 5.0 * speed,
        }
        drive = sum(loads.values()) + (4.0 + 0.08 * loads[loaded]) * np.tanh(speed / 0.05)
        made = {"ram_position_m": 0.1 * position, "drive_force_n": drive}
        made |= {f"{side}_force_n": load for side, load in loads.items()}
        return {
            name: values + (name != "ram_position_m") * random.normal(0.0, 0.1, len(values))
            for name, values in made.items()
        }

    (finding,) = found_in(TWO_LOADS, recorded(columns))
    assert (finding.verdict, finding.family) == ("identified", "friction.load")
    assert finding.parameters["friction"].value == pytest.approx(0.08, rel=0.1)


@pytest.mark.parametrize("changes", ["sensor", "motor"])
def test_a_gain_that_changes_along_the_travel_is_that_of_the_sensor_or_of_the_drive(changes):
    """The cell reads the load alone, the current has the friction too."""

    def columns(k, random, position, speed, acceleration):
        gain = 1.0 + 0.2 * position
        load = 40.0 * (k % 3 + 1) + 10.0 * np.sin(0.7 * np.arange(len(position)) / RATE_HZ + k)
        drive = load + 6.0 * np.tanh(speed / 0.05) + 4.0 * speed + 0.3 * acceleration
        return {
            "ram_position_m": 0.1 * position,
            "motor_current_a": drive / 20.0 / (gain if changes == "motor" else 1.0)
            + random.normal(0.0, 0.02, len(load)),
            "load_force_n": load * (gain if changes == "sensor" else 1.0)
            + random.normal(0.0, 0.2, len(load)),
        }

    (finding,) = found_in(PRESS, recorded(columns))
    assert (finding.verdict, finding.family) == ("identified", f"{changes}.gain_by_position")


ELASTIC = """
schema = "rig.machine/1"
machine = { name = "elastic joint", cutoff_hz = 20.0 }
axis = [{ name = "motor", unit = "rad" }, { name = "joint", unit = "rad" }]
transmission = [
  { name = "gear", input = "motor", output = "joint", ratio = 10.0, compliant = true },
]
actuator = [{ name = "motor_current_a", axis = "motor" }]
sensor = [
  { name = "motor_angle_rad", axis = "motor", reads = "position" },
  { name = "joint_angle_rad", axis = "joint", reads = "position" },
  { name = "joint_torque_n_m", axis = "joint", reads = "effort" },
]
"""


def _exact(torque: FloatArray, motor: FloatArray) -> FloatArray:
    return torque


def _elastic(
    reads=_exact,
    *,
    bends=lambda k, position: 1.0,
    rubs=lambda k: 1.0,
    led=lambda position: position,
    hidden=lambda speed, acceleration: 0.0,
):
    """Return the columns of a joint behind a spring.

    `reads` gives the cell's reading from torque and motor angle, and `hidden` the torque that does
    not reach the cell; the bend and the viscous friction of run k have a factor, and `led` gives
    the way of the motor, on the side of the joint.
    """

    def columns(k, random, position, speed, acceleration):
        torque = 10.0 * (1 + k % 3) * np.sin(position) + 2.0 * acceleration
        motor = 10.0 * (led(position) + bends(k, position) * torque / 800.0)
        turned = RATE_HZ * np.gradient(motor)
        drive = torque / 10.0 + 0.2 * np.tanh(turned / 0.5) + 0.03 * rubs(k) * turned
        made = {
            "motor_angle_rad": (motor, 1e-4),
            "joint_angle_rad": (position, 1e-5),
            "joint_torque_n_m": (reads(torque - hidden(speed, acceleration), motor), 0.05),
            "motor_current_a": (drive / 0.2, 0.02),
        }
        return noisy(random, made)

    return recorded(columns)


@pytest.mark.parametrize(
    ("reads", "family"),
    [
        (lambda torque, motor: torque + 0.2 * np.abs(torque), "sensor.gain_nonlinear"),
        (lambda torque, motor: torque + 0.001 * torque**2, "sensor.gain_nonlinear"),
        (lambda torque, motor: torque + 0.8 * np.sin(2.0 * motor), "ripple.sensor"),
    ],
    ids=["gain by side", "curve", "ripple"],
)
def test_an_error_of_a_cell_that_two_equations_read_is_one_finding(reads, family):
    """As a torque and as a bend it would be two effects."""
    (finding,) = found_in(ELASTIC, _elastic(reads))
    assert (finding.verdict, finding.family) == ("identified", family)
    assert finding.place == "sensor joint_torque_n_m"


@pytest.mark.parametrize(
    ("hidden", "family"),
    [
        (lambda speed, acceleration: 1.5 * np.tanh(speed / 0.05), "friction.coulomb"),
        (lambda speed, acceleration: 0.1 * acceleration, "inertia.missing"),
    ],
    ids=["friction", "inertia"],
)
def test_a_torque_that_bends_a_spring_and_does_not_reach_the_cell_is_found(hidden, family):
    """Bearing and mass of the joint are between the spring and the torque cell."""
    finding, *_ = found_in(ELASTIC, _elastic(hidden=hidden))
    assert (finding.family, finding.place) == (family, "torque at joint_torque_n_m")


def _looped(load: FloatArray, reach: float) -> FloatArray:
    """Return a loop over the load, -1 to 1, that follows it exponentially."""
    state, loop = 0.0, np.zeros(len(load))
    for k, step in enumerate(np.diff(load, prepend=load[0])):
        state += (step - abs(step) * state) / reach
        loop[k] = state
    return loop


def test_a_cell_with_hysteresis_that_two_equations_read_is_one_finding():
    """A loop over a noisy reading shows by its odd part, which is nearly that of play."""

    def reads(torque, motor):
        return torque - 0.6 * _looped(torque, 2.0)

    (finding,) = found_in(ELASTIC, _elastic(reads))
    assert "sensor.hysteresis" in {finding.family, *finding.alternatives}


def test_hysteresis_of_a_cell_is_among_the_causes_where_one_equation_reads_it():
    def columns(k, random, position, speed, acceleration):
        rope = (1.5, 4.5, 9.0)[k % 3] + 3.0 * np.sin(2.0 * position) + 0.2 * acceleration
        drive = rope + 0.4 * np.tanh(speed / 0.1) + speed
        made = {"motor_angle_rad": (position, 1e-5), "motor_current_a": (drive / 2.4, 0.01)}
        made |= {"rope_torque_n_m": (rope - 0.5 * _looped(rope, 0.5), 0.05)}
        return noisy(random, made)

    (finding,) = found_in(WINCH, recorded(columns))
    assert "sensor.hysteresis" in {finding.family, *finding.alternatives}


def test_a_torque_cell_of_another_gain_in_some_runs_is_named_by_that_gain():
    def columns(k, random, position, speed, acceleration):
        torque = 25.0 * np.sin(position) + 2.0 * acceleration
        rub = 0.05 * np.tanh(speed / 0.05) + 2e-3 * speed
        noise = random.normal(0.0, [[3e-6], [2e-3], [0.03]], (3, len(torque)))
        reading = torque * (1.05 if k >= 5 else 1.0)
        return {
            "motor_angle_rad": 10.0 * (position + torque / 2e4),
            "joint_angle_rad": position + noise[0],
            "motor_current_a": (0.1 * torque + rub) / 0.1 + noise[1],
            "joint_torque_n_m": reading + noise[2],
        }

    (finding,) = found_in(ELASTIC, recorded(columns))
    assert finding.family == "sensor.gain"
    assert set(finding.runs_affected) == {f"{k:02d}" for k in range(5, RUNS)}
    assert finding.parameters["change"].value == pytest.approx(0.05, rel=0.1)


def _cold(k: int) -> float:
    return float(1.0 + 0.4 * np.exp(-k / 4.0))


@pytest.mark.parametrize(
    ("changes", "form"),
    [
        ({"bends": lambda k, position: _cold(k)}, "transmission.thermal.campaign"),
        ({"rubs": _cold}, "friction.warmup.viscous.campaign"),
    ],
    ids=["compliance", "damping"],
)
def test_a_bend_or_a_viscous_friction_may_settle_over_a_campaign(changes, form):
    (finding,) = found_in(ELASTIC, _elastic(**changes))
    assert (finding.verdict, finding.form) == ("identified", form)


def test_a_ratio_that_is_not_the_declared_one_is_an_error_of_scale():
    (finding,) = found_in(ELASTIC, _elastic(led=lambda position: 1.01 * position))
    assert (finding.verdict, finding.family) == ("identified", "transmission.scale_error")
    assert abs(finding.parameters["share"].value) == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "form"),
    [
        (
            {"bends": lambda k, position: 1.0 + 0.3 * position},
            "transmission.compliance_by_position",
        ),
        (
            {"led": lambda position: position + 0.01 * position**2},
            "transmission.scale_error.curved",
        ),
    ],
    ids=["compliance", "lead"],
)
def test_a_bend_or_a_lead_may_change_along_the_travel(changes, form):
    (finding,) = found_in(ELASTIC, _elastic(**changes))
    assert (finding.verdict, finding.form) == ("identified", form)


SCREW = """
schema = "rig.machine/1"
machine = { name = "screw", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "screw", unit = "rad" }, { name = "table", unit = "m" }]
transmission = [
  { name = "nut", input = "screw", output = "table", ratio = 500.0, compliant = true },
]
actuator = [{ name = "screw_current_a", axis = "screw" }]
sensor = [
  { name = "screw_angle_rad", axis = "screw", reads = "position" },
  { name = "table_position_m", axis = "table", reads = "position" },
  { name = "table_force_n", axis = "table", reads = "effort" },
  { name = "nut_temperature_k", axis = "table", reads = "temperature" },
]
"""


def test_an_effect_shows_where_the_declared_parameter_is_at_its_bound():
    """The screw is so stiff that expansion, which moves with the load, hides its compliance."""

    def columns(k, random, position, speed, acceleration):
        temperature = 294.0 + 12.0 * (k + np.linspace(0.0, 1.0, len(position))) / RUNS
        table = 0.1 * position
        load = 40.0 * acceleration + 60.0 * np.tanh(speed / 0.05)
        turned = 500.0 * (table + 2e-4 * table * (temperature - 294.0) + load / 2e7)
        drive = load / 500.0 + 0.1 * np.tanh(speed / 0.05)
        made = {"screw_angle_rad": (turned, 3e-4), "table_position_m": (table, 4e-7)}
        made |= {"screw_current_a": (drive / 0.2, 0.02), "table_force_n": (load, 1.0)}
        return noisy(random, made) | {"nut_temperature_k": temperature}

    findings = found_in(SCREW, recorded(columns))
    assert findings[0].form == "transmission.scale_error.thermal"
    assert findings[0].parameters["rate"].value == pytest.approx(2e-4, rel=0.1)


def test_a_cell_behind_a_slow_filter_is_late_by_a_lag_or_a_delay():
    """The rate of so late a reading is mostly noise, but over a part of its lag."""

    def columns(k, random, position, speed, acceleration):
        slow = np.sin(2.0 * np.pi * 0.4 * np.arange(len(position)) / RATE_HZ + k)
        rope = (1.5, 4.5, 9.0)[k % 3] + 3.0 * slow
        drive = rope + 0.4 * np.tanh(speed / 0.1) + speed
        part = 1.0 / (0.15 * RATE_HZ)
        late = lfilter([part], [1.0, part - 1.0], rope - rope[0]) + rope[0]
        made = {"motor_angle_rad": (position, 1e-5), "motor_current_a": (drive / 2.4, 0.05)}
        return noisy(random, made | {"rope_torque_n_m": (late, 0.05)})

    (finding,) = found_in(WINCH, recorded(columns))
    assert "sensor.lag" in (finding.family, *finding.alternatives)
    assert finding.rmse_after < 0.05


def test_a_pressure_behind_a_filter_is_late_by_a_lag():
    def columns(k, random, position, speed, acceleration):
        rod = 1e5 * (60.0 + 40.0 * (k % 3)) + 2e5 * position
        head = 0.6 * rod + 5e4 * np.tanh(speed / 0.05) + 2e4 * speed
        late = lfilter([0.25], [1.0, -0.75], head - head[0]) + head[0]  # 30 ms
        return {
            "piston_position_m": 0.1 * position,
            "rod_pressure_pa": rod + random.normal(0.0, 1e3, len(rod)),
            "head_pressure_pa": late + random.normal(0.0, 1e3, len(rod)),
        }

    (finding,) = found_in(CYLINDER, recorded(columns))
    assert "sensor.lag" in (finding.family, *finding.alternatives)


def test_a_zero_that_moved_between_runs_does_not_draw_the_width_of_friction():
    """With one zero for all runs, friction would change its sign over a far wider range."""

    def columns(k, random, position, speed, acceleration):
        rope = (1.5, 4.5, 9.0, 15.0)[k % 4] * (1.0 + 0.02 * acceleration)
        drive = rope + 2.4 * np.tanh(speed / 0.1) + speed + 0.2 * acceleration
        made = {"motor_angle_rad": (position, 1e-5), "motor_current_a": (drive / 2.4, 0.01)}
        made |= {"rope_torque_n_m": (rope + 2.0 * (k >= RUNS // 2), 0.05)}
        return noisy(random, made)

    runs = recorded(columns)
    laid = lay_out(declared(plant_file.parse(WINCH)), runs, [run.name for run in runs])
    assert laid.equations["motor"].width == pytest.approx(0.1, rel=0.2)
    found = diagnose(runs, declared(plant_file.parse(WINCH)), split(runs)).findings
    assert any("sensor.offset" in (f.family, *f.alternatives) for f in found)


FINGER = """
schema = "rig.machine/1"
machine = { name = "finger", cutoff_hz = 20.0 }
axis = [
  { name = "motor", unit = "rad" },
  { name = "spool", unit = "rad" },
  { name = "joint", unit = "rad" },
]
transmission = [
  { name = "gear", input = "motor", output = "spool", ratio = 20.0 },
  { name = "tendon", input = "spool", output = "joint", ratio = 2.0, compliant = true },
]
actuator = [{ name = "motor_current_a", axis = "motor" }]
sensor = [
  { name = "motor_angle_rad", axis = "motor", reads = "position" },
  { name = "joint_angle_rad", axis = "joint", reads = "position" },
  { name = "spool_torque_n_m", axis = "spool", reads = "effort" },
  { name = "joint_torque_n_m", axis = "joint", reads = "effort" },
]
"""


STIFF_FINGER = FINGER.replace(", compliant = true", "")


def _pulled(*, bends=lambda k: 1.0, read=lambda k: 1.0):
    """Return the columns of a finger; the bend and the reading at the joint have a factor a run."""

    def columns(k, random, position, speed, acceleration):
        torque = (0.3, 0.8, 1.5)[k % 3] * (1.2 + np.sin(2.0 * position)) + 0.02 * acceleration
        pull = torque / 1.8 + 0.05 * np.tanh(speed / 0.02) + 0.02 * speed
        motor = 20.0 * (2.0 * position + bends(k) * torque / 25.0)
        turned = RATE_HZ * np.gradient(motor)
        drive = pull / 20.0 + 1e-4 * turned + 0.008 * np.tanh(turned / 0.3)
        made = {
            "motor_angle_rad": (motor, 2e-3),
            "joint_angle_rad": (position, 2e-4),
            "spool_torque_n_m": (pull, 0.004),
            "joint_torque_n_m": (read(k) * torque, 0.008),
            "motor_current_a": (drive / 0.02, 0.02),
        }
        return noisy(random, made)

    return recorded(columns)


def test_a_tendon_bends_whose_spool_turns_with_a_geared_motor():
    """The spool has no encoder: its angle is the motor's over the ratio of a rigid gear."""
    (finding,) = found_in(FINGER, _pulled(bends=lambda k: 1.4 if k >= RUNS // 2 else 1.0))
    assert (finding.verdict, finding.family) == ("identified", "compliance.link")
    assert "_differential_" in declared(plant_file.parse(FINGER))[-1].target


def test_another_gain_of_a_cell_that_one_equation_reads_is_that_of_the_cell_or_of_its_term():
    runs = _pulled(read=lambda k: 1.2 if k >= RUNS // 2 else 1.0)
    (finding,) = found_in(STIFF_FINGER, runs)
    assert finding.verdict == "one_of"
    assert {finding.family, *finding.alternatives} == {"sensor.gain", "transmission.ratio"}


GANTRY = """
schema = "rig.machine/1"
machine = { name = "gantry", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "beam", unit = "m" }]
actuator = [
  { name = "left_current_a", axis = "beam" },
  { name = "right_current_a", axis = "beam" },
]
sensor = [{ name = "beam_position_m", axis = "beam", reads = "position" }]
"""


def test_another_gain_of_a_second_drive_is_its_torque_constant():
    def columns(k, random, position, speed, acceleration):
        force = 40.0 * acceleration + 120.0 * speed + 50.0 * np.tanh(speed / 0.02)
        share = 0.5 + 0.1 * position
        right = 0.8 if k >= RUNS // 2 else 1.0
        made = {
            "beam_position_m": (position, 1e-5),
            "left_current_a": (share * force / 60.0, 0.02),
            "right_current_a": ((1.0 - share) * force / 60.0 / right, 0.02),
        }
        return noisy(random, made)

    (finding,) = found_in(GANTRY, recorded(columns))
    assert (finding.verdict, finding.family) == ("identified", "motor.torque_constant")
    assert finding.depends_on == ("current",)


GEARBOX = """
schema = "rig.machine/1"
machine = { name = "gearbox bench", cutoff_hz = 20.0, run_offsets = false }
axis = [{ name = "drive", unit = "rad" }, { name = "load", unit = "rad" }]
transmission = [{ name = "gear", input = "drive", output = "load", ratio = 5.0 }]
actuator = [{ name = "drive_torque_n_m", axis = "drive" }]
sensor = [
  { name = "drive_angle_rad", axis = "drive", reads = "position" },
  { name = "load_torque_n_m", axis = "load", reads = "effort" },
]
"""


def test_a_drift_is_at_either_of_two_sensors_that_one_equation_compares():
    def columns(k, random, position, speed, acceleration):
        torque = 2.0 * (1 + k % 3) * np.sin(3.0 * position)
        drive = torque / 5.0 + 0.02 * acceleration + 0.05 * np.tanh(speed / 0.05) + 0.02 * speed
        drifted = torque + 0.1 * np.arange(len(torque)) / RATE_HZ
        return noisy(
            random,
            {
                "drive_angle_rad": (5.0 * position, 1e-4),
                "drive_torque_n_m": (drive, 0.005),
                "load_torque_n_m": (drifted, 0.02),
            },
        )

    (finding,) = found_in(GEARBOX, recorded(columns))
    places = {finding.place, *finding.other_places}
    assert finding.family == "sensor.drift"
    assert places == {"sensor drive_torque_n_m", "sensor load_torque_n_m"}


def test_a_change_between_two_training_runs_has_its_time_from_the_test_runs():
    recordings, between = _screwed(rubs=lambda k: 1.8 if k >= 5 else 1.0), ("03", "04", "05")
    others = tuple(r.name for r in recordings if r.name not in between)
    sealed = replace(split(recordings), discover=others, confirm=between)
    (finding,) = diagnose(recordings, declared(plant_file.parse(PRESS)), sealed).findings
    assert "change.step" in (finding.family, *finding.alternatives)
    assert finding.runs_affected == ("05", "06", "07", "08", "09")
    assert finding.rmse_after < 0.1 * finding.rmse_before
