"""Bad mappings and bad files: one sentence with the line of the file, and what to write instead."""

import gzip
import json
import re

import numpy as np
import pytest
from scipy.io import savemat

from rig.errors import DataError, RigError, UsageError
from rig.importers.questions import questions
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table, read_runs
from rig.importers.table.preview import preview
from rig.machines.recordings import with_motion

TABLE = "time,angle,current\n" + "".join(f"{k / 100},{k},{2 * k}\n" for k in range(20))
GOOD = """[machine]
name = "bench"
[data.columns]
time_s = "time"
motor_angle_rad = "angle:deg"
"""


def opened(folder, content=TABLE, mapping=GOOD, name="run.csv", flags=()):
    """Write a table and a mapping, and open the one by the other."""
    path, file = folder / name, folder / "bench.toml"
    if content is not None:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    file.write_text(mapping)
    return open_table(path, read_mapping(file, list(flags)))


def refused(folder, *given, **more):
    """Return the words of the error that a table and a mapping raise."""
    with pytest.raises(RigError) as error:
        opened(folder, *given, **more)
    return str(error.value)


ANGLE = "motor_angle_rad"
MAPPINGS = {
    "a column that is not there": (
        "angle:deg",
        "angel:deg",
        5,
        "'angel'",
        "mean 'angle'?",
        "= 'angle:deg'",
    ),
    "a unit of another travel": ("angle:deg", "angle:mm", 5, "'mm' is not a unit", "motor_angle_m"),
    "a unit of another speed": (
        *(f'{ANGLE} = "angle:deg"', 'motor_velocity_rad_s = "angle:mm/s"'),
        *(5, "or the name motor_velocity_m_s"),
    ),
    "a stiffness of a carriage": (
        *("\n$", '\n[data.conditions]\nspring_n_m = "current:N/mm"\n'),
        *(7, "spring_n_m, which is in N m", "or the name spring_n_per_m"),
    ),
    "a stiffness of a shaft": (
        *("\n$", '\n[data.conditions]\nspring_n_m = "current:N m/deg"\n'),
        *(7, "or the name spring_n_m_rad"),
    ),
    "counts": ("angle:deg", "angle:count", 5, "'count' is not a unit", "rev/4096"),
    "no dimension": ("angle:deg", "angle:1", 5, f"is not a unit of {ANGLE}"),
    "no unit that is known": ("angle:deg", "angle:grad", 5, "'grad' is not a unit", "N cm"),
    "no unit there is": (
        *('"angle:deg"', '{ column = "angle", unit = "furlong" }'),
        *(5, "'furlong'"),
    ),
    "a channel without a unit": (ANGLE, "motor_angle", 5, ANGLE),
    "a channel of another unit without one": (
        *(f'{ANGLE} = "angle:deg"', 'cap_pressure = "angle:bar"'),
        *(5, "for example cap_pressure_pa."),
    ),
    "a channel without a unit in any": (
        *(f'{ANGLE} = "angle:deg"', 'cap = "angle"'),
        *(5, "such as cap_rad of an angle or cap_a of a current"),
    ),
    "one channel twice": ("\n$", f'\n{ANGLE} = "current"\n', 6, "twice"),
    "an unknown key": ("\n$", "\n[data.runs]\ngaps = 1\n", 7, "'gap_s'"),
    "no time": ('time_s = "time"\n', "", None, "nothing states the time"),
    "time twice": ("\\[data.co", "[data]\nsample_rate_hz = 100\n[data.co", None, "twice"),
    "no table of data": ("(?s)\\[data.*", "", None, "has no table [data]"),
    "a formula of what is not there": (
        *("\n$", '\n[data.formulas]\nweight_n_m = "2 * sin(motor_angel_rad)"\n'),
        *(7, "motor_angel_rad"),
    ),
    "a formula of a derived channel": (
        *("\n$", '\n[data.formulas]\nweight_n = "motor_acceleration_rad_s2"\n'),
        *(7, "Formulas read columns and conditions only", "[[equation]] read motor_accel"),
        *("a formula scaled_motor_angle_rad", "read scaled_motor_acceleration_rad_s2"),
    ),
    "a formula that is code": (
        *("\n$", '\n[data.formulas]\nweight_n_m = "__import__(1)"\n'),
        *(7, "not part of a formula"),
    ),
    "a condition that changes": (
        *("\n$", '\n[data.conditions]\nload_a = "current"\n'),
        *(7, "not constant in run run"),
    ),
    "cuts of which no run is left": (
        *("\n$", "\n[data.runs]\nleast_s = 60\n"),
        *(None, "Change least_s (bench.toml, line 6)"),
    ),
    "a name of a file that does not match": (
        *("\\[data.co", "[data]\nfile_name = 'load_(\\\\d+)'\n[data.co"),
        *(4, "does not match"),
    ),
}
"""What is wrong in a mapping: old, new, the line that is named, and words of the sentence."""


