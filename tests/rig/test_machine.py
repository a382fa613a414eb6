"""`rig machine`, and recordings of a machine that a file describes."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.rigs import draw
from estimation import model_file
from estimation.plant import (
    Actuator,
    Axis,
    Load,
    Part,
    Plant,
    Sensor,
    Transmission,
    Written,
)
from estimation.plant_file import parse, shipped_plant, to_toml
from estimation.plant_models import declared
from estimation.recording import Recording
from rig.errors import ExitCode
from rig.log.convert import write_recording
from rig.machines.shipped import read_machine, shipped
from tests.rig.importers.conftest import text_table

SLIDE = Plant(
    name="slide",
    run_offsets=False,
    axes=(Axis("carriage", "m"),),
    actuators=(Actuator("drive_force_n", "carriage"),),
    sensors=(Sensor("carriage_position_m", "carriage", "position"),),
)
DATA = """
[data]
[data.columns]
time_s = "t"
carriage_position_m = "x:mm"
drive_force_n = "volts:35 N"
[data.runs]
lap_s = 3.0
"""


def written(file, data=DATA, **changes):
    """Write the file of the slide, or of one that differs from it, and return the file."""
    file.write_text(to_toml(replace(SLIDE, **changes)) + data)
    return file


INERTIAS = [
    Part("inertia.missing", 1, {"acceleration": f"{scaled}arm_acceleration_rad_s2"})
    for scaled in ("", "scaled_")
]
FRICTION = Part("friction.viscous", 1, {"speed": "arm_velocity_rad_s"})
PENDULUM = Plant(
    name="pendulum",
    cutoff_hz=10.0,
    run_offsets=False,
    axes=(Axis("arm", "rad"),),
    sensors=(
        Sensor("arm_angle_rad", "arm", "position"),
        Sensor("arm_current_a"),
        Sensor("scaled_arm_angle_rad"),
    ),
    equations=(Written("swing", "arm_current_a", (*INERTIAS, FRICTION)),),
)
"""A pendulum whose inertia follows its weight."""
SWINGS = r"""
[data]
file_name = '\d_m(?P<mass>\d\.\d+)'
[data.columns]
time_s = "t"
arm_angle_rad = "q"
arm_current_a = "i"
[data.conditions]
mass_kg = "mass"
[data.formulas]
scaled_arm_angle_rad = "mass_kg * 0.3**2 * arm_angle_rad"
"""


def slide_table(folder, runs=8):
    time_s = np.arange(0.0, 3.0 * runs, 2e-3)
    turns = 2 * np.pi * time_s
    position = 0.1 * np.sin(turns / 3.0) + 0.02 * np.sin(0.9 * turns)
    speed = np.gradient(position, time_s)
    force = 95.0 * np.gradient(speed, time_s) + 200.0 * speed + 20.0 * np.tanh(speed / 2e-3)
    force += np.random.default_rng(1).normal(0.0, 0.5, time_s.size)
    columns = {"t": time_s, "x": 1e3 * position, "volts": force / 35.0}
    return text_table(folder / "slide.csv", columns)


def read_back(table):
    """Return time, position and voltage of a table of the slide."""
    return np.loadtxt(table, delimiter=",", skiprows=1, unpack=True)


@pytest.fixture
def slide(tmp_path):
    return written(tmp_path / "slide.toml"), slide_table(tmp_path)


@pytest.mark.parametrize("name", sorted(shipped()))
def test_a_shipped_machine_can_be_declared_written_again_and_shown_as_json(name, answered):
    plant = read_machine(Path(name))
    assert declared(plant)
    assert parse(to_toml(plant)) == plant
    shown = answered("machine show", name)
    assert shown["machine"]["name"] == plant.name
    effects = [effect for equation in shown["equations"] for effect in equation["effects"]]
    assert all(effect["id"] and effect["parameters"] for effect in effects)


def test_a_table_in_millimetres_and_volts_is_fitted_in_metres_and_newtons(
    slide, tmp_path, said, answered
):
    file, table = slide
    (equation,) = answered("machine check", file, table)["check"]["equations"]
    found = {p["name"]: (p["value"], p["unit"]) for p in equation["parameters"]}
    assert found["inertia"] == (pytest.approx(95.0, rel=0.05), "N s^2/m")
    assert found["damping"] == (pytest.approx(200.0, rel=0.05), "N s/m")
    assert found["friction"] == (pytest.approx(20.0, rel=0.1), "N")
    model = tmp_path / "slide.model.toml"
    assert re.search(r"inertia = 9\d\.\d+ kg: mass", said("machine check", file, table).out)
    assert re.search(r"inertia .* kg ", said("fit", table, "--machine", file, "--out", model).out)
    words = ("replay", table, "--machine", file, "--model", model)
    assert "drive_force_n" in said(*words, "--speed 0 --json").out
    header = tmp_path / "slide.h"
    assert "No interval" not in said(*words, "--speed 0 --json").err
    assert "500 calls a second" in said("export", model, "--out", header).out
    assert "then every 1 / 500.0 s" in header.read_text()
    assert "opening" not in header.read_text()
    exported = header.read_text()
    assert "is there already" in said("export", model, "--out", header, code=2).err
    assert header.read_text() == exported
    faster = tmp_path / "faster.h"
    said("export", model, "--out", faster, "--rate 1000")
    assert "then every 1 / 1000.0 s" in faster.read_text()
    refused = said("export", model, "--out", tmp_path / "negative.h", "--rate -5", code=2).err
    assert "--rate" in refused
    assert "cutoff_hz" not in refused
    model.write_text(re.sub("half_width = .*", "", model.read_text()))
    assert "No interval: slide.model.toml" in said(*words, "--speed 0 --plain").err
    assert (
        "No interval: slide.model.toml" in said("export", model, "--out", tmp_path / "third.h").out
    )


def test_a_diagnosis_ends_with_the_replay_of_its_model(slide, tmp_path, said, monkeypatch):
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    why = "friction.dwell remembers the samples before."
    monkeypatch.setattr("estimation.estimators.c_header.refused", lambda _: why)
    file, table = slide
    model = tmp_path / "found.toml"
    printed = said("diagnose", table, "--quick --machine", file, "--model-out", model).out
    command = f"rig replay {table} --machine {file} --model {model}"
    printed = " ".join(printed.split())
    assert command in printed
    errors = re.search(r"and (\S+) N with the causal .* too, .*, it is (\S+) N: a replay", printed)
    assert float(errors[2]) > 1.2 * float(errors[1])  # at reversals the filters are late
    assert "model use" not in printed
    assert f"carriage: `rig export` cannot write it: {why}" in printed
    evidence = model_file.read(model).evidence
    assert evidence.half_width > 4 * evidence.rmse_with_means  # of live errors, on two runs
    assert "estimate against sensor" in said(command.removeprefix("rig "), "--speed 0").out


def loaded(folder, run_offsets):
    """Write the file of the slide with a force cell."""
    data = DATA.replace("[data.runs]", 'belt_force_n = "cell"\n[data.runs]')
    sensors = (*SLIDE.sensors, Sensor("belt_force_n", "carriage", "effort"))
    return written(folder / "slide.toml", data, sensors=sensors, run_offsets=run_offsets)


@pytest.mark.parametrize("constant_n", [0.0, 60.0])
def test_a_load_that_differs_between_runs_and_is_left_out_is_reported(
    tmp_path, said, answered, constant_n
):
    table = slide_table(tmp_path)
    time_s, x, volts = read_back(table)
    load = constant_n * (np.floor(time_s / 3.0) % 3)
    drive = 35.0 * volts + load + 8.0 * np.sign(np.gradient(x))
    cell = 0.9 * 35.0 * volts + load
    text_table(table, {"t": time_s, "x": x, "volts": drive / 35.0, "cell": cell})
    for stated, reported in ((True, constant_n > 0), (False, False)):
        file = loaded(tmp_path, run_offsets=stated)
        printed = said("machine check", file, table).out
        assert ("The fit ignores it (run_offsets = true)" in printed) == reported
        if stated:
            notes = answered("diagnose --quick", table, "--machine", file)["notes"]
            assert any("State false if the zeros" in note for note in notes) == reported


def test_zeros_that_differ_between_runs_are_not_taken_for_a_load(tmp_path, said):
    """With the means of runs in the fit such an error would remain, and spoil the parameters."""
    table = slide_table(tmp_path)
    time_s, x, volts = read_back(table)
    zero = 60.0 * np.random.default_rng(3).normal(size=8)[(time_s / 3.0).astype(int)]
    drive, cell = 35.0 * volts + 8.0 * np.sign(np.gradient(x)), 0.9 * 35.0 * volts + zero
    text_table(table, {"t": time_s, "x": x, "volts": drive / 35.0, "cell": cell})
    printed = said("machine check", loaded(tmp_path, run_offsets=True), table).out
    assert "zeros that differ from run to run, or a load that the equation does not read" in printed
    assert "State false" not in printed


def test_without_a_drive_and_without_a_reading_of_effort_both_are_named(tmp_path, said):
    printed = said("machine check", written(tmp_path / "bare.toml", actuators=()), code=1).out
    assert "An [[actuator]], or a [[sensor]] that reads an effort" in printed


def test_a_faulty_machine_file_is_a_slip_in_every_command(slide, said):
    file, table = slide
    file.write_text(file.read_text().replace('"position"', '"position"\nstep = 3'))
    for command in (
        ["machine check"],
        ["fit", table, "--machine"],
        ["diagnose", table, "--machine"],
    ):
        assert "unknown key 'step'" in said(*command, file, code=ExitCode.USAGE).err


def test_what_equations_of_ones_own_identify_needs_no_actuator(tmp_path, said):
    friction = Part("friction.viscous", 1, {"speed": "carriage_velocity_m_s"})
    own = (Written("carriage", "drive_force_n", (friction,)),)
    file = written(tmp_path / "own.toml", actuators=(), equations=own)
    printed = said("machine check", file).out
    assert "friction.viscous, damping" in printed
    assert "Not identified" not in printed


def test_an_inertia_that_follows_a_condition_is_an_effect_of_the_scaled_angle(tmp_path, answered):
    runs, file = tmp_path / "runs", tmp_path / "pendulum.toml"
    runs.mkdir()
    time_s, random = np.arange(0, 6, 0.01), np.random.default_rng(1)
    for k, mass in enumerate((0.1, 0.2, 0.35, 0.5)):
        rate = 2.0 + 0.7 * k
        angle = np.sin(rate * time_s)
        speed, acceleration = rate * np.cos(rate * time_s), -(rate**2) * angle
        current = (0.02 + 1.5 * mass * 0.3**2) * acceleration + 0.1 * speed
        columns = np.column_stack([time_s, angle, current + random.normal(0, 1e-3, time_s.size)])
        np.savetxt(runs / f"{k}_m{mass:.2f}.csv", columns, "%.6f", ",", header="t,q,i", comments="")
    file.write_text(to_toml(PENDULUM) + SWINGS)
    (found,) = answered("machine check", file, runs)["check"]["equations"]
    values = {one["effect"]: one["value"] for one in found["parameters"]}
    of = "inertia.missing({}arm_acceleration_rad_s2)"
    assert values[of.format("")] == pytest.approx(0.02, rel=0.05)
    assert values[of.format("scaled_")] == pytest.approx(1.5, rel=0.05)


def test_a_temperature_that_causes_may_read_is_not_unused(tmp_path, said):
    warm = (*SLIDE.sensors, Sensor("nut_temperature_k", "carriage", "temperature"))
    printed = said("machine check", written(tmp_path / "warm.toml", sensors=warm)).out
    assert "Read by no equation" not in printed
    assert "Read by causes of a diagnosis alone: nut_temperature_k." in printed


@pytest.mark.parametrize("one_way", [True, False])
def test_friction_and_offset_of_a_machine_that_moves_one_way_are_not_separated(
    slide, said, one_way
):
    file, table = slide
    time_s, x, volts = read_back(table)
    if one_way:
        text_table(table, {"t": time_s, "x": x + 500.0 * time_s, "volts": volts})
    printed = " ".join(said("machine check", file, table).out.split())
    reason = "carriage_velocity_m_s never changes its sign: Coulomb friction and the offset cannot"
    assert (reason in printed) == one_way


def test_an_acceleration_that_is_mostly_noise_is_reported_with_a_cutoff_that_helps(slide, said):
    file, table = slide
    time_s, x, volts = read_back(table)
    noise = np.random.default_rng(2).normal(0.0, 0.02, len(x))
    text_table(table, {"t": time_s, "x": x + noise, "volts": volts})
    printed = " ".join(said("machine check", file, table).out.split())
    (cutoff_hz,) = re.findall(
        r"of carriage_acceleration_m_s2 is noise of .* cutoff_hz = (\d+) under", printed
    )
    written(file, cutoff_hz=float(cutoff_hz))
    assert "is noise of its reading" not in said("machine check", file, table).out


def test_a_load_that_is_a_condition_is_named(slide, said):
    file, table = slide
    data = f"{DATA}[data.conditions]\nweight_n = {{ value = 3.0 }}\n"
    written(file, data, loads=(Load("weight_n", "carriage"),))
    move = "weight_n is a condition: move its line from [data.conditions] to [data.columns]."
    printed = said("machine check", file, table, code=1).out
    assert f"weight_n was not recorded as a channel: {move}" in " ".join(printed.split())
    for command in ("fit", "diagnose"):
        printed = said(f"{command}", table, "--machine", file, code=5).err
        assert move in " ".join(printed.split())


def test_a_clipped_channel_is_asked_about_at_every_step(slide, tmp_path, said, answered):
    """Of tables and of logs; samples that are flagged as invalid do not count."""
    file, table = slide
    time_s, x, volts = read_back(table)
    text_table(table, {"t": time_s, "x": x, "volts": np.clip(volts, -1.2, 1.2)})
    logs = tmp_path / "logs"
    asked = said("import", table, "--machine", file, "--out", logs).err
    assert "drive_force_n: " in asked
    for data in (table, logs):
        assert "is it clipped?" in said("machine check", file, data).out
    assert "is it clipped?" in said("fit", logs, "--machine", file).out
    notes = answered("diagnose --quick", logs, "--machine", file)["notes"]
    assert any(note.startswith("Check: drive_force_n: ") for note in notes)
    flagged = '[[data.invalid]]\nwhen = "abs(drive_force_n) >= 42"\nreason = "clipped"\n'
    file.write_text(file.read_text() + flagged)
    assert "clipped" not in said("machine check", file, table).out


def screw(file, ratio: float) -> None:
    """Write the slide with a motor and a screw of a ratio; the motor's angle is x in rad."""
    written(
        file,
        DATA.replace("[data.runs]", 'motor_angle_rad = "x:rad"\n[data.runs]'),
        axes=(*SLIDE.axes, Axis("motor", "rad")),
        transmissions=(Transmission("screw", "motor", "carriage", ratio),),
        sensors=(*SLIDE.sensors, Sensor("motor_angle_rad", "motor", "position")),
    )


