"""Every quirk of the MRDLab format, on synthetic logs; left and right jaws and their signs."""

import numpy as np
import pytest

from estimation.recording import Flag, Instrument
from rig.errors import DataError
from rig.importers.mrdlab import IMPORTER

COUNT_RAD = 2 * np.pi / 8192


def test_columns_become_si_and_closing_positive(load, make_log):
    recording = load()
    raw = make_log().rows()
    expected = {
        "spindle_angle_rad": -raw[:, 1] * COUNT_RAD,
        "proximal_torque_n_m": raw[:, 2] * 0.000039811,
        "jaw_angle_rad": np.deg2rad(raw[:, 4] * 0.09),
        "distal_torque_n_m": -raw[:, 5] * 0.000039811,
        "load_command_a": raw[:, 6],
        "motor_angle_rad": raw[:, 8] * 2 * np.pi / 4096,
        "target_angle_rad": -raw[:, 9] * COUNT_RAD,
    }
    assert set(expected) | {"motor_current_a", "motor_command_ratio"} == set(recording.columns)
    for name, values in expected.items():
        np.testing.assert_allclose(recording[name], values, rtol=1e-12, atol=1e-15, err_msg=name)
    closing = np.gradient(recording["spindle_angle_rad"]) > 1e-4
    for name in recording.columns:
        if name != "load_command_a":
            slope = np.polyfit(recording["spindle_angle_rad"][closing], recording[name][closing], 1)
            assert slope[0] > 0, name
    assert recording.valid.all()
    assert recording.started_at_ns is None
    assert recording.source.endswith("00.TXT")


@pytest.mark.parametrize("lines", [1, 8, 11, 14])
def test_header_lines_are_counted(load, lines):
    recording = load(header=[f"%line {i}" for i in range(lines)])
    assert len(recording) == 4000
    assert recording["spindle_angle_rad"][0] == pytest.approx(-1365 * COUNT_RAD)


def test_time_is_believed_by_its_step_not_by_the_header(load):
    in_seconds, in_ms = load(), load(stem="01", time_scale=1000.0)
    assert in_seconds.sample_rate_hz == pytest.approx(1000)
    np.testing.assert_allclose(in_seconds.time_s, in_ms.time_s, atol=1e-12)
    with pytest.raises(DataError, match=r"00\.TXT, line 6: time steps by 0\.005"):
        load(time_scale=5.0)


@pytest.mark.parametrize("unit", ["counts", "rad"])
def test_target_unit_is_found_by_fitting_it_to_the_spindle(load, unit):
    recording = load(target=unit)
    np.testing.assert_allclose(
        recording["target_angle_rad"], recording["spindle_angle_rad"], atol=1e-4
    )
    assert ("in rad" in recording.notes) == (unit == "rad")


@pytest.mark.parametrize(("target", "note"), [("zeros", "zeros only"), ("nonsense", "neither as")])
def test_a_target_that_cannot_be_used_is_left_out_with_a_note(load, target, note):
    recording = load(target=target)
    assert "target_angle_rad" not in recording
    assert note in recording.notes
    assert recording.conditions["frequency_hz"] == 0.5  # from the spindle


@pytest.mark.parametrize("frequency", [0.3, 0.5, 0.7])
def test_load_and_frequency_come_from_the_data_not_from_names_or_header(load, frequency):
    recording = load(stem="49", frequency_hz=frequency, load_a=0.7)
    assert recording.conditions["frequency_hz"] == frequency
    assert recording.conditions["load_command_a"] == 0.7
    assert recording.conditions["trajectory_amplitude_rad"] == pytest.approx(0.524)
    assert "jaw_stop_index" not in recording.conditions


def test_a_load_that_changes_is_no_condition(load):
    def staircase(rows):
        rows[2000:, 6] = 0.4

    recording = load(edit=staircase)
    assert "load_command_a" not in recording.conditions
    assert "load command changes" in recording.notes


def test_a_trajectory_that_is_no_sine_states_no_frequency(load):
    def ramp(rows):
        rows[:, 1] = np.rint(np.linspace(1300, 0, len(rows)))
        rows[:, 8] = -17.5 * rows[:, 1]
        rows[:, 9] = rows[:, 1]

    recording = load(edit=ramp)
    assert "frequency_hz" not in recording.conditions
    assert "not one sine" in recording.notes


@pytest.mark.parametrize(
    ("folder", "roll_deg", "pitch_deg"),
    [
        ("Tool_4_Maryland_L_Roll_1", -90, 0),
        ("Tool_4_Maryland_L_Roll_5", 90, 0),
        ("Tool_4_Maryland_L_Pitch_4", 0, -30),
        ("Tool_4_Maryland_L_Roll_9", None, None),
    ],
)
def test_wrist_from_the_folder_and_jaw_stop_from_the_stem(load, folder, roll_deg, pitch_deg):
    recording = load(folder=folder, stem="312")
    conditions = recording.conditions
    assert conditions["jaw_stop_index"] == 3
    assert ("Roll_9 is not one of" in recording.notes) == (roll_deg is None)
    if roll_deg is None:
        assert not {"wrist_roll_rad", "wrist_pitch_rad"} & set(conditions)
    else:
        assert conditions["wrist_roll_rad"] == pytest.approx(np.deg2rad(roll_deg))
        assert conditions["wrist_pitch_rad"] == pytest.approx(np.deg2rad(pitch_deg))