@pytest.mark.parametrize("case", MAPPINGS.values(), ids=MAPPINGS)
def test_what_is_wrong_in_a_mapping_is_named_with_its_line(tmp_path, case):
    old, new, line, *words = case
    said = refused(tmp_path, mapping=re.sub(old, new, GOOD, count=1))
    assert all(word in said for word in words), said
    assert line is None or f"line {line}" in said


FORMULAS = {
    "a derived channel": '[data.formulas]\nweight_n = "motor_acceleration_rad_s2"\n',
    "too many arguments": '[data.formulas]\nweight_n = "sin(motor_angle_rad, 1, 2, 3)"\n',
    "a name without a unit": '[data.formulas]\nweight = "2 * motor_angle_rad"\n',
    "a circle": '[data.formulas]\nweight_n = "weight_n + 1"\n',
    "of samples": '[[data.invalid]]\nwhen = "motor_velocity_rad_s > 1"\nreason = "fast"\n',
}


@pytest.mark.parametrize("formula", FORMULAS.values(), ids=FORMULAS)
def test_a_wrong_formula_is_a_mistake_of_the_machine_file(tmp_path, formula):
    with pytest.raises(UsageError):
        opened(tmp_path, mapping=GOOD + formula)


def test_what_is_wrong_on_the_command_line_is_named_as_it_was_typed(tmp_path):
    def typed(column):
        return (("columns", ANGLE), column, f"--column {ANGLE}={column}")

    said = refused(tmp_path, flags=[typed("angel")])
    assert f"--column {ANGLE}=angel" in said
    assert "line" not in said.split(":")[0]
    assert f"{ANGLE} is stated twice" in refused(tmp_path, flags=[typed("angle"), typed("current")])


ROWS = TABLE.splitlines(keepends=True)
PICTURE = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256))
TABLES = {
    "time that goes back": ("".join([*ROWS[:6], "0.01,9,9\n", *ROWS[6:]]), "line 7", "resets"),
    "text among numbers": (TABLE.replace("0.05,5,10", "0.05,abc,10"), "line 7 holds 'abc'"),
    "an empty file": ("", "run.csv is empty"),
    "nothing but a head": (ROWS[0], "no samples"),
    "a picture": (PICTURE, "is not a text table"),
    "a head and units": (ROWS[0] + "s,deg,A\n", "line 2", "name a file with samples"),
    "a decimal comma in one line": ("time;angle\n1;2\n2;3\n3;4\n4;4,5\n", "decimal = ','"),
    "one sample": ("".join(ROWS[:2]), "No run", "two samples", "Name files with more samples"),
    "half a file": (TABLE[:-4], "line 21", "ends in the middle of this line"),
    "no file": (None, "There is no file"),
    "compressed and cut": (gzip.compress(TABLE.encode())[:-9], "cannot be decompressed"),
}
"""What is wrong in a table, and words of the sentence."""


@pytest.mark.parametrize("case", TABLES.values(), ids=TABLES)
def test_what_is_wrong_in_a_table_is_named(tmp_path, case):
    content, *words = case
    said = refused(tmp_path, content)
    assert all(word in said for word in words), said


