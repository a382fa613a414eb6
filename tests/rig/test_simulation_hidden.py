"""Hidden effects: off leaves no trace, each shows where it should, and drawing is seeded."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.teensy.logic import Drive
from rig.protocols import trajectory
from rig.simulation import places
from rig.simulation.bench import SimulatedBench
from rig.simulation.hidden import (
    KINDS,
    NAMES,
    WEAKEST,
    HiddenEffect,
    UnknownHiddenEffectError,
    draw,
    table,
)
from rig.simulation.parameters import PlantParameters

pytestmark = pytest.mark.integration

OPEN_RAD = -1366 * 2 * np.pi / 8192
Columns = dict[str, NDArray[np.float64]]


def sweep(effects, speed_rad_s=0.5, load_a=0.5):
    """Close by 1 rad at constant speed, rest 0.2 s, open again, while the wrist swings."""
    close = OPEN_RAD + speed_rad_s * trajectory.times(1.0 / speed_rad_s)
    target = np.concatenate([close, np.full(200, close[-1]), close[::-1]])
    plant = PlantParameters(wrist_swing_rad=0.5)
    return SimulatedBench(plant, effects=effects).play(target, np.full(target.size, load_a))


def closing(columns: Columns, low_rad: float = -0.7, high_rad: float = -0.15) -> NDArray[np.bool_]:
    """Samples of the closing half in a window of spindle angle."""
    angle = columns["spindle_angle_rad"]
    first_half = np.arange(angle.size) < angle.size // 2
    return first_half & (angle > low_rad) & (angle < high_rad)


def wave(columns: Columns, values: NDArray[np.float64], phase: NDArray[np.float64]) -> float:
    """Amplitude of a wave in values over phase, by least squares."""
    waves = [np.sin(phase), np.cos(phase), np.ones_like(phase), np.linspace(-1, 1, phase.size)]
    a, b, _, _ = np.linalg.lstsq(np.column_stack(waves), values, rcond=None)[0]
    return float(np.hypot(a, b))


@pytest.fixture(scope="module")
def plain() -> Columns:
    return sweep([])


def mean(columns: Columns, name: str, low_rad: float = -0.7, high_rad: float = -0.15) -> float:
    return float(columns[name][closing(columns, low_rad, high_rad)].mean())


def test_strength_zero_is_the_plain_plant_to_the_bit(plain):
    off = sweep([HiddenEffect(name, 0.0) for name in NAMES])
    for name, values in plain.items():
        assert off[name].tobytes() == values.tobytes()


def test_motor_ripple_shows_in_current_at_its_order(plain):
    loud = sweep([HiddenEffect("motor_ripple", 2.0, (3.0, 0.5))], speed_rad_s=0.25)
    quiet = sweep([], speed_rad_s=0.25)
    amplitudes = []
    for columns in (loud, quiet):
        inside = closing(columns)
        phase = 3.0 * columns["motor_angle_rad"][inside]
        amplitudes.append(wave(columns, columns["motor_current_a"][inside], phase))
    constant = PlantParameters().torque_constant_n_m_a
    assert amplitudes[0] == pytest.approx(2.0 * 0.08e-3 / constant, rel=0.3)
    assert amplitudes[1] < 0.1 * amplitudes[0]


def test_backlash_adds_its_gap_to_the_twist_when_torque_reverses():
    gap = 8e-3

    def jump(effects: Sequence[HiddenEffect]) -> float:
        columns = sweep(effects, load_a=0.1)
        twist = columns["motor_angle_rad"] / 35.0 - columns["spindle_angle_rad"]
        return float(np.percentile(twist, 95) - np.percentile(twist, 5))

    assert jump([HiddenEffect("gear_backlash", 1.0, (gap,))]) - jump([]) == pytest.approx(
        2.0 * gap, rel=0.1
    )


def test_the_bent_current_sensor_changes_only_what_is_measured(plain):
    bent = sweep([HiddenEffect("current_sensor_bend", 1.0, (0.1,))])
    for name, values in plain.items():
        if name != "motor_current_a":
            assert bent[name].tobytes() == values.tobytes()
    assert mean(bent, "motor_current_a") > 1.08 * mean(plain, "motor_current_a")


@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_every_effect_is_visible_and_the_rig_stays_under_control(kind, plain):
    shape = (1.0,) if kind.name == "friction_step" else ()
    columns = sweep([HiddenEffect(kind.name, kind.strongest, shape)])
    error = columns["target_angle_rad"] - columns["spindle_angle_rad"]
    assert np.degrees(error[200:].std()) < 1.0
    assert any(columns[name].tobytes() != values.tobytes() for name, values in plain.items())


def test_the_late_jaw_encoder_answers_its_delay_later(plain):
    late = sweep([HiddenEffect("jaw_delay", 1.0, (20.0,))])
    inside = closing(plain)
    behind = plain["jaw_angle_rad"][inside] - late["jaw_angle_rad"][inside]
    assert behind.mean() == pytest.approx(20e-3 * 0.5 * 0.913, rel=0.1)


@pytest.mark.parametrize("name", NAMES)
def test_no_effect_drives_the_rig_by_itself(name):
    bench = SimulatedBench(effects=[HiddenEffect(name, 2.0)], start_count=683)
    idle = np.zeros(2000, np.int32)
    bench._state[places.JAW_ANGLE] -= 0.1
    bench.advance(2000, idle, idle, Drive.idle())
    speeds = bench.state[[places.MOTOR_SPEED, places.SPINDLE_SPEED, places.JAW_SPEED]]
    np.testing.assert_allclose(speeds, 0.0, atol=1e-3)


def test_draw_is_seeded_covers_every_kind_and_stays_in_range():
    drawn = [draw(seed) for seed in range(300)]
    assert drawn == [draw(seed) for seed in range(300)]
    assert {effect.name for effect in drawn} == {kind.name for kind in KINDS if kind.alone}
    for effect in drawn:
        kind = KINDS[NAMES.index(effect.name)]
        assert WEAKEST <= effect.strength <= kind.strongest
        assert len(effect.shape) == len(kind.shapes)
        for value, shape in zip(effect.shape, kind.shapes, strict=True):
            assert shape.low <= value <= shape.high
            assert not shape.whole or value == round(value)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ([HiddenEffect("gremlin")], "Unknown hidden effect 'gremlin'"),
        ([HiddenEffect("jaw_spring", -1.0)], "strength -1.0"),
        ([HiddenEffect("jaw_spring", float("nan"))], "strength nan"),
        ([HiddenEffect("jaw_spring"), HiddenEffect("jaw_spring")], "named twice"),
        ([HiddenEffect("cable_creep", 1.0, (1.0, 2.0))], "shaped by 2 numbers"),
    ],
)
def test_a_wrong_effect_is_refused(effects, message):
    with pytest.raises(UnknownHiddenEffectError, match=message):
        table(effects)
