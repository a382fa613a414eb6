"""Units of a table: what they are in SI, and that an angle is neither a ratio nor a frequency."""

import math

import pytest

from rig.importers.table.units import NotAUnitError, conversion, read_unit


@pytest.mark.parametrize(
    ("unit", "name", "factor"),
    [
        ("deg", "motor_angle_rad", math.pi / 180),
        ("rpm", "motor_velocity_rad_s", math.pi / 30),
        ("rev/4096", "motor_angle_rad", 2 * math.pi / 4096),
        ("mm", "carriage_position_m", 1e-3),
        ("µm", "carriage_position_m", 1e-6),
        ("mm/s", "carriage_velocity_m_s", 1e-3),
        ("mN m", "jaw_n_m", 1e-3),
        ("N*mm", "jaw_n_m", 1e-3),
        ("kgf", "jaw_force_n", 9.80665),
        ("ozf in", "jaw_n_m", 0.00706155),
        ("0.4/255 A", "motor_current_a", 0.4 / 255),
        ("-0.001 rad", "motor_angle_rad", -0.001),
        ("1/1023", "drive_ratio", 1 / 1023),
        ("%", "drive_ratio", 0.01),
        ("deg/s^2", "motor_acceleration_rad_s2", math.pi / 180),
        ("1/s", "rate_hz", 1.0),
        ("kHz", "rate_hz", 1e3),
        ("bar", "cap_pressure_pa", 1e5),
        ("mbar", "cap_pressure_pa", 1e2),
        ("MPa", "cap_pressure_pa", 1e6),
        ("kPa", "cap_pressure_pa", 1e3),
        ("N/mm^2", "cap_pressure_pa", 1e6),
        ("psi", "cap_pressure_pa", 6894.757),
        ("bar 9.42 cm^2", "rod_force_n", 94.2),
    ],
)
def test_a_unit_in_si(unit, name, factor):
    assert conversion(unit, name).factor == pytest.approx(factor, rel=1e-6)


def test_a_temperature_has_another_zero():
    celsius = conversion("degC", "motor_temperature_k")
    assert celsius.factor * 20 + celsius.shift == pytest.approx(293.15)
    fahrenheit = conversion("degF", "motor_temperature_k")
    assert fahrenheit.factor * 212 + fahrenheit.shift == pytest.approx(373.15)


@pytest.mark.parametrize(
    ("unit", "name"),
    [
        ("deg", "drive_ratio"),
        ("count", "motor_angle_rad"),
        ("rpm", "rate_hz"),
        ("mm", "motor_angle_rad"),
        ("N", "jaw_n_m"),
        ("g", "jaw_force_n"),
    ],
)
def test_a_unit_of_another_dimension_does_not_fit(unit, name):
    assert conversion(unit, name) is None


@pytest.mark.parametrize("text", ["", "furlong", "m//s", "rad!", "/"])
def test_what_is_not_a_unit(text):
    with pytest.raises(NotAUnitError):
        read_unit(text)