@pytest.mark.parametrize("kind", ["mat", "npz", "parquet", "json", "jsonl"])
def test_half_a_file_of_any_format(tmp_path, kind):
    whole = tmp_path / f"whole.{kind}"
    columns = {"time": np.arange(400) / 100, "angle": np.random.default_rng(0).normal(size=400)}
    if kind == "mat":
        savemat(whole, columns)
    elif kind == "npz":
        np.savez(whole, **columns)
    elif kind == "parquet":
        import pyarrow as pa
        from pyarrow import parquet

        parquet.write_table(pa.table(columns), whole)
    else:
        rows = [{"time": k / 100, "angle": k} for k in range(50)]
        lines = "\n".join(json.dumps(row) for row in rows)
        whole.write_text(json.dumps(rows) if kind == "json" else lines)
    content = whole.read_bytes()
    said = refused(tmp_path, content[: len(content) // 2 + 3], name=f"run.{kind}")
    assert f"run.{kind}" in said
    assert "Either" not in said  # advice of a library, cut off
    assert any(word in said for word in ("cut off", "damaged", "ends in the middle", "whole"))


@pytest.mark.parametrize(("time", "word"), [("0", "time goes from"), ("", "time is empty")])
def test_a_run_whose_time_is_wrong_at_its_end_is_not_left_out_as_short(tmp_path, time, word):
    table = TABLE.replace("time", "trial,time").replace("\n", "\n1,").removesuffix("1,")
    table += f"1,{time},5,5\n" + "".join(f"2,{k / 100},{k},{k}\n" for k in range(20))
    said = refused(tmp_path, table, GOOD + '[data.runs]\nchanges = ["trial"]\n')
    assert word in said
    assert "line 22" in said


def test_a_machine_file_that_is_not_utf8_is_named_with_its_line(tmp_path):
    file = tmp_path / "bench.toml"
    file.write_bytes(GOOD.replace("bench", "Prüfstand").encode("latin-1"))
    with pytest.raises(UsageError, match=r"Line 2 holds .* not UTF-8.*Save the file as UTF-8"):
        read_mapping(file, [])


def test_an_archive_of_objects_is_not_unpickled(tmp_path):
    np.savez(tmp_path / "whole.npz", time=np.array([{"a": 1}], dtype=object))
    assert "run.npz" in refused(tmp_path, (tmp_path / "whole.npz").read_bytes(), name="run.npz")


def test_a_velocity_that_contradicts_its_angle(tmp_path):
    time = np.arange(0, 4, 0.01)
    angle, speed = np.sin(2 * time), 2 * np.cos(2 * time)
    rows = [f"{t},{a},{s}" for t, a, s in zip(time, angle, speed, strict=True)]
    mapping = GOOD.replace("angle:deg", "angle") + 'motor_velocity_rad_s = "speed:deg/s"\n'
    said = refused(tmp_path, "time,angle,speed\n" + "\n".join(rows) + "\n", mapping=mapping)
    assert "motor_angle_rad changes" in said
    assert "motor_velocity_rad_s" in said


@pytest.mark.parametrize("column", ["q [deg]", "angle (DEG)", "angle_deg", "angle/deg"])
def test_a_unit_in_the_name_of_a_column_is_not_passed_over(tmp_path, column):
    table, mapping = TABLE.replace("angle", column), GOOD.replace("angle:deg", column)
    said = refused(tmp_path, table, mapping)
    assert f"the name of the column {column!r} states" in said
    assert f"Write motor_angle_rad = '{column}:deg'" in said
    (run,) = opened(tmp_path, table, mapping.replace(column, f"{column}:rad"))
    assert run["motor_angle_rad"][-1] == 19.0


def test_a_unit_of_another_quantity_in_the_name_of_a_column(tmp_path):
    said = refused(
        tmp_path, TABLE.replace("angle", "angle_rpm"), GOOD.replace("angle:deg", "angle_rpm")
    )
    assert "the name of the column 'angle_rpm' states rpm" in said
    assert "if they are in SI units, write motor_angle_rad = 'angle_rpm:rad'" in said


@pytest.mark.parametrize(
    ("column", "source", "asked"),
    [
        ("Kraft [kN]", '"Kraft [kN]:V"', "states kN, and the mapping V; which one is right?"),
        ("Kraft (kN)", '"Kraft (kN)"', "states kN, and the mapping V;"),
        ("u_mV", '"u_mV:V"', "states mV, and the mapping V;"),
        ("u [N]", '"u [N]:kV"', "states N, and the mapping kV;"),
        (
            "u_mV",
            '{ column = "u_mV", unit = "V", gain = 2.0 }',
            "states mV, and the mapping V times",
        ),
        ("u_mV", '{ column = "u_mV", unit = "V", gain = 0.001 }', ""),
        ("u_mV", '"u_mV:mV"', ""),
        ("Kraft [kN]", '{ column = "Kraft [kN]", unit = "V", gain = 5.0 }', ""),  # an amplifier
        ("u [counts]", '"u [counts]:0.4/255 V"', ""),
        ("channel (A)", '"channel (A):V"', ""),
        ("channel (1)", '"channel (1):V"', ""),
        ("drive_mm", '"drive_mm:V"', ""),
    ],
)
def test_a_unit_in_the_name_of_a_column_that_contradicts_the_mapping(
    tmp_path, column, source, asked
):
    table = TABLE.replace("current", column)
    found = asked_of(tmp_path, table, f"{GOOD}drive_command_v = {source}\n")
    found = [text for text in found if "which one" in text]
    assert len(found) == bool(asked)
    assert all(text.startswith("drive_command_v: ") and asked in text for text in found)


def test_one_column_of_two_channels_is_asked_about(tmp_path):
    (said,) = asked_of(tmp_path, TABLE, GOOD + 'arm_angle_rad = "angle:deg"\n')
    assert said == "motor_angle_rad and arm_angle_rad are one column, 'angle'; is this meant?"
    torque = 'motor_torque_n_m = { column = "angle", gain = 0.05 }\n'
    assert asked_of(tmp_path, TABLE, GOOD + torque) == []


GERMAN = "Zeit;Weg;Kraft\n[ISO];[mm];[kgf]\n" + "".join(
    f"2026-03-12T09:43:{k // 10:02d}.{k % 10}00;{np.sin(k / 3):.3f};{np.cos(k / 4):.3f}\n".replace(
        ".", ","
    )
    for k in range(100)
)
MAPPED = """[data.columns]
time_s = "Zeit:iso8601"
slide_position_m = "Weg:mm"
load_force_n = "Kraft:kgf"
"""
"""A table with a row of units, and the mapping that agrees with it."""


@pytest.mark.parametrize(
    ("row", "stated"),
    [
        ("kgf", "kgf"),
        ("(kgf)", "kgf"),
        ("[KGF]", "kgf"),
        ("counts", "counts"),  # another quantity
    ],
)
def test_a_row_of_units_below_the_head_is_not_passed_over(tmp_path, row, stated):
    table = GERMAN.replace("[kgf]", row)
    said = refused(tmp_path, table, MAPPED.replace("Kraft:kgf", "Kraft"))
    assert f"line 2 of run.csv states {stated} for the column 'Kraft'" in said
    assert "bench.toml, line 4" in said
    assert "load_force_n = 'Kraft:kgf'" in said or "load_force_n = 'Kraft:N'" in said


def asked_of(folder, table, mapping):
    """Return the questions about the runs of a table, of a preview and of any other command."""
    path, file = folder / "run.csv", folder / "bench.toml"
    path.write_text(table, encoding="utf-8")
    file.write_text(mapping)
    shown = preview(list(read_runs(path, read_mapping(file, []), [])), []).questions
    assert shown == questions(list(open_table(path, read_mapping(file, []))))
    return shown


def test_a_row_of_units_that_contradicts_the_mapping_is_asked_about(tmp_path):
    (said,) = asked_of(tmp_path, GERMAN, MAPPED.replace("kgf", "N"))
    assert "line 2 of the file states kgf for the column 'Kraft', and the mapping N" in said
    assert said.startswith("load_force_n: ")
    (said,) = asked_of(tmp_path, GERMAN.replace("[kgf]", "[Lbs]"), MAPPED.replace(":kgf", ""))
    assert "states Lbs for the column 'Kraft', which is not a unit" in said
    assert said.endswith("is it in N?")


AGREES = {
    "as mapped": ("kgf", '"Kraft:kgf"'),
    "in SI units": ("N", '"Kraft"'),
    "nothing": ("-", '"Kraft"'),
    "a gain of that size": ("kgf", '{ column = "Kraft", gain = -9.80665 }'),
    "a lever": ("kgf", '{ column = "Kraft", unit = "kgf", gain = 2.0 }'),
    "an amplifier": ("mV", '{ column = "Kraft", unit = "N", gain = 1.7 }'),
    "counts of a known size": ("counts", '"Kraft:0.4/255 N"'),
}


@pytest.mark.parametrize("case", AGREES.values(), ids=AGREES)
def test_a_row_of_units_that_agrees_with_the_mapping(tmp_path, case):
    row, source = case
    mapping = MAPPED.replace('"Kraft:kgf"', source)
    assert asked_of(tmp_path, GERMAN.replace("[kgf]", f"[{row}]"), mapping) == []


def test_a_decimal_comma_in_the_name_of_a_file(tmp_path):
    mapping = "[data]\nfile_name = 'lauf_(?P<f>.+)Hz'\n" + MAPPED
    mapping += '[data.conditions]\nfrequency_hz = "f"\n'
    for name in ("lauf_0,1Hz.csv", "lauf_0.1Hz.csv"):
        (run,) = opened(tmp_path, GERMAN, mapping, name)
        assert run.conditions["frequency_hz"] == 0.1
    for german, name in (("Zeit:iso8601", "time"), ("Weg", "angle"), ("Kraft", "current")):
        mapping = mapping.replace(german, name)
    said = refused(tmp_path, TABLE, mapping, "lauf_0,1Hz.csv")
    assert "'0,1'. frequency_hz ends in a unit" in said
    assert "Write it with a point, 0.1, or state decimal" in said


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("about.csv", "files = 'run_*.csv' under [data]; if it states values of each file, side_f"),
        ("run_b.csv", "If run_b.csv is not a recording, write files = 'PATTERN' under [data]"),
    ],
)
def test_a_file_of_a_folder_that_is_not_a_recording_is_left_out_by_the_line_named(
    tmp_path, name, words
):
    for number in (1, 2):
        (tmp_path / f"run_0{number}.csv").write_text(TABLE)
    (tmp_path / name).write_text("file,load_kg\nrun_01.csv,3\nrun_02.csv,4\n")
    (tmp_path / "bench.toml").write_text(GOOD)
    with pytest.raises(DataError) as error:
        open_table(tmp_path, read_mapping(tmp_path / "bench.toml", []))
    assert words in error.value.fix