def test_counts_that_contradict_the_ratio_are_named_by_every_command(slide, said, answered):
    """A fit is then wrong by that factor, and its error may be as small as with the right one."""
    file, table = slide
    screw(file, 500.0)
    wrong = "states the ratio 500 for screw, but motor_angle_rad changes 1000 times as much"
    assert wrong in " ".join(said("machine check", file, table, code=1).out.split())
    assert f"Check: the machine file {wrong}" in said("fit", table, "--machine", file).out
    notes = answered("diagnose --quick", table, "--machine", file)["notes"]
    assert any(note.startswith(f"Check: the machine file {wrong}") for note in notes)


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (1000.0 * 57.3, "off by 57.3, the degrees of a radian. Correct the ratio, or the unit of"),
        (1000.0 / 57.3, "off by 57.3, the degrees of a radian. Correct the ratio, or the unit of"),
        (1e6, "off by 1e+03, the step from milli. Correct the ratio, or the unit of"),
        (1000.0 * 13.7, "as carriage_position_m. Correct the ratio, or the counts of"),
    ],
)
def test_a_ratio_that_is_off_by_the_factor_of_a_unit_is_answered_with_it(slide, said, ratio, words):
    """The motor turns a thousand times as far as the carriage moves."""
    file, table = slide
    screw(file, ratio)
    assert words in " ".join(said("machine check", file, table, code=1).out.split())


