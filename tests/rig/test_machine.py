"""`rig machine`, and recordings of a machine that a file describes."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.rigs import draw
from estimation.plant_file import parse, shipped_plant, to_toml
from estimation.plant_models import declared
from rig.cli.main import main
from rig.errors import ExitCode
from rig.log.convert import write_recording
from rig.machines.shipped import read_machine, shipped

SLIDE = """
schema = "rig.machine/1"

[machine]
name = "slide"
run_offsets = false

[[axis]]
name = "carriage"
unit = "m"

[[actuator]]
name = "drive_force_n"
axis = "carriage"

[[sensor]]
name = "carriage_position_m"
axis = "carriage"
reads = "position"

[data]
[data.columns]
time_s = "t"
carriage_position_m = "x:mm"
drive_force_n = "volts:35 N"

[data.runs]
lap_s = 3.0
"""


def slide_table(folder, runs=8):
    time_s = np.arange(0.0, 3.0 * runs, 2e-3)
    turns = 2 * np.pi * time_s
    position = 0.1 * np.sin(turns / 3.0) + 0.02 * np.sin(0.9 * turns)
    speed = np.gradient(position, time_s)
    force = 95.0 * np.gradient(speed, time_s) + 200.0 * speed + 20.0 * np.tanh(speed / 2e-3)
    force += np.random.default_rng(1).normal(0.0, 0.5, time_s.size)
    rows = np.column_stack([time_s, 1e3 * position, force / 35.0])
    table = folder / "slide.csv"
    np.savetxt(table, rows, delimiter=",", header="t,x,volts", comments="", fmt="%.9g")
    return table


@pytest.fixture
def slide(tmp_path):
    file = tmp_path / "slide.toml"
    file.write_text(SLIDE)
    return file, slide_table(tmp_path)


@pytest.mark.parametrize("name", sorted(shipped()))
def test_shipped_machines_can_be_declared_and_written_again(name):
    plant = read_machine(Path(name))
    assert declared(plant)
    assert parse(to_toml(plant)) == plant


def test_a_table_in_millimetres_and_volts_is_fitted_in_metres_and_newtons(slide, tmp_path, capsys):
    file, table = slide
    assert main(["machine", "check", str(file), str(table), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    (equation,) = found["check"]["equations"]
    values = {(p["effect"], p["name"]): p for p in equation["parameters"]}
    assert values["inertia.missing", "inertia"]["value"] == pytest.approx(95.0, rel=0.05)
    assert values["friction.viscous", "damping"]["unit"] == "N s/m"
    model = tmp_path / "slide.model.toml"
    assert main(["fit", str(table), "--machine", str(file), "--out", str(model)]) == 0
    capsys.readouterr()
    words = ["replay", str(table), "--machine", str(file), "--model", str(model)]
    assert main([*words, "--speed", "0", "--json"]) == 0
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert "drive_force_n" in json.dumps(frames)


LOADED = SLIDE.replace(
    "[data]\n",
    """[[sensor]]
name = "belt_force_n"
axis = "carriage"
reads = "effort"

