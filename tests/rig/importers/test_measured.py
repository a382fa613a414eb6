"""The importers on the measured data: signs, quirks and flags as they are known to be there."""

import numpy as np
import pytest

from estimation.recording import Flag
from rig.importers.dvrk_psm import IMPORTER as PSM
from rig.importers.jaw_steps import JAW, with_one_zero
from rig.importers.mrdlab import IMPORTER

pytestmark = [pytest.mark.long, pytest.mark.measured]


@pytest.fixture(scope="module")
def campaign(measured_data):
    """Open one folder's archive."""
    return lambda folder: IMPORTER.open(measured_data / f"mrdlab-{folder}.tar.xz")


@pytest.fixture(scope="module")
def reference(campaign):
    return campaign("Tool_4_Maryland_L_4")


def fit(x, y):
    """Slope and intercept of y over x."""
    return np.polyfit(x, y, 1)


def closing(recording):
    """Samples in which the spindle closes at 0.25 rad/s or more, without the ends of the run."""
    angle = np.convolve(recording["spindle_angle_rad"], np.ones(41) / 41, "same")
    moving = np.gradient(angle, recording.time_s) >= 0.25
    moving[:1000] = moving[-1000:] = False
    return moving & recording.valid


def test_the_folder_holds_its_factorial_design(reference):
    assert reference.names == tuple(f"{i:02d}" for i in range(50))
    conditions = [r.conditions for r in reference]
    grid = [(c["frequency_hz"], c["load_command_a"]) for c in conditions]
    assert grid == [(round(f, 1), round(a, 1)) for f in np.arange(0.1, 0.6, 0.1)
                    for a in np.arange(0.1, 1.1, 0.1)]  # fmt: skip
    assert {c["command_quantum_ratio"] for c in conditions} == {1e-4}


@pytest.mark.parametrize("run", [4, 25, 49])
def test_closing_is_positive_in_every_channel(reference, run):
    recording = reference.runs[run].recording()
    part = closing(recording)
    current, torque = recording["motor_current_a"][part], recording["proximal_torque_n_m"][part]
    spindle = recording["spindle_angle_rad"]
    command = recording["motor_command_ratio"][part]
    distal = recording["distal_torque_n_m"][part]
    assert 0.4 < fit(current, torque)[0] < 1.2  # torque constant behind the gear, N m/A
    assert 1.5 < fit(command, current)[0] < 2.5  # measured: 2.06 A at full command
    assert fit(spindle[part], torque)[0] > 0.02  # stiffness, N m/rad
    assert fit(torque, distal)[0] > 0.1  # transmission
    assert fit(spindle, recording["motor_angle_rad"])[0] == pytest.approx(35, rel=0.02)
    assert fit(spindle, recording["jaw_angle_rad"])[0] == pytest.approx(0.88, abs=0.04)
    assert fit(spindle, recording["target_angle_rad"])[0] == pytest.approx(1, abs=0.06)
    assert recording["load_command_a"][0] == recording.conditions["load_command_a"]
    assert np.median(distal) > 0


def test_the_runaway_of_run_07_is_flagged(reference):
    recording = reference.runs[7].recording()
    at = np.flatnonzero(~recording.valid)
    inside = (recording.time_s >= 17.25) & (recording.time_s <= 17.41)
    assert not recording.valid[inside].any()
    assert 17.2 < recording.time_s[at[0]] < recording.time_s[at[-1]] < 17.5
    reasons = " ".join(s.reason for s in recording.stretches)
    for said in ("runaway", "0.561 A", "1.064"):
        assert said in reasons
    assert {s.flag for s in recording.stretches} == {Flag.SUSPECT, Flag.SATURATED}


def test_only_the_runaway_and_a_start_transient_are_flagged(reference):
    assert [r.name for r in reference if not r.valid.all()] == ["07", "39"]
    (stretch,) = reference.runs[39].recording().stretches
    assert stretch.start_s == 0.0
    assert 0.24 < stretch.stop_s < 0.4
    assert stretch.reason.startswith("start transient")


def test_the_jaws_zero_steps_before_run_39_and_back_before_run_43(reference):
    _, (first, second) = with_one_zero(reference, JAW)
    assert (first.run, second.run) == ("39", "43")
    assert np.rad2deg(first.step_rad) == pytest.approx(0.54, abs=0.1)
    assert np.rad2deg(second.step_rad) == pytest.approx(-0.56, abs=0.1)


@pytest.mark.parametrize(
    ("folder", "roll_deg", "pitch_deg", "runs"),
    [("Tool_4_Maryland_L_Roll_4", 45, 0, 20), ("Tool_4_Maryland_L_Pitch_1", 0, 60, 16)],
)
def test_wrist_folders(campaign, folder, roll_deg, pitch_deg, runs):
    recordings = list(campaign(folder))
    assert len(recordings) == runs
    flagged = {r.name for r in recordings if not r.valid.all()}
    # a slip of the gear in each, seen as a step of the motor's zero that stays
    assert flagged == ({"003"} if roll_deg else {"103"})
    for recording in recordings:
        assert recording.conditions["wrist_roll_rad"] == pytest.approx(np.deg2rad(roll_deg))
        assert recording.conditions["wrist_pitch_rad"] == pytest.approx(np.deg2rad(pitch_deg))
        assert recording.conditions["jaw_stop_index"] == int(recording.name[0])
        assert recording.conditions["frequency_hz"] in (0.3, 0.5)
        assert recording.instrument.lot == "N10150901 729"
        assert f"{roll_deg or pitch_deg} degrees" in recording.notes
    assert len({r.conditions["trajectory_centre_rad"] for r in recordings}) == (
        5 if roll_deg else 2
    )


def test_arm_files(measured_data):
    campaign = PSM.open(measured_data / "psm")
    assert campaign.names == ("one18", "one19", "one19_insertion_105g", "two18")
    recording = campaign.runs[0].recording()
    assert len(recording) == 5999
    for joint in (1, 2):
        angle, velocity = (
            recording[f"joint_{joint}_{unit}"] for unit in ("angle_rad", "velocity_rad_s")
        )
        assert fit(velocity, np.gradient(angle, recording.time_s))[0] == pytest.approx(1, abs=0.05)
    # the trajectory repeats every 6.4806 s, after the conversion too
    period = round(6.4806 * 200)
    for name in ("joint_5_torque_n_m", "joint_6_angle_rad", "joint_7_angle_rad"):
        values = recording[name]
        error = np.std(values[period:] - values[:-period]) / np.ptp(values)
        assert error < 0.03, name