def test_a_column_that_was_not_recorded_is_named(slide, said):
    file, table = slide
    written(file, DATA.replace("drive_force_n", "motor_force_n"))
    printed = said("machine check", file, table, code=1).out
    assert "drive_force_n was not recorded. Did you mean 'motor_force_n'?" in printed


def test_a_channel_that_the_file_does_not_state_is_refused_without_recordings(slide, said):
    file, _ = slide
    inertia = Part("inertia.missing", 1, {"acceleration": "carriage_acceleration_m_s2"})
    belt = Part("transmission.ratio", 1, {"load": "belt_frc_n"})
    data = DATA.replace("[data.runs]", 'belt_force_n = "cell"\n[data.runs]')
    written(file, data, equations=(Written("belt", "drive_force_n", (inertia, belt)),))
    printed = said("machine check", file, code=1).out
    assert "belt_frc_n is not among the channels of [data]. Did you mean 'belt_force_n'?" in printed
    file.write_text(file.read_text().replace("belt_frc_n", "belt_force_n"))
    said("machine check", file)


def test_the_nearest_equation_is_proposed(slide, said):
    file, table = slide
    printed = said("diagnose", table, "--machine", file, "--equation", "cariage", code=2).err
    assert "Did you mean 'carriage'?" in printed


def named_by_channel(folder: Path, rename: str = "") -> None:
    """Write tables whose columns are called as the channels of the slide are."""
    for k in range(4):
        time_s = np.arange(0.0, 6.0, 0.01)
        position_m = 0.1 * np.sin(time_s * (1.0 + 0.2 * k))
        force_n = 10.0 * np.gradient(np.gradient(position_m, time_s), time_s) + 2.0 * np.sign(
            np.gradient(position_m, time_s)
        )
        head = "carriage_position_m,time_s,drive_force_n,note_1".replace(rename or "?", "other")
        table = np.column_stack([position_m, time_s, force_n, np.zeros(len(time_s))])
        np.savetxt(folder / f"run-{k}.csv", table, delimiter=",", header=head, comments="")