LOT = "N10150901 729"


@pytest.mark.parametrize(
    ("folder", "instrument", "note"),
    [
        ("Tool_4_Maryland_L_4", Instrument("Maryland", "tool 4", LOT, "left", mounting="4"), ""),
        ("Tool_4_Maryland_L_Roll_1", Instrument("Maryland", "tool 4", LOT, "left"), ""),
        (
            "Tool_5_Maryland_R_2",
            Instrument("Maryland", "tool 5", None, "right", mounting="2"),
            f"names tool 4, lot {LOT}; the folder names tool 5 and wins",
        ),
        ("bench", Instrument(None, "tool 4", LOT, "left"), "'bench' does not follow"),
    ],
)
def test_the_instrument_is_that_of_the_folder_and_else_of_the_header(
    load, folder, instrument, note
):
    recording = load(folder=folder, mirrored=instrument.side == "right")
    assert recording.instrument == instrument
    assert note in recording.notes


@pytest.mark.parametrize(("decimals", "quantum"), [(2, 0.01), (4, 1e-4)])
def test_coarse_commands_are_noted(load, decimals, quantum):
    recording = load(command_decimals=decimals)
    assert recording.conditions["command_quantum_ratio"] == quantum
    assert ("use the measured current" in recording.notes) == (quantum == 0.01)


def test_the_motor_zero_is_stated_and_not_taken_off(load):
    plain, shifted = load(), load(stem="40", motor_zero=-5888 + 100)
    step = 100 * 2 * np.pi / 4096
    np.testing.assert_allclose(shifted["motor_angle_rad"] - plain["motor_angle_rad"], step)
    zeros = [r.conditions["motor_zero_offset_rad"] for r in (plain, shifted)]
    assert zeros[1] - zeros[0] == pytest.approx(step)
    residual = plain["motor_angle_rad"] - 35 * plain["spindle_angle_rad"] - zeros[0]
    assert np.abs(residual).max() < 2 * np.pi / 4096


def test_clipped_current_and_excess_command_are_flagged(load):
    def clip(rows):
        rows[1000:1021, 3] = 0.56
        rows[2000:2011, 7] = 1.064

    recording = load(edit=clip)
    current, command = recording.stretches
    assert (current.channel, current.start_s, current.stop_s) == ("motor_current_a", 1.0, 1.02)
    assert (command.channel, command.start_s, command.stop_s) == ("motor_command_ratio", 2.0, 2.01)
    assert current.flag == command.flag == Flag.SATURATED
    assert "0.560 A" in current.reason
    assert np.flatnonzero(~recording.valid).tolist() == [*range(1000, 1021), *range(2000, 2011)]
    assert recording["motor_current_a"][1010] == 0.56  # flagged, not dropped


def test_a_runaway_is_flagged_and_the_rest_is_not(load):
    def runaway(rows):
        bump = np.rint(-600 * np.sin(np.linspace(0, np.pi, 160)))
        rows[2250:2410, 1] += bump
        rows[2250:2410, 8] -= 17.5 * bump

    (stretch,) = (recording := load(edit=runaway)).stretches
    assert stretch.flag == Flag.SUSPECT
    assert stretch.reason.startswith("runaway")
    assert 2.2 < stretch.start_s <= 2.25
    assert 2.41 <= stretch.stop_s < 2.46
    assert (recording.flags == Flag.SUSPECT).sum() < 260


def test_a_motor_that_lets_go_at_the_start_is_a_start_transient(load):
    def slip(rows):
        rows[:60, 8] -= np.rint(np.linspace(3000, 0, 60))

    (stretch,) = load(edit=slip, target="zeros").stretches
    assert stretch.start_s == 0.0
    assert stretch.stop_s < 0.1
    assert stretch.reason.startswith("start transient")


def test_a_gap_in_time_is_flagged_and_counted(load):
    def gap(rows):
        rows[1500:, 0] += 0.007

    recording = load(edit=gap)
    (stretch,) = recording.stretches
    assert stretch.flag == Flag.MISSING
    assert stretch.reason.startswith("7 samples are missing")
    assert np.flatnonzero(~recording.valid).tolist() == [1500]


def test_carriage_returns_and_explicit_signs_are_read(tmp_path, make_log):
    path = tmp_path / "00.TXT"
    text = make_log(seconds=0.1, frequency_hz=20.0).text()
    path.write_bytes(text.replace("\n", "\r\n").replace(",189,", ",+189.,").encode())
    recording = IMPORTER.open(path).runs[0].recording()
    assert recording["jaw_angle_rad"][0] == pytest.approx(np.deg2rad(189 * 0.09))


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