def test_a_column_that_one_file_of_several_calls_otherwise_is_to_be_renamed_there(tmp_path):
    """To name it in the mapping would break the files before it."""
    for name, column in (("a", "angle"), ("b", "angel")):
        (tmp_path / f"{name}.csv").write_text(TABLE.replace("angle", column))
    (tmp_path / "bench.toml").write_text(GOOD + '[data]\nfiles = "*.csv"\n')
    with pytest.raises(DataError) as error:
        open_table(tmp_path, read_mapping(tmp_path / "bench.toml", []))
    assert error.value.fix == "The files before it have it: give the column that name in b.csv."


def test_files_and_runs_that_cannot_be_read_are_left_out_where_asked(tmp_path):
    runs, file = tmp_path / "runs", tmp_path / "bench.toml"
    runs.mkdir()
    file.write_text(GOOD)
    (runs / "a.csv").write_text(TABLE)
    (runs / "b.csv").write_text(TABLE[:-4])
    (runs / "c.csv").write_text("")
    (runs / "d.csv").write_text(TABLE.replace("angle", "other"))
    mapping = read_mapping(file, [])
    campaign = open_table(runs, mapping, skip_bad=True)
    assert [run.name for run in campaign.evidence.runs] == ["a"]
    said = {run.name: run.excluded for run in campaign.runs if run.excluded}
    assert list(said) == ["b.csv", "c.csv", "d.csv"]
    assert "ends in the middle" in said["b.csv"]
    assert "is empty" in said["c.csv"]
    assert "no column 'angle'" in said["d.csv"]
    assert with_motion(campaign, []).names == campaign.names  # as a diagnosis does
    (runs / "a.csv").unlink()
    with pytest.raises(DataError, match=r"b\.csv, line 21"):
        open_table(runs, mapping, skip_bad=True)