[data]
""",
).replace('drive_force_n = "volts:35 N"', 'drive_force_n = "volts:35 N"\nbelt_force_n = "cell"')
"""The slide with a force cell."""


@pytest.mark.parametrize("constant_n", [0.0, 60.0])
def test_a_load_that_differs_between_runs_and_is_left_out_is_reported(tmp_path, capsys, constant_n):
    table = slide_table(tmp_path)
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    load = constant_n * (np.floor(rows[:, 0] / 3.0) % 3)
    drive = 35.0 * rows[:, 2] + load + 8.0 * np.sign(np.gradient(rows[:, 1]))
    rows = np.column_stack([rows[:, :2], drive / 35.0, 0.9 * (35.0 * rows[:, 2]) + load])
    np.savetxt(table, rows, delimiter=",", header="t,x,volts,cell", comments="", fmt="%.9g")
    file = tmp_path / "slide.toml"
    for stated, said in (("true", constant_n > 0), ("false", False)):
        file.write_text(LOADED.replace("run_offsets = false", f"run_offsets = {stated}"))
        assert main(["machine", "check", str(file), str(table)]) == 0
        assert ("The fit ignores it (run_offsets = true)" in capsys.readouterr().out) == said


def test_without_a_drive_and_without_a_reading_of_effort_both_are_named(tmp_path, capsys):
    file = tmp_path / "bare.toml"
    head, _, rest = SLIDE.partition("[[actuator]]")
    file.write_text(head + "[[sensor]]" + rest.partition("[[sensor]]")[2])
    assert main(["machine", "check", str(file)]) == 1
    assert "An [[actuator]], or a [[sensor]] that reads an effort" in capsys.readouterr().out


def test_a_column_that_was_not_recorded_is_named(slide, capsys):
    file, table = slide
    file.write_text(SLIDE.replace('drive_force_n = "volts:35 N"', 'motor_force_n = "volts:35 N"'))
    assert main(["machine", "check", str(file), str(table)]) == 1
    assert (
        "drive_force_n was not recorded. Did you mean 'motor_force_n'?" in capsys.readouterr().out
    )


def test_a_machine_without_any_equation_reports_what_is_needed(tmp_path, capsys):
    file = tmp_path / "bare.toml"
    file.write_text(SLIDE.split("[[sensor]]")[0])
    assert main(["machine", "check", str(file)]) == 1
    printed = capsys.readouterr().out
    assert "No equation can be written for slide." in printed
    assert "Needed: A sensor of position or speed on one of carriage." in printed
    assert main(["diagnose", str(tmp_path), "--machine", str(file)]) == ExitCode.USAGE
    printed = capsys.readouterr().err
    assert "No equation can be written for slide." in printed
    assert f"rig machine check {file}" in printed


def test_a_machine_with_a_sensor_of_speed_alone_is_fitted_and_diagnosed(tmp_path, capsys):
    """Its position is the integral of the speed; friction that differs by direction is found."""
    rows = np.loadtxt(slide_table(tmp_path), delimiter=",", skiprows=1)
    speed = np.gradient(rows[:, 1], rows[:, 0])
    force = 35.0 * rows[:, 2] + 0.06 * np.abs(speed)
    rows = np.column_stack([rows[:, 0], speed, force / 35.0])
    table = tmp_path / "slide.csv"
    np.savetxt(table, rows, delimiter=",", header="t,v,volts", comments="", fmt="%.9g")
    file = tmp_path / "slide.toml"
    words = {"position_m": "velocity_m_s", "x:mm": "v:mm/s", '"position"': '"speed"'}
    text = SLIDE
    for old, new in words.items():
        text = text.replace(old, new)
    file.write_text(text)
    assert main(["machine", "check", str(file), str(table)]) == 0
    printed = capsys.readouterr().out
    assert "carriage_position_m is the integral of carriage_velocity_m_s" in printed
    assert "Read by no equation" not in printed
    assert main(["fit", str(table), "--machine", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["parameters"]
    words = ["diagnose", str(table), "--machine", str(file), "--quick", "--json"]
    assert main(words) == 0
    (finding,) = json.loads(capsys.readouterr().out)["findings"]
    assert (finding["family"], finding["verdict"]) == ("friction.viscous_asymmetry", "identified")


def test_a_machine_file_is_written_from_options_and_nothing_prompts_without_a_terminal(
    tmp_path, monkeypatch, capsys
):
    table = slide_table(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    out = tmp_path / "new.toml"
    assert main(["machine", "new", str(out)]) == 2
    assert "--axis NAME:rad" in capsys.readouterr().err
    assert not out.exists()
    words = ["--axis", "carriage:m", "--actuator", "carriage:drive_force_n"]
    words += ["--sensor", "carriage:carriage_position_m", "--from", str(table)]
    assert main(["machine", "new", str(out), *words]) == 0
    assert "# Columns of slide.csv, with the first sample:\n#   t: " in out.read_text()
    text = out.read_text()
    for name, column in (
        ("time_s", "t"),
        ("drive_force_n", "volts:35 N"),
        ("carriage_position_m", "x:mm"),
    ):
        text = text.replace(f'# {name} = "COLUMN:UNIT"', f'{name} = "{column}"')
    out.write_text(text)
    assert main(["machine", "check", str(out), str(table)]) == 0
    assert main(["machine", "new", str(out), *words]) == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--axis", "carriage:mm"], "has the unit 'mm'"),
        (["--axis", "carriage"], "is not NAME:rad or NAME:m"),
        (["--axis", "a:rad", "--sensor", "b:a_angle_rad"], "There is no axis 'b'"),
        (["--axis", "a:rad", "--axis", "b:rad", "--transmission", "a:b:x"], "is not a number"),
    ],
)
def test_wrong_words_are_named(tmp_path, capsys, words, message):
    assert main(["machine", "new", str(tmp_path / "new.toml"), *words]) == 2
    assert message in capsys.readouterr().err


def test_an_unknown_machine_names_the_shipped_ones(capsys):
    assert main(["machine", "show", "emsp"]) == 2
    printed = capsys.readouterr().err
    assert "Did you mean 'emps'" in printed
    assert "reference" in printed


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


def test_another_gear_ratio_is_fitted_with_its_file_and_contradicted_without(geared, capsys):
    file, runs = geared
    assert main(["machine", "check", str(file), str(runs), "--json"]) == 0
    own = json.loads(capsys.readouterr().out)["check"]["equations"]
    assert main(["machine", "check", "reference", str(runs), "--json"]) == 1
    printed = capsys.readouterr()
    other = json.loads(printed.out)["check"]
    assert "states the ratio 35 for gearbox" in printed.err
    errors = [
        next(e["relative_error"] for e in equations if e["name"] == "gearbox")
        for equations in (own, other["equations"])
    ]
    assert 5 * errors[0] < errors[1]


def test_no_cause_is_sought_in_a_deflection_from_another_gear_ratio(geared, tmp_path, capsys):
    _, runs = geared
    words = ["diagnose", str(runs), "--equation", "gearbox", "--ledger", str(tmp_path / "used")]
    assert main([*words, "--json-out", str(tmp_path / "out.json")]) == 5
    assert "changes 20 times as much as spindle_angle_rad" in capsys.readouterr().err
    assert main(["fit", str(runs), "--model", "gearbox", "--folds", "2"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "but the machine states the ratio 35. The values above describe that" in printed
