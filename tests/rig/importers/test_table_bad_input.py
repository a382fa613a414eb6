"""Bad mappings and bad files: one sentence with the line of the file, and what to write instead."""

import json

import numpy as np
import pytest
from scipy.io import savemat

from rig.errors import RigError
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table

TABLE = "time,angle,current\n" + "".join(f"{k / 100},{k},{2 * k}\n" for k in range(20))
GOOD = """[machine]
name = "bench"
[data.columns]
time_s = "time"
motor_angle_rad = "angle:deg"
"""


@pytest.fixture
def refused(tmp_path):
    """Return the words of the error that a table and a mapping raise."""

    def _refused(content=TABLE, mapping=GOOD, name="run.csv", flags=()):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        file = tmp_path / "bench.toml"
        file.write_text(mapping)
        with pytest.raises(RigError) as error:
            open_table(path, read_mapping(file, list(flags)))
        return str(error.value)

    return _refused


def test_a_column_that_is_not_there_names_line_and_nearest(refused):
    said = refused(mapping=GOOD.replace('"angle:deg"', '"angel:deg"'))
    assert "bench.toml, line 5" in said
    assert "'angel'" in said
    assert "Did you mean 'angle'?" in said


def test_a_column_of_the_command_line_that_is_not_there(refused):
    flag = (("columns", "motor_angle_rad"), "angel", "--column motor_angle_rad=angel")
    said = refused(flags=[flag])
    assert "--column motor_angle_rad=angel" in said
    assert "line" not in said.split(":")[0]


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("mm", ["'mm' is not a unit of motor_angle_rad", "motor_angle_m"]),
        ("count", ["'count' is not a unit of motor_angle_rad", "rev/4096"]),
        ("1", ["is not a unit of motor_angle_rad"]),
    ],
)
def test_a_unit_of_another_dimension(refused, unit, words):
    said = refused(mapping=GOOD.replace("angle:deg", f"angle:{unit}"))
    assert "bench.toml, line 5" in said
    assert all(word in said for word in words), said


def test_a_unit_that_does_not_exist(refused):
    entry = 'motor_angle_rad = { column = "angle", unit = "furlong" }'
    said = refused(mapping=GOOD.replace('motor_angle_rad = "angle:deg"', entry))
    assert "bench.toml, line 5" in said
    assert "'furlong'" in said


def test_a_channel_without_a_unit_in_its_name(refused):
    said = refused(mapping=GOOD.replace("motor_angle_rad", "motor_angle"))
    assert "bench.toml, line 5" in said
    assert "motor_angle_rad" in said


def test_two_columns_for_one_channel(refused):
    said = refused(mapping=GOOD + 'motor_angle_rad = "current"\n')
    assert "line 6" in said
    assert "twice" in said
    flag = (("columns", "motor_angle_rad"), "angle", "--column motor_angle_rad=angle")
    other = (("columns", "motor_angle_rad"), "current", "--column motor_angle_rad=current")
    said = refused(flags=[flag, other])
    assert "motor_angle_rad is stated twice" in said


def test_an_unknown_key_names_line_and_nearest(refused):
    said = refused(mapping=GOOD + "[data.runs]\ngaps = 1\n")
    assert "line 7" in said
    assert "'gap_s'" in said


def test_no_time_and_time_twice(refused):
    assert "nothing states the time" in refused(mapping=GOOD.replace('time_s = "time"\n', ""))
    twice = GOOD.replace("[data.columns]", "[data]\nsample_rate_hz = 100\n[data.columns]")
    assert "twice" in refused(mapping=twice)


def test_no_data_table(refused):
    assert "has no table [data]" in refused(mapping='[machine]\nname = "bench"\n')


def test_a_formula_that_reads_what_is_not_there_or_is_none(refused):
    said = refused(mapping=GOOD + '[data.formulas]\nweight_n_m = "2 * sin(motor_angel_rad)"\n')
    assert "line 7" in said
    assert "motor_angel_rad" in said
    said = refused(mapping=GOOD + '[data.formulas]\nweight_n_m = "__import__(1)"\n')
    assert "not part of a formula" in said
    assert "line 7" in said


def test_time_that_goes_back_names_the_line_of_the_table(refused):
    rows = TABLE.splitlines()
    said = refused("\n".join([*rows[:6], "0.01,9,9", *rows[6:]]) + "\n")
    assert "run.csv, line 7" in said
    assert "resets" in said


def test_a_condition_that_changes_within_a_run(refused):
    said = refused(mapping=GOOD + '[data.conditions]\nload_a = "current"\n')
    assert "bench.toml, line 7" in said
    assert "not constant in run run" in said


def test_text_in_a_column_of_numbers_names_the_line(refused):
    said = refused(TABLE.replace("0.05,5,10", "0.05,abc,10"))
    assert "line 7 holds 'abc'" in said


def test_an_empty_file_and_one_of_nothing_but_a_head(refused):
    assert "run.csv is empty" in refused("")
    assert "no samples" in refused("time,angle,current\n")


def test_a_picture(refused):
    picture = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256))
    assert "is not a text table" in refused(picture, name="run.png")
    assert "is not a text table" in refused(picture, name="run.csv")


def test_half_a_text_file_names_its_last_line(refused):
    said = refused(TABLE[:-4])
    assert "line 21" in said
    assert "ends in the middle of this line" in said


@pytest.mark.parametrize("kind", ["mat", "npz", "parquet", "json", "jsonl"])
def test_half_a_file_of_any_format(refused, tmp_path, kind):
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
    said = refused(content[: len(content) // 2 + 3], name=f"run.{kind}")
    assert f"run.{kind}" in said
    assert any(word in said for word in ("cut off", "damaged", "ends in the middle", "whole"))


def test_an_archive_of_objects_is_not_unpickled(refused, tmp_path):
    np.savez(tmp_path / "whole.npz", time=np.array([{"a": 1}], dtype=object))
    assert "run.npz" in refused((tmp_path / "whole.npz").read_bytes(), name="run.npz")


def test_a_name_of_a_file_that_does_not_match(refused):
    mapping = GOOD.replace("[data.columns]", "[data]\nfile_name = 'load_(\\d+)'\n[data.columns]")
    said = refused(mapping=mapping)
    assert "bench.toml, line 4" in said
    assert "does not match" in said


def test_a_velocity_that_contradicts_its_angle(refused):
    time = np.arange(0, 4, 0.01)
    angle, speed = np.sin(2 * time), 2 * np.cos(2 * time)
    rows = [f"{t},{a},{s}" for t, a, s in zip(time, angle, speed, strict=True)]
    mapping = GOOD.replace("angle:deg", "angle") + 'motor_velocity_rad_s = "speed:deg/s"\n'
    said = refused("time,angle,speed\n" + "\n".join(rows) + "\n", mapping=mapping)
    assert "motor_angle_rad changes" in said
    assert "motor_velocity_rad_s" in said


def test_a_file_that_is_not_there(refused):
    assert "There is no file" in refused(None, name="other.csv")
