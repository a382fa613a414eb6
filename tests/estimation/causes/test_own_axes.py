"""Causes at one axis of a machine of one's own, where a similar form must not pass for them."""

from collections.abc import Callable

import numpy as np
import pytest

from estimation import plant_file
from estimation.causes.verdict import answer, diagnose
from estimation.diagnosis.result import Diagnosis
from estimation.diagnosis.split import split
from estimation.effects import effect
from estimation.model import Model
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording
from tests.estimation.causes.synthetic import AXIS, axis, turning

RATE_HZ, SECONDS = 200.0, 12.0
More = Callable[[FloatArray, FloatArray], FloatArray]
"""Angle and speed of an axis to what the torque has more of."""

FIRST = ("sine", "cosine", "sine_1", "cosine_1")
TIME_S = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ


WINCH = """
schema = "rig.machine/1"
machine = { name = "winch" }
axis = [{ name = "drum", unit = "rad" }]
sensor = [
  { name = "drum_angle_rad", axis = "drum", reads = "position" },
  { name = "drum_current_a" },
  { name = "rope_force_n" },
]
[[equation]]
name = "drum"
target = "drum_current_a"
effects = [
  { id = "transmission.ratio", channels = { load = "rope_force_n" } },
  { id = "inertia.missing", channels = { acceleration = "drum_acceleration_rad_s2" } },
  { id = "friction.viscous", channels = { speed = "drum_velocity_rad_s" } },
  { id = "friction.coulomb", channels = { speed = "drum_velocity_rad_s" } },
  { id = "sensor.offset" },
]
"""


def _diagnosed(runs: list[Recording], model: Model | None = None) -> Diagnosis:
    return diagnose(runs, [model or axis()], split(runs))


def _names(diagnosis: Diagnosis) -> set[str]:
    """Return every name that findings give, as likeliest or as possible."""
    return {name for f in diagnosis.findings for name in (f.family, *f.alternatives)}


def _axis(speeds: list[FloatArray], more: More) -> list[Recording]:
    """Return runs of an axis at speeds, with more torque by its angle and speed."""
    random, runs = np.random.default_rng(4), []
    for k, speed in enumerate(speeds):
        angle = np.cumsum(speed) / RATE_HZ
        torque = 0.02 * np.gradient(speed, TIME_S) + 0.05 * speed + 0.1 * np.tanh(speed / 0.05)
        torque += more(angle, speed)
        torque += random.normal(0.0, 0.01 * np.std(torque), len(torque))
        columns = {"crank_torque_n_m": torque, "crank_angle_rad": angle}
        runs.append(Recording(f"{k:02d}", TIME_S, columns, started_at_ns=int(2e10 * k) + 1))
    return runs


def _ahead(least: float, most: float, pace_hz: float = 0.5) -> list[FloatArray]:
    """Return speeds of runs that turn one way, between two of them."""
    random = np.random.default_rng(7)
    out = []
    for _ in range(10):
        paces, phases = random.uniform(0.2, 1.0, 3), random.uniform(0.0, 6.3, 3)
        wave = sum(
            np.sin(2.0 * np.pi * pace_hz * pace * TIME_S + phase)
            for pace, phase in zip(paces, phases, strict=True)
        )
        wave = (wave - wave.min()) / np.ptp(wave)
        out.append(least * (most / least) ** wave * random.uniform(0.8, 1.2))
    return out