BARE = """
schema = "rig.machine/1"
machine = { name = "slide", cutoff_hz = 20.0 }
axis = [{ name = "carriage", unit = "m" }]
actuator = [{ name = "drive_force_n", axis = "carriage" }]
sensor = [{ name = "carriage_position_m", axis = "carriage", reads = "position" }]
"""


def bare(folder: Path) -> Path:
    """Write the slide's machine file without a mapping."""
    (folder / "slide.toml").write_text(BARE)
    return folder / "slide.toml"


def test_columns_that_are_called_as_the_channels_need_no_mapping(tmp_path, said):
    file = bare(tmp_path)
    named_by_channel(tmp_path)
    out = said("machine check", file, tmp_path).out
    assert float(re.search(r"inertia = ([\d.]+)", out).group(1)) == pytest.approx(10.0, rel=0.05)
    assert "inertia = " in said("machine check", file, tmp_path / "run-2.csv").out
    assert "carriage_position_m" in said("import", tmp_path, "--machine", file, "--preview").out


def test_several_files_on_the_command_line_are_answered_with_their_folder(tmp_path, said):
    file = bare(tmp_path)
    named_by_channel(tmp_path)
    tables = sorted(tmp_path.glob("*.csv"))
    assert "name the folder" in said("machine check", file, *tables, code=ExitCode.USAGE).err


