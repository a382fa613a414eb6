"""A channel and its derivative must agree: rate, sign and time are checked in every format."""

import numpy as np
import pytest
from scipy.io import savemat

from rig.errors import DataError
from rig.importers.registry import open_campaign

RATE_HZ = 200.0
TIME = np.arange(0, 20, 1 / RATE_HZ)


def motion(time, seed=0):
    """Angle and velocity of a sum of sines from 0.15 to 0.9 Hz."""
    rng = np.random.default_rng(seed)
    angle, velocity = np.zeros_like(time), np.zeros_like(time)
    for harmonic in range(1, 7):
        w, phase = 2 * np.pi * 0.1543 * harmonic, rng.uniform(0, 2 * np.pi)
        angle += np.sin(w * time + phase) / harmonic
        velocity += w * np.cos(w * time + phase) / harmonic
    return angle, velocity


def imported(tmp_path, time=TIME, **channels):
    savemat(tmp_path / "run.mat", {"time_s": time, **channels})
    (recording,) = open_campaign(tmp_path / "run.mat")
    return recording


def noisy(values, share, seed=1):
    return values + share * values.std() * np.random.default_rng(seed).normal(size=values.size)


@pytest.mark.parametrize(
    ("names", "factor", "message"),
    [
        (
            ("drive_angle_rad", "drive_velocity_rad_s"),
            0.5,
            r"drive_angle_rad.*(1\.99|2\.0.) times.*states; a sample rate that is wrong by this",
        ),
        (("drive_position_m", "drive_velocity_m_s"), 1.25, r"0\.(79|8)\d* times"),
        (("drive_velocity_rad_s", "drive_acceleration_rad_s2"), 60 / (2 * np.pi), r"times"),
        (("drive_angle_rad", "drive_speed_rad_s"), -1.0, r"opposite sign"),
    ],
)
def test_a_factor_or_a_sign_is_refused(tmp_path, names, factor, message):
    angle, velocity = motion(TIME)
    pair = dict(zip(names, (angle, factor * noisy(velocity, 0.1)), strict=True))
    with pytest.raises(DataError, match=r"run\.mat.*" + message):
        imported(tmp_path, **pair)


UNITS = {
    "a speed in rpm": (1.0, 30 / np.pi, "drive_velocity_rad_s in rpm"),
    "a speed in deg/s": (1.0, 180 / np.pi, "drive_velocity_rad_s in deg/s"),
    "a speed in rad/s stated as rpm": (1.0, np.pi / 30, "drive_velocity_rad_s stated in rpm"),
    "an angle in deg": (180 / np.pi, 1.0, "drive_angle_rad in deg"),
    "an angle in rad stated as deg": (np.pi / 180, 1.0, "drive_angle_rad stated in deg"),
}


@pytest.mark.parametrize("case", UNITS.values(), ids=UNITS)
def test_a_unit_that_explains_a_factor_is_named_first(tmp_path, case):
    of_angle, of_velocity, unit = case
    angle, velocity = motion(TIME)
    channels = {
        "drive_angle_rad": of_angle * noisy(angle, 0.002),
        "drive_velocity_rad_s": of_velocity * noisy(velocity, 0.02),
    }
    with pytest.raises(DataError) as error:
        imported(tmp_path, **channels)
    said = error.value.what
    assert unit in said
    assert said.index(unit) < said.index("or a sample rate")


@pytest.mark.parametrize("shift_samples", [-60, -8, 10, 120])
def test_a_shift_is_refused_and_measured(tmp_path, shift_samples):
    angle, _ = motion(TIME)
    _, velocity = motion(TIME - shift_samples / RATE_HZ)
    way = "after" if shift_samples > 0 else "before"
    with pytest.raises(DataError, match=rf"{abs(shift_samples) * 5} ms {way}"):
        imported(tmp_path, drive_angle_rad=angle, drive_velocity_rad_s=noisy(velocity, 0.05))


def test_a_true_pair_and_what_stands_still_or_belongs_to_something_else_are_read(tmp_path):
    angle, velocity = motion(TIME)
    rng = np.random.default_rng(3)
    recording = imported(
        tmp_path,
        drive_angle_rad=angle,
        drive_velocity_rad_s=noisy(velocity, 0.3),
        still_angle_rad=1e-4 * rng.normal(size=TIME.size),
        still_velocity_rad_s=1e-2 * rng.normal(size=TIME.size),
        motor_angle_rad=angle,
        spindle_velocity_rad_s=-velocity,
    )
    assert len(recording) == TIME.size


def arm_text(rate_hz, edit=None, seconds=20.0):
    """Motion of seven joints as the arm's format holds it: no header and no time."""
    time = np.arange(0, seconds, 1 / rate_hz)
    pairs = [motion(time, joint) for joint in range(7)]
    angle, velocity = (np.array(block) for block in zip(*pairs, strict=True))
    velocity[3:] = [noisy(row, 0.3) for row in velocity[3:]]
    rows = np.vstack([angle, velocity, np.random.default_rng(0).normal(size=angle.shape)])
    if edit is not None:
        edit(rows)
    return "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows.T)


@pytest.mark.parametrize("rate_hz", [100.0, 200.0, 250.0])
def test_the_arms_rate_is_that_of_its_own_velocities(tmp_path, rate_hz):
    (tmp_path / "run.csv").write_text(arm_text(rate_hz))
    (recording,) = open_campaign(tmp_path / "run.csv")
    assert recording.sample_rate_hz == pytest.approx(rate_hz)
    assert f"{rate_hz:g} Hz" in recording.notes
    angle, velocity = recording["joint_1_angle_rad"], recording["joint_1_velocity_rad_s"]
    slope = np.polyfit(velocity, np.gradient(angle, recording.time_s), 1)[0]
    assert slope == pytest.approx(1, abs=0.02)


def test_an_arm_that_does_not_move_has_the_formats_rate_and_reports_it(tmp_path):
    def still(rows):
        rows[:] = np.random.default_rng(1).normal(size=rows.shape)

    (tmp_path / "run.csv").write_text(arm_text(200.0, still))
    (recording,) = open_campaign(tmp_path / "run.csv")
    assert recording.sample_rate_hz == pytest.approx(200)
    assert "does not show the sample rate" in recording.notes


def test_joints_of_different_rates_are_refused(tmp_path):
    def halved(rows):
        rows[7] /= 2

    def turned(rows):
        rows[8] *= -1

    for edit, message in ((halved, r"run\.csv.*joint 1"), (turned, r"run\.csv.*joint_2.*sign")):
        (tmp_path / "run.csv").write_text(arm_text(200.0, edit))
        with pytest.raises(DataError, match=message):
            list(open_campaign(tmp_path / "run.csv"))
