"""Arm motion: 21 columns, 200 Hz, motor coordinates of the wrist converted."""

import lzma

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.errors import DataError
from rig.importers.dvrk_psm import IMPORTER, MOTOR_TO_JOINT

RNG = np.random.default_rng(1)
RAW = RNG.normal(size=(40, 21))


def text(rows=RAW, end="\n"):
    return "".join(",".join(f"{v:.17g}" for v in row) + end for row in rows)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "one18.csv"
    path.write_text(text())
    return path


def read(path):
    (recording,) = IMPORTER.open(path)
    return recording


def names(joint):
    if joint == 3:
        return "joint_3_position_m", "joint_3_velocity_m_s", "joint_3_force_n"
    return f"joint_{joint}_angle_rad", f"joint_{joint}_velocity_rad_s", f"joint_{joint}_torque_n_m"


def test_columns_rate_and_names(path):
    recording = read(path)
    assert recording.name == "one18"
    assert recording.sample_rate_hz == pytest.approx(200)
    assert set(recording.columns) == {n for j in range(1, 8) for n in names(j)}
    for joint in range(1, 5):
        for block, name in enumerate(names(joint)):
            np.testing.assert_array_equal(recording[name], RAW[:, 7 * block + joint - 1])


def test_the_wrist_becomes_joint_coordinates_with_equal_power(path):
    recording = read(path)
    wrist = [np.stack([recording[names(j)[k]] for j in (5, 6, 7)]) for k in range(3)]
    np.testing.assert_allclose(wrist[0][0], 1.0186 * RAW[:, 4])
    expected = -0.8306 * RAW[:, 4] + 0.6089 * (RAW[:, 5] + RAW[:, 6])
    np.testing.assert_allclose(wrist[0][1], expected)
    np.testing.assert_allclose(wrist[0][2], 1.2177 * (RAW[:, 6] - RAW[:, 5]))
    np.testing.assert_allclose(MOTOR_TO_JOINT.T @ wrist[2], RAW[:, 18:21].T)
    motor_power = (RAW[:, 11:14] * RAW[:, 18:21]).sum(axis=1)
    np.testing.assert_allclose((wrist[1] * wrist[2]).sum(axis=0), motor_power)


def test_packed_and_windows_files_read_the_same(path, tmp_path):
    packed = tmp_path / "two18.csv.xz"
    packed.write_bytes(lzma.compress(text(end="\r\n").encode()))
    assert IMPORTER.recognises(packed)
    campaign = IMPORTER.open(tmp_path)
    assert campaign.names == ("one18", "two18")
    one, two = campaign
    for name in one.columns:
        np.testing.assert_array_equal(one[name], two[name])
    packed.write_bytes(packed.read_bytes()[:-9])
    with pytest.raises(DataError, match=r"two18\.csv\.xz"):
        read(packed)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda t: "", r"line 0: there are 0 samples"),
        (lambda t: t[:-5], r"line 40: the file ends inside the line"),
        (lambda t: t + "1,2\n", r"line 41: the line has 2 columns.*21"),
        (lambda t: t + ",".join(["x"] * 21) + "\n", r"line 41: .*'x'"),
        (lambda t: t + ",".join(["nan"] * 21) + "\n", r"line 41: a value is not finite"),
        (lambda t: t + ",".join(["1e300"] * 21) + "\n", r"line 41: .*absurd"),
    ],
)
def test_damage_is_named_by_line(path, edit, message):
    path.write_text(edit(text()))
    with pytest.raises(DataError, match=r"one18\.csv, " + message):
        read(path)


def test_other_text_is_not_recognised(tmp_path):
    other = tmp_path / "other.csv"
    other.write_text("time,current\n1,2\n")
    assert not IMPORTER.recognises(other)
    empty = tmp_path / "empty"
    empty.mkdir()
    assert not IMPORTER.recognises(empty)
    with pytest.raises(DataError, match="holds no"):
        IMPORTER.open(empty)


@settings(max_examples=100)
@given(
    where=st.floats(0, 1),
    removed=st.integers(0, 30),
    inserted=st.text("0123456789.,-e\n_ ", max_size=9),
)
def test_mutated_text_reads_or_raises(path, where, removed, inserted):
    content = text(RAW[:6])
    at = round(where * len(content))
    content = content[:at] + inserted + content[at + removed :]
    path.write_text(content)
    try:
        recording = read(path)
    except DataError:
        return
    rows = np.array([[float(v) for v in line.split(",")] for line in content.splitlines()])
    np.testing.assert_array_equal(recording["joint_1_angle_rad"], rows[:, 0])
    np.testing.assert_array_equal(recording["joint_4_torque_n_m"], rows[:, 17])
