"""Recordings against what is stated: a drive of the wrong sign, the ratio of two travels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.campaign import Campaign
from estimation.causes.run_signals import LayoutError
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.filters import LowPass
from estimation.fitting import fit
from estimation.opposed import driven_back, opposed
from estimation.plant import Axis, Part, Plant, Sensor, Written
from estimation.plant_models import declared
from estimation.recording import Recording
from estimation.signals import Combination, Share, Signals
from estimation.travel import off_ratio, other_ratio, slope
from tests.estimation.causes.synthetic import axis, hoist, hoisted, turning


@pytest.fixture(scope="module")
def sound() -> list[Recording]:
    return turning(lambda angle, speed, acceleration: np.zeros(len(angle)))


def _negated(runs: list[Recording], channel: str) -> list[Recording]:
    return [run.with_columns(**{channel: -run[channel]}) for run in runs]


def test_a_sound_machine_has_no_channel_of_the_opposite_sign(sound: list[Recording]) -> None:
    campaign = Campaign.of(sound)
    assert opposed(fit(axis(), campaign, bootstrap=0), campaign) == ""


@pytest.mark.parametrize("channel", ["", "drive_command_v"])
def test_a_drive_that_pulls_back_is_named(channel: str) -> None:
    runs = _negated(hoisted(), channel) if channel else hoisted()
    campaign = Campaign.of(runs)
    found = [*driven_back(fit(hoist(), campaign, bootstrap=0), campaign)]
    assert len(found) == bool(channel)
    assert all(one.startswith("drive_command_v has a negative gain") for one in found)


@pytest.mark.parametrize("channel", ["crank_torque_n_m", "crank_angle_rad"])
def test_no_cause_is_sought_where_either_sign_is_wrong_and_the_drive_is_named(sound, channel):
    runs = _negated(sound, channel)
    with pytest.raises(LayoutError, match="crank_torque_n_m has the opposite sign"):
        diagnose(runs, [axis()], split(runs))


def run(ratio: float, compliance: float) -> Recording:
    """Return a run in which a torque winds up a gearbox while it turns."""
    time_s = np.arange(0.0, 4.0, 0.002)
    angle = np.sin(2.0 * time_s)
    torque = 0.3 * angle + 0.1 * np.sin(7.0 * time_s)
    motor = ratio * (angle + compliance * torque)
    columns = {"spindle_angle_rad": angle, "motor_angle_rad": motor, "proximal_torque_n_m": torque}
    return Recording("run", time_s, columns)


@given(st.floats(2.0, 200.0), st.floats(0.0, 0.2))
def test_a_compliance_is_not_taken_for_another_ratio(ratio, compliance):
    runs = [run(ratio, compliance)]
    found = slope(runs, "spindle_angle_rad", "motor_angle_rad", ["proximal_torque_n_m"])
    assert found == pytest.approx(ratio, rel=1e-6)


def bent(ratio: float, frequencies: list[float]) -> list[Recording]:
    """Return runs of a spring behind a gear, with a mass before the sensor of torque at its end."""
    runs = []
    for k, frequency in enumerate(frequencies):
        time_s = np.arange(0.0, 10.0, 0.005)
        phase = 2.0 * np.pi * frequency * time_s
        angle = 0.5 * np.sin(phase) + 0.1 * np.sin(2.0 * phase + 1.0)
        speed = np.gradient(angle, time_s)
        load = 40.0 * (angle - 0.5 * np.sin(phase - 0.25)) + 2.0 * speed
        bend = (load + 0.15 * speed + 0.3 * np.gradient(speed, time_s)) / 250.0
        columns = {"motor_angle_rad": ratio * (angle + bend)}
        columns |= {"knee_angle_rad": angle, "knee_torque_n_m": load}
        runs.append(Recording(f"{k}", time_s, columns))
    return runs


def found_ratio(runs: list[Recording], stated: float) -> float | None:
    ends, efforts = ("motor_angle_rad", "knee_angle_rad"), ["knee_torque_n_m"]
    return other_ratio(runs, ends, stated, efforts, LowPass(20.0), Signals())


def test_the_bend_by_a_mass_before_the_sensor_is_not_taken_for_another_ratio():
    runs = bent(80.0, [0.5, 0.7, 0.9, 1.1])
    ends = "knee_angle_rad", "motor_angle_rad"
    assert abs(slope(runs, *ends, ["knee_torque_n_m"]) - 80.0) > 1.6
    assert found_ratio(runs, 80.0) is None


@pytest.mark.parametrize("stated", [76.0, 84.0, -80.0])
def test_another_ratio_of_a_flexible_transmission_is_found_with_its_value(stated):
    runs = bent(80.0, [0.5, 0.7, 0.9, 1.1])
    assert found_ratio(runs, stated) == pytest.approx(80.0, rel=0.002)


def test_motion_of_one_frequency_does_not_hide_another_ratio():
    torque = "proximal_torque_n_m"
    ends = "motor_angle_rad", "spindle_angle_rad"
    for stated, expected in ((35.0, None), (20.0, pytest.approx(35.0, rel=0.01))):
        runs = [run(35.0, 0.01)]
        found = other_ratio(runs, ends, stated, [torque], LowPass(20.0), Signals())
        assert found == expected


HEAD, ROD, NET = "head_pressure_pa", "rod_pressure_pa", "net_pressure_pa"
INERTIA = Part("inertia.missing", 1, {"acceleration": "piston_acceleration_m_s2"})
CYLINDER = Plant(
    name="cylinder",
    axes=(Axis("piston", "m"),),
    sensors=(Sensor("piston_position_m", "piston", "position"), Sensor(HEAD), Sensor(ROD)),
    derived=(Combination(NET, (Share(HEAD), Share(ROD, -0.64))),),
    equations=(Written("cylinder", NET, (INERTIA,)),),
)


def test_a_difference_of_two_pressures_is_not_taken_for_a_deflection():
    (model,) = declared(CYLINDER)
    time_s = np.arange(0.0, 4.0, 0.002)
    position = 0.01 * np.sin(9.0 * time_s)
    rod = 1e6 - 2e8 * position
    head = 0.64 * rod - 81.0 * 6e5 * position
    columns = {"piston_position_m": position, HEAD: head, ROD: rod}
    assert off_ratio(model, [Recording("run", time_s, columns)]) == ""


def test_what_never_moves_has_no_slope():
    still = run(35.0, 0.01).with_columns(spindle_angle_rad=np.zeros(2000))
    assert slope([still], "spindle_angle_rad", "motor_angle_rad") is None
