"""Units of a table: what they are in SI, and that an angle is neither a ratio nor a frequency."""

import math

import pytest

from rig.importers.table.units import NotAUnitError, conversion, read_unit, stated_in_name


@pytest.mark.parametrize(
    ("unit", "name", "factor"),
    [
        ("deg", "motor_angle_rad", math.pi / 180),
        ("rpm", "motor_velocity_rad_s", math.pi / 30),
        ("µm", "carriage_position_m", 1e-6),
        ("mm/s", "carriage_velocity_m_s", 1e-3),
        ("mN m", "jaw_n_m", 1e-3),
        ("ozf in", "jaw_n_m", 0.00706155),
        ("0.4/255 A", "motor_current_a", 0.4 / 255),
        ("-0.001 rad", "motor_angle_rad", -0.001),
        ("%", "drive_ratio", 0.01),
        ("deg/s^2", "motor_acceleration_rad_s2", math.pi / 180),
        ("kHz", "rate_hz", 1e3),
        ("MPa", "cap_pressure_pa", 1e6),
        ("N/mm^2", "cap_pressure_pa", 1e6),
        ("psi", "cap_pressure_pa", 6894.757),
        ("l/min", "pump_flow_m3_s", 1e-3 / 60),
        ("ml/s", "pump_flow_m3_s", 1e-6),
        ("g/s", "feed_kg_s", 1e-3),
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


@pytest.mark.parametrize(
    ("column", "name", "unit"),
    [
        ("speed (rpm)", "motor_velocity_rad_s", "rpm"),
        ("Pos [mm]", "carriage_position_m", "mm"),
        ("Winkel (DEG)", "motor_angle_rad", "deg"),
        ("angle_deg", "motor_angle_rad", "deg"),
        ("angle_°", "motor_angle_rad", "°"),
        ("motor_rpm", "motor_velocity_rad_s", "rpm"),
        ("speed_deg_s", "motor_velocity_rad_s", "deg/s"),
        ("v_mm_per_s", "carriage_velocity_m_s", "mm/s"),
        ("I/mA", "motor_current_a", "mA"),
        ("current_ma", "motor_current_a", "mA"),
        ("torque_mNm", "jaw_torque_n_m", "mNm"),
        ("torque mN m", "jaw_torque_n_m", "mN m"),
        ("force_kN", "rod_force_n", "kN"),
        ("P_A_bar", "cap_pressure_pa", "bar"),
        ("time/us", "time_s", "us"),
        ("duty_%", "drive_ratio", "%"),
        ("temp_degC", "motor_temperature_k", "degC"),
        ("angle_rpm", "motor_angle_rad", "rpm"),
    ],
)
def test_a_unit_at_the_end_of_the_name_of_a_column(column, name, unit):
    assert stated_in_name(column, name) == unit


@pytest.mark.parametrize(
    ("column", "name"),
    [
        ("motor_m", "carriage_position_m"),
        ("pos_a", "motor_current_a"),
        ("speed_rad_s", "motor_velocity_rad_s"),
        ("load_g", "load_mass_kg"),
        ("pos_in", "carriage_position_m"),
        ("speed min", "motor_velocity_rad_s"),
        ("angle_raw", "motor_angle_rad"),
        ("angle_mm", "motor_angle_rad"),
        ("torque_nm", "jaw_torque_n_m"),
        ("deg", "motor_angle_rad"),
        ("rpm_motor", "motor_velocity_rad_s"),
        ("deg_of_freedom_1", "motor_angle_rad"),
        ("operator_ms", "operator"),
        ("angle (rad)", "motor_angle_rad"),
        ("angle (mm)", "motor_angle_rad"),
        ("angle (left)", "motor_angle_rad"),
        ("torque_rev", "jaw_torque_n_m"),
        ("pos_ms", "carriage_position_m"),
    ],
)
def test_an_ordinary_word_or_the_own_unit_of_a_channel_is_not_another_unit(column, name):
    assert stated_in_name(column, name) == ""