def _levels() -> list[FloatArray]:
    """Return speeds of several levels, of both signs in every other run, without rests."""
    random, out = np.random.default_rng(8), []
    for k in range(10):
        low, high = ((40.0, 150.0), (80.0, 260.0), (150.0, 400.0))[k % 3]
        levels = random.uniform(low, high, 6) * (random.choice([-1, 1], 6) if k % 2 else 1.0)
        steps = np.repeat(levels, len(TIME_S) // 6)
        wide = np.hanning(int(1.6 * RATE_HZ))
        around = np.pad(steps, len(wide), mode="edge")
        out.append(np.convolve(around, wide / wide.sum(), "same")[len(wide) : -len(wide)])
    return out


def _resting() -> list[FloatArray]:
    """Return speeds of runs that move to and fro after rests of several lengths."""
    random, out = np.random.default_rng(8), []
    for k in range(10):
        speed, at, way = np.zeros(len(TIME_S)), 0, 1.0
        size = (1 + k % 3) * random.uniform(0.8, 1.2)
        for rest_s in random.permutation([0.1, 0.3, 2.5, 0.2, 1.2, 0.6, 1.8]):
            at += int(rest_s * RATE_HZ)
            move = np.sin(np.linspace(0.0, np.pi, int(0.6 * RATE_HZ))) ** 2
            speed[at : at + len(move)] = way * size * move
            at, way = at + len(move), -way
        out.append(speed)
    return out


def _slider(angle: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the torque of a slider of 1 kg at a crank of 40 mm with a rod of 140 mm."""
    crank, rod = 0.04, 0.14

    def inertia(x: FloatArray) -> FloatArray:
        sine, cosine = np.sin(x), np.cos(x)
        along = np.sqrt(rod**2 - (crank * sine) ** 2)
        return np.asarray((crank * sine * (1.0 + crank * cosine / along)) ** 2)

    slope = (inertia(angle + 1e-4) - inertia(angle - 1e-4)) / 2e-4
    return np.asarray(inertia(angle) * np.gradient(speed, TIME_S) + 0.5 * slope * speed**2)


def test_a_slider_at_a_crank_is_an_inertia_that_changes_with_the_angle() -> None:
    runs = _axis(_ahead(2.0, 12.0), lambda angle, speed: 10.0 * _slider(angle, speed))
    finding = _diagnosed(runs).findings[0]
    assert finding.family == "inertia.position"
    assert finding.parameters["cosine_2"].value == pytest.approx(-0.008, rel=0.1)
    assert finding.parameters["cosine_1"].value == pytest.approx(0.0023, rel=0.2)


def test_a_bearing_that_never_rests_is_not_said_to_grow_stiff_at_rest() -> None:
    drag = _axis(_levels(), lambda _, speed: 0.2 * np.sign(speed) * np.abs(speed) ** (2.0 / 3.0))
    assert "friction.dwell" not in _names(_diagnosed(drag))


def test_friction_that_grows_with_the_time_at_rest_is_identified_with_its_size() -> None:
    def aged(_: FloatArray, speed: FloatArray) -> FloatArray:
        inputs = {"speed": speed, "clock": TIME_S}
        return 0.1 * effect("friction.dwell").columns(inputs, (0.8, 0.4, 0.05))[:, 0]

    finding = _diagnosed(_axis(_resting(), aged)).findings[0]
    assert finding.family == "friction.dwell"
    assert finding.parameters["friction"].value == pytest.approx(0.1, rel=0.4)


def test_the_error_of_an_encoder_has_its_size_where_the_equation_is_of_torques() -> None:
    runs = []
    for run in _axis(_ahead(2.0, 12.0), lambda angle, speed: 0.0 * speed):
        angle = run["crank_angle_rad"]
        read = angle + 0.02 * np.sin(3.0 * angle)
        runs.append(run.with_columns(crank_angle_rad=read))
    finding = _diagnosed(runs).findings[0]
    assert finding.family == "sensor.encoder_inl"
    assert finding.parameters["order"].value == 3.0
    first = [p for name, p in finding.parameters.items() if name in FIRST]
    assert [p.unit for p in first] == ["rad", "rad"]
    assert np.hypot(*(p.value for p in first)) == pytest.approx(0.02, rel=0.1)


@pytest.mark.long
def test_the_weight_of_a_chain_is_no_function_of_the_sine_of_a_position() -> None:
    text = AXIS.replace('"rad"', '"m"').replace("crank_angle_rad", "crank_position_m")
    (model,) = declared(plant_file.parse(text.replace("DRIVE", "crank_force_n")))
    runs = []
    for run in _axis([0.3 * speed for speed in _resting()], lambda angle, _: 0.4 * angle):
        columns = dict(
            zip(("crank_force_n", "crank_position_m"), run.columns.values(), strict=True)
        )
        runs.append(Recording(run.name, run.time_s, columns, started_at_ns=run.started_at_ns))
    names = _names(_diagnosed(runs, model))
    assert "spring.position" in names
    assert "gravity.payload" not in names


def test_friction_of_one_wrap_is_friction_proportional_to_the_load() -> None:
    """A capstan's law over a constant wrap is that and a factor of the load."""
    (model,) = declared(plant_file.parse(WINCH))
    random, runs = np.random.default_rng(5), []
    for k, run in enumerate(_axis(_resting(), lambda angle, speed: 0.0 * speed)):
        load = (40.0, 80.0, 120.0)[k % 3] * (1.0 + 0.3 * np.sin(0.9 * TIME_S + k))
        speed = np.gradient(run["crank_angle_rad"], TIME_S)
        current = run["crank_torque_n_m"] + 0.02 * load + 0.002 * load * np.tanh(speed / 0.05)
        columns = {
            "drum_angle_rad": run["crank_angle_rad"],
            "drum_current_a": current + random.normal(0.0, 0.02, len(current)),
            "rope_force_n": load + random.normal(0.0, 0.2, len(current)),
        }
        runs.append(Recording(run.name, TIME_S, columns, started_at_ns=run.started_at_ns))
    finding = _diagnosed(runs, model).findings[0]
    assert finding.family == "friction.load"
    assert "friction.capstan" not in finding.alternatives


@pytest.mark.parametrize("order", [1.7, 10.0 / 3.0])
def test_a_ripple_of_a_shaft_behind_a_belt_has_any_order(order: float) -> None:
    runs = _axis(_ahead(5.0, 20.0), lambda angle, _: 0.1 * np.sin(order * angle + 0.5))
    (finding,) = _diagnosed(runs).findings
    assert (finding.family, finding.verdict) == ("ripple.motor", "identified")
    assert finding.parameters["order"].value == pytest.approx(order, abs=1e-3)
    size = np.hypot(*(finding.parameters[name].value for name in ("sine", "cosine")))
    assert size == pytest.approx(0.1, rel=0.05)


def test_a_motion_over_many_turns_without_a_ripple_has_none() -> None:
    """Among thousands of orders the largest by chance is not one."""
    assert not _diagnosed(_axis(_ahead(5.0, 20.0), lambda angle, _: 0.0 * angle)).findings


Needed = Callable[[FloatArray, FloatArray], FloatArray]
GAIN = 0.8


def driven(current: Needed) -> list[Recording]:
    """Return runs whose current is that which the torque needs at the angle."""
    runs = []
    for run in turning(lambda angle, speed, acceleration: 0.0 * speed, size=3.0):
        needed = current(run["crank_torque_n_m"] / GAIN, run["crank_angle_rad"])
        runs.append(Recording(run.name, run.time_s, run.columns | {"crank_current_a": needed}))
    return runs


@pytest.mark.parametrize(
    ("current", "family"),
    [
        (lambda linear, _: linear + 0.1 * np.sign(linear), "motor.dead_zone"),
        (lambda linear, _: np.where(linear > 0, linear, linear / 0.8), "motor.gain_by_side"),
        (lambda linear, angle: linear / (1 - 0.02 * angle**2), "motor.gain_by_position"),
    ],
)
def test_a_drive_that_is_not_linear_is_identified(current: Needed, family: str) -> None:
    runs = driven(current)
    finding = diagnose(runs, [axis("crank_current_a")], split(runs)).findings[0]
    assert family in (finding.family, *finding.alternatives)


def test_of_a_spring_that_hardens_the_whole_curve_is_found() -> None:
    runs = turning(lambda angle, speed, acceleration: 0.05 * angle + 0.02 * angle**3)
    (finding,) = diagnose(runs, [axis()], split(runs)).findings
    assert finding.family == "spring.position"
    assert finding.parameters["stiffness"].value == pytest.approx(0.05, rel=0.1)
    assert finding.parameters["twist"].value == pytest.approx(0.02, rel=0.1)


def test_a_drive_that_warms_is_one_cause_where_the_motor_turns_one_way() -> None:
    """The current that warms it has the friction, which an offset would take from it."""
    runs = []
    for run in turning(always_ahead=True, size=3.0):
        weaker = 1.0 - 0.1 * (1.0 - np.exp(-run.time_s / 3.0))
        runs.append(run.with_columns(crank_current_a=run["crank_torque_n_m"] / weaker))
    found = answer(runs, [axis("crank_current_a")], split(runs))
    (finding,) = found.diagnosis.findings
    assert finding.family == "motor.thermal"
    assert finding.parameters["loss"].value == pytest.approx(0.1, rel=0.1)
    (model,) = found.models
    values = {term.effect.id: term.values for term in model.terms}
    assert values["friction.coulomb"]["friction"].value == pytest.approx(0.45, rel=0.05)
    assert values["sensor.offset"]["offset"].value == 0.0
    (predicted,) = model.signals.combinations
    assert predicted.direction is not None
    assert predicted.direction.size == pytest.approx(0.48, rel=0.05)