def with_force(cell):
    """Return the German table with this cell as the force of its line 50."""
    lines = GERMAN.splitlines()
    lines[49] = ";".join([*lines[49].split(";")[:2], cell])
    return "\n".join(lines) + "\n"


LAST = GERMAN.splitlines()[-1]
IN_A_CELL = {
    "a sign between thousands": ("1.234,50", "'1.234,50'", "sign between thousands"),
    "a text for no value": ("OVERLOAD", "'OVERLOAD'", "missing = ['OVERLOAD'] under [data]"),
}


@pytest.mark.parametrize("case", IN_A_CELL.values(), ids=IN_A_CELL)
def test_a_cell_that_is_not_a_number_is_quoted_with_its_remedy(tmp_path, case):
    cell, *words = case
    said = refused(tmp_path, with_force(cell), MAPPED)
    assert "line 50 holds" in said
    assert all(word in said for word in words), said


THOUSANDS = "Tid;Vinkel;Kraft\n0,000;0,000;1.500\n0,005;2,000;999\n0,010;4,000;1.001\n"
IN_NEWTON = """[data.columns]
time_s = "Tid"
motor_angle_rad = "Vinkel:deg"
load_force_n = "Kraft"
"""


@pytest.mark.parametrize("stated", [[(("decimal",), ",", "")], []])
@pytest.mark.parametrize(
    "mapping", [IN_NEWTON, IN_NEWTON.replace("load_f", "[data.conditions]\nload_f")]
)
def test_a_point_of_thousands_is_not_a_decimal_one(tmp_path, mapping, stated):
    said = refused(tmp_path, THOUSANDS, mapping, flags=stated)
    assert "'Kraft' of run.csv is not numbers: line 2 holds '1.500'" in said
    assert "without the sign between thousands, such as 1500; if the point is a decimal" in said
    assert "with a comma, 1,500." in said


