"""Left and right jaws: the side is stated by names, shown by signs, and never assumed."""

import numpy as np
import pytest

from rig.errors import DataError

LEFT, RIGHT = "Tool_4_Maryland_L_4", "Tool_4_Maryland_R_4"


@pytest.mark.parametrize(
    ("folder", "spindle"), [(RIGHT, "right"), ("bench", "right"), (RIGHT, "left"), (LEFT, "right")]
)
def test_a_right_jaw_reads_as_the_left_one_it_mirrors(load, folder, spindle):
    left = load()
    right = load(folder, spindle, mirrored=True)
    assert right.instrument.side == "right"
    assert right.columns.keys() == left.columns.keys()
    for name in left.columns:
        np.testing.assert_allclose(right[name], left[name], atol=1e-12, err_msg=name)
    assert "right jaw" in right.notes
    assert right.conditions == left.conditions


def test_a_load_logged_with_the_sign_of_its_side_is_positive(load):
    assert load(RIGHT, "right", mirrored=True, load_a=-0.3).conditions["load_command_a"] == 0.3


@pytest.mark.parametrize(
    ("folder", "spindle", "is_mirrored"),
    [
        (RIGHT, "right", False),
        (RIGHT, "left", False),
        ("bench", "right", False),
        (LEFT, "right", False),
        (LEFT, "left", True),
        ("bench", "left", True),
    ],
)
def test_a_stated_side_that_the_signs_contradict_is_refused(load, folder, spindle, is_mirrored):
    with pytest.raises(DataError, match=r"00\.TXT.*(left|right).*signs.*(left|right) jaw"):
        load(folder, spindle, mirrored=is_mirrored)


def test_a_load_that_pushes_a_left_jaw_shut_is_no_right_jaw(load):
    def pushed(rows):
        rows[:, 5] *= -1

    shut = load(load_a=-0.3, edit=pushed)
    assert shut.instrument.side == "left"
    assert np.median(shut["distal_torque_n_m"]) == -np.median(load()["distal_torque_n_m"])


def test_without_a_stated_side_the_signs_decide(load):
    right = load("bench", header=["%taken by a test"], mirrored=True)
    assert right.instrument.side == "right"
    assert np.median(right["distal_torque_n_m"]) > 0
    assert "side is stated nowhere" in right.notes
    assert load("bench", header=["%taken by a test"]).instrument.side == "left"


def without_load(rows):
    rows[:, 5] = np.rint(5 * np.sin(np.arange(len(rows))))


def test_without_a_load_the_names_decide(load):
    right = load(RIGHT, "right", mirrored=True, edit=without_load)
    assert right.instrument.side == "right"
    assert np.polyfit(right["spindle_angle_rad"], right["proximal_torque_n_m"], 1)[0] > 0
    assert "torque at the jaw does not show the side" in right.notes
    with pytest.raises(DataError, match="neither"):
        load("bench", header=["%taken by a test"], edit=without_load)
    with pytest.raises(DataError, match=r"folder.*right.*header.*left"):
        load(RIGHT, "left", mirrored=True, edit=without_load)


@pytest.mark.parametrize(
    ("column", "name"),
    [(2, "proximal_torque_n_m"), (3, "motor_current_a"), (7, "motor_command_ratio")],
)
def test_one_sign_that_contradicts_the_others_is_refused(load, column, name):
    def turn(rows):
        rows[:, column] *= -1

    with pytest.raises(DataError, match=rf"00\.TXT.*{name}.*sign"):
        load(edit=turn)


@pytest.mark.parametrize(("column", "name"), [(8, "motor_angle_rad"), (4, "jaw_angle_rad")])
def test_an_encoder_geared_to_the_spindle_takes_its_sign(load, column, name):
    def turn(rows):
        rows[:, column] *= -1

    turned, plain = load(edit=turn), load("bench")
    np.testing.assert_array_equal(turned[name], plain[name])
    assert f"{name} was logged with the opposite sign" in turned.notes
