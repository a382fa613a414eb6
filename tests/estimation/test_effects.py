"""Every effect of the catalogue, found by discovery: adding a file is enough to be tested here."""

import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.channels import unit_of
from estimation.effects import UnknownEffectError, catalogue, effect
from estimation.model import Term

EVERY = pytest.mark.parametrize("kind", catalogue().values(), ids=catalogue())


def at(parameter, place: float) -> float:
    """Return a value between the bounds of a shape parameter, on its scale."""
    low, high = parameter.lower, parameter.upper
    if parameter.linear:
        return low + place * (high - low)
    return low ** (1 - place) * high**place


def motion(roles, seed: int, n: int = 60) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {
        role: np.arange(n) * 1e-3 if channel == "time_s" else np.cumsum(random.normal(size=n))
        for role, channel in roles.items()
    }


def test_the_declared_models_find_their_effects():
    assert {
        "friction.coulomb",
        "friction.viscous",
        "inertia.missing",
        "motor.torque_constant",
        "sensor.offset",
        "spring.position",
        "transmission.ratio",
    } <= set(catalogue())


@EVERY
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 1000), place=st.floats(0, 1))
def test_offline_columns_and_live_steps_agree_to_rounding(kind, seed, place):
    shape = [at(p, place) for p in kind.shape]
    inputs = motion(kind.roles, seed)
    columns = kind.columns(inputs, shape)
    state = kind.start()
    steps = [
        kind.step({role: float(values[k]) for role, values in inputs.items()}, shape, state)
        for k in range(60)
    ]
    assert columns.shape == (60, len(kind.amplitudes))
    assert np.array(steps) == pytest.approx(columns, rel=1e-12, abs=1e-12)


@EVERY
def test_an_effect_is_documented_and_its_parameters_have_units_and_bounds(kind):
    text = inspect.getdoc(type(kind)) or ""
    assert "Equation:" in text
    assert "Source:" in text
    for channel in kind.roles.values():
        unit_of(channel)
    for parameter in kind.amplitudes + kind.shape:
        assert parameter.lower < parameter.upper
        assert Term(kind).unit(parameter, "proximal_torque_n_m")
        assert parameter.description
    for parameter in kind.shape:
        assert np.isfinite([parameter.lower, parameter.upper]).all()
        assert parameter.linear or parameter.lower > 0  # searched by logarithm
        assert len(parameter.grid()) == parameter.points
    if len(kind.amplitudes) and kind.id != "sensor.offset":
        assert kind.told_apart_by


def test_units_of_parameters_follow_from_the_channels():
    friction = effect("friction.coulomb")
    term = Term(friction, channels={"speed": "jaw_velocity_rad_s"})
    (size,), (width,) = friction.amplitudes, friction.shape
    assert term.unit(size, "proximal_torque_n_m") == "N m"
    assert term.unit(width, "proximal_torque_n_m") == "rad/s"
    gain = effect("motor.torque_constant").amplitudes[0]
    assert Term(effect("motor.torque_constant")).unit(gain, "proximal_torque_n_m") == "N m/A"
    damping = effect("friction.viscous").amplitudes[0]
    assert Term(effect("friction.viscous")).unit(damping, "distal_torque_n_m") == "N m s/rad"
    assert Term(effect("friction.viscous")).unit(damping, "jaw_angle_rad") == "s"


def test_an_unknown_effect_names_the_nearest():
    with pytest.raises(UnknownEffectError, match=r"Did you mean 'friction\.coulomb'"):
        effect("friction.columb")