@pytest.mark.parametrize("cell", ["0.500", "1.5"])
def test_a_column_of_decimal_points_next_to_one_of_decimal_commas(tmp_path, cell):
    flags = [(("decimal",), ",", "")]
    (run,) = opened(tmp_path, THOUSANDS.replace("999", cell), IN_NEWTON, flags=flags)
    assert run["load_force_n"].tolist() == [1.5, float(cell), 1.001]


def test_a_text_that_means_no_value_is_flagged_as_an_empty_cell(tmp_path):
    flags = [(("missing",), ["OVERLOAD"], "")]
    (run,) = opened(tmp_path, with_force("OVERLOAD"), MAPPED, flags=flags)
    assert np.flatnonzero(~run.valid).tolist() == [47]


FOOTERS = {
    "where a date is": "Ende der Messung;;\nMax;20;100\n",
    "where a number is": LAST + "\n" + LAST.replace(LAST.split(";")[1], "Weg") + "\n",
    "of another width": "Ende der Messung\n\nMax;100\n",
}


@pytest.mark.parametrize("footer", FOOTERS.values(), ids=FOOTERS)
def test_lines_after_the_samples_are_left_out_where_the_error_states_how(tmp_path, footer):
    said = refused(tmp_path, GERMAN + footer, MAPPED)
    assert "line 103" in said or "line 104" in said
    found = re.search(r"skip_last_lines = (\d+) under \[data\]", said)
    assert found, said
    flags = [(("skip_last_lines",), int(found[1]), "")]
    (run,) = opened(tmp_path, GERMAN + footer, MAPPED, flags=flags)
    assert len(run) == 100
    assert run.valid.all()


