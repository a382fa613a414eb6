"""Hidden effects: off leaves no trace, each shows where it should, and drawing is seeded."""

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.teensy.control import Controllers
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


def closing(columns: Columns) -> NDArray[np.bool_]:
    """Samples of the closing half in mid-stroke."""
    angle = columns["spindle_angle_rad"]
    first_half = np.arange(angle.size) < angle.size // 2
    return first_half & (angle > -0.7) & (angle < -0.15)


@pytest.fixture(scope="module")
def plain() -> Columns:
    return sweep([])


def test_strength_zero_is_the_plain_plant_to_the_bit(plain):
    off = sweep([HiddenEffect(name, 0.0) for name in NAMES])
    for name, values in plain.items():
        assert off[name].tobytes() == values.tobytes()


def test_motor_ripple_shows_in_current_at_its_order():
    amplitudes = []
    for effects in ([HiddenEffect("motor_ripple", 2.0, (3.0, 0.5))], []):
        columns = sweep(effects, speed_rad_s=0.25)
        inside = closing(columns)
        phase = 3.0 * columns["motor_angle_rad"][inside]
        waves = np.column_stack([np.sin(phase), np.cos(phase), np.vander(phase, 2)])
        sine, cosine = np.linalg.lstsq(waves, columns["motor_current_a"][inside])[0][:2]
        amplitudes.append(np.hypot(sine, cosine))
    constant = PlantParameters().torque_constant_n_m_a
    assert amplitudes[0] == pytest.approx(2.0 * 0.08e-3 / constant, rel=0.3)
    assert amplitudes[1] < 0.1 * amplitudes[0]


def test_backlash_adds_its_gap_to_the_twist_when_torque_reverses():
    jumps_rad = []
    for effects in ([HiddenEffect("gear_backlash", 1.0, (8e-3,))], []):
        columns = sweep(effects, load_a=0.1)
        twist = columns["motor_angle_rad"] / 35.0 - columns["spindle_angle_rad"]
        jumps_rad.append(np.ptp(np.percentile(twist, [5, 95])))
    assert jumps_rad[0] - jumps_rad[1] == pytest.approx(16e-3, rel=0.1)


def test_the_bent_current_sensor_changes_only_what_is_measured(plain):
    bent = sweep([HiddenEffect("current_sensor_bend", 1.0, (0.1,))])
    for name, values in plain.items():
        if name != "motor_current_a":
            assert bent[name].tobytes() == values.tobytes()
    bent_a, plain_a = (c["motor_current_a"][closing(plain)].mean() for c in (bent, plain))
    assert bent_a > 1.08 * plain_a


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
    bench._state[places.JAW_ANGLE] -= 0.1
    bench.advance(np.zeros((2000, 2), np.int32), Controllers.idle())
    speeds = bench.state[[places.MOTOR_SPEED, places.SPINDLE_SPEED, places.JAW_SPEED]]
    np.testing.assert_allclose(speeds, 0.0, atol=1e-3)


def test_draw_is_seeded_covers_every_kind_and_stays_in_range():
    drawn = [draw(seed) for seed in range(300)]
    assert drawn[7] == draw(7)
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