def test_a_table_that_lacks_a_channel_of_the_machine_needs_a_mapping(tmp_path, said):
    file = bare(tmp_path)
    named_by_channel(tmp_path, rename="drive_force_n")
    assert "[data]" in said("machine check", file, tmp_path, code=ExitCode.DATA).err


def test_a_table_without_a_machine_file_is_answered_with_the_option_that_reads_it(slide, said):
    _, table = slide
    assert "--machine FILE" in said("diagnose", table, code=5).err


def test_a_machine_without_any_equation_reports_what_is_needed(tmp_path, said):
    file = written(tmp_path / "bare.toml", data="", sensors=())
    printed = said("machine check", file, code=1).out
    assert "No equation can be written for slide." in printed
    assert "Needed: A sensor of position or speed on one of carriage." in printed
    printed = said("diagnose", tmp_path, "--machine", file, code=ExitCode.USAGE).err
    assert "No equation can be written for slide." in printed
    assert f"rig machine check {file}" in printed


def speed_read_slide(folder, asymmetry=0.0, noise_mm_s=0.0):
    """Return the file and the table of a slide whose speed alone is read."""
    time_s, x, volts = read_back(slide_table(folder))
    speed = np.gradient(x, time_s)
    force = 35.0 * volts + asymmetry * np.abs(speed)
    speed += np.random.default_rng(4).normal(0.0, noise_mm_s, len(x))
    columns = {"t": time_s, "v": speed, "volts": force / 35.0}
    table = text_table(folder / "slide.csv", columns)
    data = DATA.replace('position_m = "x:mm"', 'velocity_m_s = "v:mm/s"')
    sensors = (Sensor("carriage_velocity_m_s", "carriage", "speed"),)
    return written(folder / "slide.toml", data, sensors=sensors), table