def test_rows_of_trials_that_alternate_are_an_error_and_in_a_preview_a_question(tmp_path, said):
    """Trials 1 and 2 alternate in what would be cut into two hundred parts; trial 3 is whole."""
    path = tmp_path / "both.csv"
    trials = [1 + k % 2 for k in range(200)] + [3] * 200
    rows = (f"{k // 2 if k < 200 else k},{k % 7},{trial}\n" for k, trial in enumerate(trials))
    path.write_text("t,enc,trial\n" + "".join(rows))
    file = tmp_path / "m.toml"
    file.write_text(
        '[data.columns]\ntime_s = "t:ms"\nmotor_angle_rad = "enc:deg"\n'
        '[data.runs]\nchanges = ["trial"]\n'
    )
    err = " ".join(said("import", path, "--machine", file, "--preview").err.split())
    assert "Check: both.csv is cut into 201 parts, 200 of them of fewer than 10 samples" in err
    assert "sort the file by 'trial', then by time" in err
    with pytest.raises(DataError, match="201 parts") as error:
        open_table(path, read_mapping(file, []))
    assert "a new value of 'trial'" in error.value.why
    with_least = read_mapping(file, [(("runs", "least_s"), 0.001, "")])
    assert any("201 parts" in doubt for run in open_table(path, with_least) for doubt in run.doubts)


T_AND_Q = [(("columns", "time_s"), "t", ""), (("columns", ANGLE), "q:deg", "")]
"""The options that map a time t and an angle q."""


def test_a_column_of_which_there_are_two_is_asked_about(tmp_path):
    path = tmp_path / "two.csv"
    path.write_text("t,q,q\n" + "".join(f"{0.1 * k},{k % 7},{k % 5}\n" for k in range(100)))
    (run,) = open_table(path, read_mapping(None, T_AND_Q))
    (doubt,) = run.doubts
    assert doubt.startswith("motor_angle_rad: 2 columns are called 'q', and the first one is read;")
    second = (("columns", ANGLE), "q.2:deg", "")
    (run,) = open_table(path, read_mapping(None, [T_AND_Q[0], second]))
    assert run.doubts == ()


@pytest.mark.parametrize("above", ["", "bench 7\n"])
def test_names_of_columns_among_the_samples_are_an_error_with_their_line(tmp_path, above):
    """Below other lines the names are sought from the last sample on: half of them was lost."""
    path = tmp_path / "again.csv"
    rows = [f"{0.1 * k},{k % 7}\n" for k in range(100)]
    path.write_text("".join([above, "t,q\n", *rows[:50], "t,q\n", *rows[50:]]))
    with pytest.raises(DataError, match=f"line {53 if above else 52}") as error:
        open_table(path, read_mapping(None, T_AND_Q))
    assert "elete" in error.value.fix


def test_a_line_of_the_side_file_without_its_recording_is_asked_about(tmp_path):
    for name in ("a", "b"):
        table = "t,q\n" + "".join(f"{0.1 * k},{k % 7 + ord(name)}\n" for k in range(100))
        (tmp_path / f"{name}.csv").write_text(table)
    (tmp_path / "runs.csv").write_text("file,load\na.csv,1\nb,2\nc.csv,3\n")
    mapping = read_mapping(None, [*T_AND_Q, (("side_file",), "runs.csv", "")])
    asked = questions(list(open_table(tmp_path, mapping)))
    assert "runs.csv has a line for c.csv, and there is no such file; is a recording lost?" in (
        " ".join(asked)
    )
    (tmp_path / "c.csv").write_text(table)
    assert not any("no such file" in one for one in questions(list(open_table(tmp_path, mapping))))
    assert open_table(tmp_path / "a.csv", mapping).runs[0].recording().doubts == ()