def test_the_noise_of_a_sensor_of_speed_counts_as_noise(tmp_path, answered):
    """The acceleration is the derivative of the noisy speed; nothing is missing here."""
    file, table = speed_read_slide(tmp_path, noise_mm_s=2.0)
    answer = answered("diagnose --quick", table, "--machine", file)
    (note,) = [n for n in answer["notes"] if "times the noise" in n]
    assert answer["findings"] == []
    assert note.endswith("Most of it is noise.")


def test_a_machine_with_a_sensor_of_speed_alone_is_fitted_and_diagnosed(tmp_path, said, answered):
    """Its position is the integral of the speed; friction that differs by direction is found."""
    file, table = speed_read_slide(tmp_path, asymmetry=0.06)
    printed = said("machine check", file, table).out
    assert "carriage_position_m is the integral of carriage_velocity_m_s" in printed
    assert "Read by no equation" not in printed
    assert answered("fit", table, "--machine", file, "--equation carriage")["parameters"]
    assert (
        "Declared: carriage." in said("fit", table, "--machine", file, "--equation x", code=2).err
    )
    (finding,) = answered("diagnose --quick", table, "--machine", file)["findings"]
    assert (finding["family"], finding["verdict"]) == ("friction.viscous_asymmetry", "identified")


def test_a_machine_file_is_written_from_options_and_nothing_prompts_without_a_terminal(
    tmp_path, monkeypatch, said
):
    table = slide_table(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    out = tmp_path / "new.toml"
    assert "--axis NAME:rad" in said("machine new", out, code=2).err
    refused = said("machine new", out, "--from slide.csv", code=2).err
    assert "rig import slide.csv --preview" in refused
    assert not out.exists()
    words = "--axis carriage:m --actuator carriage:drive_force_n"
    words += " --sensor carriage:carriage_position_m --from"
    alone = words.replace(" --from", " --sensor thrust_n --sensor air_temperature_k")
    said("machine new", tmp_path / "alone.toml", alone)
    assert read_machine(tmp_path / "alone.toml").sensors[1:] == (
        Sensor("thrust_n"),
        Sensor("air_temperature_k", reads="temperature"),
    )
    assert "AXIS:CHANNEL" in said("machine new", out, "--sensor arm_angle_rad", code=2).err
    step = f"rig import {table} --machine {out} --preview"
    assert step in said("machine new", out, words, table).out
    text = out.read_text()
    assert "# Columns of slide.csv, with the first sample:\n#   t: " in text
    mapped = {"time_s": "t", "drive_force_n": "volts:35 N", "carriage_position_m": "x:mm"}
    for name, column in mapped.items():
        text = text.replace(f'# {name} = "COLUMN:UNIT"', f'{name} = "{column}"')
    text = text.replace('# files = "', 'files = "')
    out.write_text(text)
    step = f"rig machine check {out} {table}"
    assert f"Next: {step}" in said("import", table, "--machine", out, "--preview").out
    said(step.removeprefix("rig "))
    said("machine new", out, words, table, code=2)


def test_a_new_file_suggests_the_ending_of_the_data(tmp_path, said):
    folder, out = tmp_path / "runs", tmp_path / "m.toml"
    folder.mkdir()
    for name in ("a", "b"):
        (folder / f"{name}.jsonl").write_text('{"t": 0.0, "q": 1.0}\n{"t": 0.1, "q": 2.0}\n')
    said("machine new", out, "--axis motor:rad --sensor motor:motor_angle_rad --from", folder)
    assert '# files = "*.jsonl"' in out.read_text()


def test_the_columns_of_the_data_are_shown_and_not_those_of_a_side_table(tmp_path, said):
    folder, out = tmp_path / "runs", tmp_path / "m.toml"
    folder.mkdir()
    (folder / "conditions.csv").write_text("file;load [kg]\nrun_1.csv;0\nrun_2.csv;8\n")
    for name in ("run_1", "run_2"):
        rows = "".join(f"{k / 100};{k % 7}\n" for k in range(200))
        (folder / f"{name}.csv").write_text(f"Zeit [s];Weg [mm]\n{rows}")
    said("machine new", out, "--axis a:m --sensor a:a_position_m --from", folder)
    assert "# Columns of run_1.csv, with the first sample:\n#   Zeit [s]: 0" in out.read_text()
    printed = said("import", folder, "--preview").out
    assert "Columns of run_1.csv" in printed
    assert "Weg [mm]" in printed


def hundred_hertz(folder):
    """Write a side file and two tables at 100 Hz, the second the longer one."""
    folder.mkdir()
    for number in (1, 2):
        times = np.arange(500 + 100 * number) / 100
        rows = "".join(f"{1e3 * t:.1f},{0.1 * number + 0.05 * np.sin(2 * t):.6f}\n" for t in times)
        (folder / f"run_{number}.csv").write_text(f"t (ms),x\n{rows}")
    (folder / "about.csv").write_text("file,load\nrun_1,0.1\nrun_2,0.2\n")


def test_a_side_file_that_the_pattern_of_the_data_matches_is_not_a_run(tmp_path, said):
    hundred_hertz(tmp_path / "runs")
    out = tmp_path / "m.toml"
    said("machine new", out, "--axis a:m --sensor a:a_position_m --from", tmp_path / "runs")
    text = out.read_text().replace("# files =", "files =")
    for name, column in {"time_s": "t (ms):ms", "a_position_m": "x:m"}.items():
        text = text.replace(f'# {name} = "COLUMN:UNIT"', f'{name} = "{column}"')
    out.write_text(text)
    assert 'files = "*.csv"' in text
    assert 'side_file = "about.csv"' in text
    printed = said("import", tmp_path / "runs", "--machine", out, "--preview").out
    assert "run_2" in printed
    assert "│ about" not in printed


def test_a_new_file_shows_the_first_file_and_has_a_cutoff_that_suits_its_rate(tmp_path, said):
    hundred_hertz(tmp_path / "runs")
    out = tmp_path / "m.toml"
    said("machine new", out, "--axis a:m --sensor a:a_position_m --from", tmp_path / "runs")
    text = out.read_text()
    assert "# Columns of run_1.csv, with the first sample:\n#   t (ms): 0.0\n#   x: 0.1\n" in text
    assert "cutoff_hz = 20.0" in text


def test_a_new_file_names_the_side_file_and_how_several_runs_in_a_file_are_cut(tmp_path, said):
    folder, out, words = (
        tmp_path / "runs",
        tmp_path / "m.toml",
        "--axis a:m --sensor a:a_position_m",
    )
    folder.mkdir()
    rows = "".join(f"{k / 100},{k % 7},{k // 100}\n" for k in range(300))
    for name in ("run_1", "run_2"):
        (folder / f"{name}.csv").write_text(f"t,x,lap\n{rows}")
    said("machine new", out, words, "--from", folder)
    text = out.read_text()
    assert '# side_file = "about.csv"  # columns: file, ' in text
    assert '# [data.runs]  # where a file holds several runs\n# changes = ["lap"]  # ' in text
    (folder / "loads.csv").write_text("file,load\nrun_1,0\nrun_2,8\n")
    said("machine new", tmp_path / "m2.toml", words, "--from", folder)
    text = (tmp_path / "m2.toml").read_text()
    assert '\nside_file = "loads.csv"\n' in text
    assert "# Single value load: 0" in text
    text = text.replace('# time_s = "COLUMN:UNIT"', 'time_s = "t"')
    text = text.replace('# a_position_m = "COLUMN:UNIT"', 'a_position_m = "x:mm"')
    (tmp_path / "m2.toml").write_text(text)
    assert "a_position_m" in said("import --preview --machine", tmp_path / "m2.toml", folder).out


@pytest.mark.parametrize("both", [True, False])
def test_a_transmission_bends_where_both_its_travels_are_read(tmp_path, said, both):
    words = "--axis motor:rad --axis slide:m --transmission motor:slide:200"
    words += " --actuator motor:motor_current_a --sensor motor:motor_angle_rad"
    words += " --sensor slide:slide_position_m" if both else " --sensor slide:rope_force_n"
    printed = said("machine new", tmp_path / "new.toml", words).out
    assert read_machine(tmp_path / "new.toml").transmissions[0].compliant == both
    assert ("motor_to_slide is written as compliant" in printed) == both


def test_a_sensor_of_no_axis_is_written_from_an_option(tmp_path, said):
    out = tmp_path / "new.toml"
    words = "--axis carriage:m --actuator carriage:drive_force_n"
    words += " --sensor carriage:carriage_position_m"
    assert "AXIS:CHANNEL" in said("machine new", out, words, "--sensor carriage_2_m", code=2).err
    said("machine new", out, words, "--sensor nut_temperature_k")
    assert "Read by causes of a diagnosis alone: nut_temp" in said("machine check", out).out


@pytest.fixture(scope="module")
def geared(tmp_path_factory):
    """Return a rig of ratio 20 drawn at random: its machine file and its recordings."""
    folder = tmp_path_factory.mktemp("geared")
    case = draw(5, "clean", gear_ratio=20.0)
    runs = folder / "runs"
    runs.mkdir()
    for recording in case.recordings:
        write_recording(runs / f"{recording.name}.mcap", recording)
    file = folder / "twenty.toml"
    file.write_text(to_toml(shipped_plant("reference")).replace("ratio = 35.0", "ratio = 20.0"))
    return file, runs


@pytest.mark.long
def test_another_gear_ratio_is_fitted_with_its_file_and_contradicted_without(geared, said):
    file, runs = geared
    own = said("machine check --json", file, runs)
    other = said("machine check reference --json", runs, code=1)
    assert "states the ratio 35 for gearbox" in other.err
    errors = []
    for printed in (own, other):
        equations = json.loads(printed.out)["check"]["equations"]
        errors += [e["relative_error"] for e in equations if e["name"] == "gearbox"]
    assert 5 * errors[0] < errors[1]


def test_a_ratio_of_the_other_sign_is_named_and_no_sensor_is_accused(tmp_path, said):
    """A spring at the link: with the ratio's sign wrong, the deflection is twice its travel."""
    time_s = np.arange(0, 8, 0.005)
    for number in range(3):
        link = 0.5 * np.sin((2 + number) * time_s) + 0.2 * np.sin(7 * time_s)
        torque = 10.0 * link
        columns = {"link_angle_rad": link, "joint_torque_n_m": torque}
        columns["motor_angle_rad"] = 100.0 * (link + 1e-4 * torque)
        columns["motor_current_a"] = torque / 9 + 0.1 * np.cos(time_s)
        run = Recording(f"run{number}", time_s, columns)
        write_recording(tmp_path / f"run{number}.mcap", run)
    file = tmp_path / "arm.toml"
    words = "--axis motor:rad --axis link:rad --transmission motor:link:-100"
    words += " --actuator motor:motor_current_a --sensor motor:motor_angle_rad"
    words += " --sensor link:link_angle_rad --sensor link:joint_torque_n_m"
    said("machine new", file, words)
    out = said("machine check", file, tmp_path, code=1).out
    assert "states the ratio -100 for motor_to_link" in out
    assert "opposite sign" not in out


def test_no_cause_is_sought_in_a_deflection_from_another_gear_ratio(geared, tmp_path, said):
    _, runs = geared
    words = ("diagnose --equation gearbox", runs, "--ledger", tmp_path / "used")
    printed = said(*words, "--json-out", tmp_path / "out.json", code=5).err
    assert "changes 20 times as much as spindle_angle_rad" in printed
    assert "at most" in said("fit --model gearbox --folds 500", runs, code=2).err
    printed = " ".join(said("fit --model gearbox --folds 2", runs).out.split())
    assert "but the machine states the ratio 35. The values above describe that" in printed
