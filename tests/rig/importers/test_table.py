"""Tables of any layout: what is mapped arrives in SI units, cut into runs, with its conditions."""

import gzip
import json

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from estimation.filters import LowPass, filter_recording
from rig.errors import DataError, UsageError
from rig.importers.registry import open_campaign
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table, read_runs
from rig.log.convert import write_recording
from tests.rig.importers.conftest import text_table

N = 100
TIME_MS = np.arange(N) * 10.0
ANGLE_DEG = 90.0 * np.sin(2 * np.pi * TIME_MS / 1000)
CURRENT_MA = 500.0 * np.cos(2 * np.pi * TIME_MS / 1000)
COLUMNS = {"t": TIME_MS, "enc": ANGLE_DEG, "i": CURRENT_MA}
MAPPED = """
[data.columns]
time_s = "t:ms"
motor_angle_rad = "enc:deg"
motor_current_a = "i:mA"
"""


def machine(folder, text=MAPPED):
    """Write a machine file and return its mapping."""
    path = folder / "bench.toml"
    path.write_text(text)
    return read_mapping(path, [])


def opened(folder, content, text=MAPPED):
    """Return the runs of a text table, of its text or of its columns, by a mapping."""
    path = folder / "run.csv"
    if isinstance(content, str):
        path.write_text(content)
    else:
        text_table(path, content)
    return open_table(path, machine(folder, text))


def write(folder, kind):
    """Write the same samples in a format, and return the file."""
    path = folder / f"run.{kind}"
    plain = {name: values.tolist() for name, values in COLUMNS.items()}
    if kind in ("csv", "tsv"):
        text_table(path, plain, "\t" if kind == "tsv" else ",")
    elif kind == "parquet":
        parquet.write_table(pa.table(plain), path)
    elif kind == "mat":
        savemat(path, COLUMNS)
    elif kind == "npz":
        np.savez(path, **COLUMNS)
    elif kind == "jsonl":
        rows = [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    elif kind == "json":
        rows = [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]
        path.write_text(json.dumps({"load_g": 250, "samples": rows}))
    return path


@pytest.mark.parametrize("kind", ["csv", "tsv", "parquet", "mat", "npz", "jsonl", "json"])
def test_every_format_gives_the_same_samples_in_si_units(tmp_path, kind):
    (run,) = open_table(write(tmp_path, kind), machine(tmp_path))
    np.testing.assert_allclose(run.time_s, TIME_MS / 1000)
    np.testing.assert_allclose(run["motor_angle_rad"], np.radians(ANGLE_DEG))
    np.testing.assert_allclose(run["motor_current_a"], CURRENT_MA / 1000)
    assert run.name == "run"
    assert run.rig == "bench"
    assert run.valid.all()


def test_a_table_without_a_head_or_a_clock_is_mapped_by_number_and_rate(tmp_path):
    path = tmp_path / "run.csv"
    np.savetxt(path, np.column_stack([ANGLE_DEG, CURRENT_MA]), delimiter=";")
    text = '[data]\nsample_rate_hz = 200\n[data.columns]\nmotor_angle_rad = "1:deg"\n'
    (run,) = open_table(path, machine(tmp_path, text))
    np.testing.assert_allclose(run["motor_angle_rad"], np.radians(ANGLE_DEG))
    assert run.sample_rate_hz == pytest.approx(200)


SECONDS = '[data.columns]\ntime_s = "t"\n'
ANGLE = f'{SECONDS}motor_angle_rad = "enc"\n'
IN_DEG = f'{SECONDS}motor_angle_rad = "enc:deg"\n'
EVEN = f"[data]\neven_rate_hz = 100\n{MAPPED}"
TEXT = "t,enc,i\n0,0,100\n10,45,200\n20,90,300\n"
IN_SI = {"time_s": [0.0, 0.01, 0.02], "motor_current_a": [0.1, 0.2, 0.3]}

READ = {
    "counts": (
        "t,enc\n0,0\n0.1,1024\n0.2,4096\n",
        f'{SECONDS}motor_angle_rad = "enc:rev/4096"',
        {"motor_angle_rad": [0, np.pi / 2, 2 * np.pi]},
    ),
    "a raw converter": (
        "t,adc\n0,512\n0.1,612\n0.2,412\n",
        SECONDS + 'motor_current_a = { column = "adc", unit = "mA", gain = 4.88, zero = 512 }',
        {"motor_current_a": [0, 0.488, -0.488]},
    ),
    "a counter that starts again": (
        "t,enc\n0,3072\n0.1,4095\n0.2,1024\n",
        SECONDS + 'motor_angle_rad = { column = "enc", unit = "rev/4096", wraps_at = 4096 }',
        {"motor_angle_rad": np.array([3072, 4095, 5120]) / 2048 * np.pi},
    ),
    "sign and magnitude": (
        "t,load\n0,30\n0.1,1054\n0.2,0\n0.3,1024\n",
        SECONDS + 'drive_ratio = { column = "load", gain = 0.001, sign_bit = 1024 }',
        {"drive_ratio": [0.03, -0.03, 0.0, 0.0]},
    ),
    "a decimal comma, lines before the head and names that are channels": (
        "Recorder 7\n# zeroed\ntime_s;motor_angle_rad;Remark\n0,0;1,5;0\n0,1;2,5;0\n",
        '[data]\ndecimal = ","\nskip_lines = 1\ncomment = "#"\n',
        {"motor_angle_rad": [1.5, 2.5]},
    ),
    "a line of units and a decimal comma": (
        "t;enc\n[ms];[rad]\n0,00;1,5\n100,00;2,5\n",
        ANGLE.replace('"t"', '"t:ms"'),
        {"time_s": [0.0, 0.1], "motor_angle_rad": [1.5, 2.5]},
    ),
    "the force of a cylinder from its pressures": (
        "t,pa,pb\n0,10,1\n0.1,20,2\n",
        SECONDS
        + """
        cap_pressure_pa = "pa:bar"
        rod_pressure_pa = "pb:bar"
        [data.formulas]
        rod_force_n = "12e-4 * cap_pressure_pa - 9e-4 * rod_pressure_pa"
        """,
        {"rod_force_n": [1110.0, 2220.0]},
    ),
    "a time of the day that passes midnight": (
        "t,enc\n23:59:59.500,0\n23:59:59.750,1\n00:00:00.000,2\n",
        ANGLE.replace('"t"', '"t:iso8601"'),
        {"time_s": [0.0, 0.25, 0.5]},
    ),
    "milliseconds of the day that pass midnight": (
        "t,enc\n86399500,0\n86399750,1\n0,2\n",
        ANGLE.replace('"t"', '"t:ms"'),
        {"time_s": [0.0, 0.25, 0.5]},
        "the time falls by a day in line 4, at midnight, and is continued there",
    ),
    "a sample that is there twice": (
        "t,enc\n0,1\n0.1,2\n0.1,2\n0.2,3\n",
        ANGLE,
        {"motor_angle_rad": [1, 2, 3]},
        "1 sample there twice left out",
    ),
    "repeated times where the clock is made even": (
        "t,enc,i\n0,0,0\n10,1,1\n10,9,9\n30,3,3\n40,4,4\n",
        EVEN,
        {"motor_current_a": [0.0, 0.001, 0.002, 0.003, 0.004]},
        "1 sample with the time of the one before it left out",
    ),
    "rows of one time each with another channel": (
        "t,enc,i\n0,1,\n0,,5\n10,2,\n10,,6\n20,3,\n20,,7\n",
        EVEN,
        {"motor_angle_rad": np.radians([1, 2, 3]), "motor_current_a": [0.005, 0.006, 0.007]},
    ),
    "lines above samples without a head": (
        "Scope\nName,angle,current\nUnit,V,V,,\nRate [ms],10\n0,0,100\n10,,200\n20,90,300\n",
        '[data.columns]\ntime_s = "1:ms"\nmotor_current_a = "3:mA"\n',
        IN_SI,
        "4 lines above line 5",
    ),
    "a head whose first name begins with a mark": (
        TEXT.replace("t,", "%time,"),
        MAPPED.replace('"t:ms"', '"%time:ms"'),
        IN_SI,
    ),
    "utf-16": (TEXT.encode("utf-16"), MAPPED, IN_SI),
    "a spreadsheet's sign": ("sep=;\n" + TEXT.replace(",", ";"), MAPPED, IN_SI),
    "notes": ("# log of a bench\n% 3 samples\n" + TEXT, MAPPED, IN_SI),
    "notes and a head": ("# log of a bench\n# " + TEXT.replace(",", " "), MAPPED, IN_SI),
    "an instrument's header": ("Bench;A\nDate;2024-03-01\n\n" + TEXT, MAPPED, IN_SI),
    "a header as wide as the table": ("Lab\nX,2,3\nEnd,,\n" + TEXT, MAPPED, IN_SI),
    "a header and a line of units": ("Lab\n\nt,enc,i\nms,deg,mA" + TEXT[7:], MAPPED, IN_SI),
    "compressed": (gzip.compress(TEXT.encode(), mtime=0), MAPPED, IN_SI),
}
"""A table, its mapping, the values that are read, and part of what is remarked."""


@pytest.mark.parametrize("case", READ.values(), ids=READ)
def test_what_a_table_holds_becomes_si(tmp_path, case):
    content, mapping, expected, *remark = case
    path, remarks = tmp_path / "run.csv", []
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    (run,) = read_runs(path, machine(tmp_path, mapping), remarks)
    for name, values in expected.items():
        np.testing.assert_allclose(run[name], values, atol=1e-12)
    assert run.valid.all()
    for part in remark:
        assert any(part in said for _, said in remarks)
    assert run.started_at_ns is None


def test_a_column_that_is_not_mapped_is_left_out_and_a_second_value_at_a_time_refused(tmp_path):
    (run,) = opened(tmp_path, "time_s,motor_angle_rad,Remark\n0,1,0\n0.1,2,0\n", "[data]\n")
    assert set(run.columns) == {"motor_angle_rad"}
    with pytest.raises(DataError, match="line 4: time goes from") as error:
        opened(tmp_path, "time_s,motor_angle_rad\n0,1\n0.1,2\n0.1,2.5\n0.2,3\n", "[data]\n")
    assert "1 sample has the time of the one before it" in error.value.why
    assert "even_rate_hz = 10 under [data]" in error.value.fix
    assert "resets" not in error.value.fix
    with pytest.raises(DataError) as error:
        opened(tmp_path, "t,enc,i\n23:59:59.500,0,0\n")
    assert error.value.fix == "Write time_s = 't:iso8601'."


def test_samples_that_do_not_count_are_flagged_with_the_reason(tmp_path):
    table = "time_s,motor_angle_rad,drive_ratio\n0,1,1\n0.1,,1\n0.2,3,0\n0.3,4,0\n"
    text = '[[data.invalid]]\nwhen = "drive_ratio < 1"\nreason = "the drive was off"\n'
    (run,) = opened(tmp_path, table, text)
    assert run.valid.tolist() == [True, False, False, False]
    (stretch,) = run.stretches
    assert (stretch.start_s, stretch.stop_s, stretch.reason) == (0.2, 0.3, "the drive was off")


def test_a_reading_that_is_none_is_bridged_before_a_filter_smears_it(tmp_path):
    time_s = np.arange(200) / 100
    angle = np.sin(2 * time_s)
    text = """
        [data]
        even_rate_hz = 100.0
        [data.columns]
        time_s = "t"
        motor_angle_rad = "q"
        [[data.invalid]]
        when = "motor_angle_rad < -3.1"
        reason = "the servo did not answer"
        missing = true
        """
    (run,) = opened(tmp_path, {"t": time_s, "q": np.where(time_s == 1.0, -np.pi, angle)}, text)
    filtered = filter_recording(run, LowPass(15.0, 3))
    assert not filtered.valid[100]
    error = (filtered["motor_angle_rad"] - angle)[filtered.valid]
    assert np.abs(error[10:-10]).max() < 1e-3


def test_names_in_a_mat_file_are_those_of_structs_matrices_and_single_values(tmp_path):
    path = tmp_path / "run.mat"
    joints = np.column_stack([ANGLE_DEG, 2 * ANGLE_DEG])
    log = {"t": TIME_MS, "q": joints, "z": joints * 1j, "vir": CURRENT_MA}
    savemat(path, {"log": log, "note": "calm", "gtau": 35.15})
    text = """
        [data.columns]
        time_s = "log.t:ms"
        joint_2_angle_rad = "log.q.2:deg"
        drive_force_n = { column = "log.vir", unit = "N", gain = "gtau" }
        [data.conditions]
        note = "note"
        """
    (run,) = open_table(path, machine(tmp_path, text))
    np.testing.assert_allclose(run["joint_2_angle_rad"], 2 * np.radians(ANGLE_DEG))
    np.testing.assert_allclose(run["drive_force_n"], 35.15 * CURRENT_MA)
    assert run.conditions == {"note": "calm"}


def test_a_formula_is_of_channels_and_conditions_in_si(tmp_path):
    path = write(tmp_path, "json")
    text = f"""
        [data.conditions]
        load_mass_kg = "load_g:g"
        [data.formulas]
        weight_n_m = "load_mass_kg * g_m_s2 * 0.1 * sin(motor_angle_rad)"
        {MAPPED}"""
    (run,) = open_table(path, machine(tmp_path, text))
    assert run.conditions == {"load_mass_kg": 0.25}
    expected = 0.25 * 9.80665 * 0.1 * np.sin(np.radians(ANGLE_DEG))
    np.testing.assert_allclose(run["weight_n_m"], expected)


def test_dates_are_a_clock_and_the_start_of_the_run(tmp_path):
    hour = "2024-05-01T12:00:00"
    table = f"when,enc\n{hour}+00:00,1\n{hour}.250+00:00,2\n{hour}.500+00:00,3\n"
    text = '[data.columns]\ntime_s = "when:iso8601"\nmotor_angle_rad = "enc:deg"\n'
    (run,) = opened(tmp_path, table, text)
    np.testing.assert_allclose(run.time_s, [0, 0.25, 0.5])
    assert run.started_at_ns == 1714564800 * 10**9


@pytest.mark.parametrize(
    ("starts_s", "known_s", "remark"),
    [
        ((38.5, 0.0, 76.25), (38.5, 0.0, 76.25), ""),  # files whose names are in another order
        ((0.0, 0.0, 0.0), None, "the time begins again in a run"),
        ((0.0, 0.2, 40.0), None, "the time begins again in a run"),
    ],
)
def test_a_clock_that_goes_on_from_file_to_file_is_the_start_of_the_runs(
    tmp_path, starts_s, known_s, remark
):
    for number, start_s in enumerate(starts_s):
        columns = {"t": [start_s + 0.1 * k for k in range(4)], "enc": [number, 1, 2, 3]}
        text_table(tmp_path / f"{number}.csv", columns)
    remarks = []
    runs = read_runs(tmp_path, machine(tmp_path, IN_DEG), remarks)
    assert [run.started_at_ns for run in runs] == (
        [None] * 3 if known_s is None else [round(1e9 * start_s) for start_s in known_s]
    )
    said = [f"{remark}, so the pauses between runs are not known"] if remark else []
    assert [text for _, text in remarks if "pauses" in text] == said


CUTS = [
    ("gap_s = 0.5", {"t": [0, 0.1, 0.2, 2.0, 2.1, 2.2]}),
    ("resets = true", {"t": [0, 0.1, 0.2, 0.0, 0.1, 0.2]}),
    ('changes = ["trial"]', {"t": [0, 0.1, 0.2, 0.3, 0.4, 0.5], "trial": [1, 1, 1, 2, 2, 2]}),
    ('falls = "pwm"', {"t": [0, 0.1, 0.2, 0.3, 0.4, 0.5], "pwm": [1, 2, 3, 1, 2, 3]}),
    ('mark = "key"', {"t": [0, 0.1, 0.2, 0.3, 0.4, 0.5], "key": [0, 0, 0, 1, 1, 0]}),
    ("lap_s = 0.3", {"t": [0, 0.1, 0.2, 0.3, 0.4, 0.5]}),
    ("at_s = [0.3]", {"t": [0, 0.1, 0.2, 0.3, 0.4, 0.5]}),
    ("gap_s = 9", {"t": [86399.6, 86399.8, 0.0, 99.0, 99.2, 99.4]}),  # midnight in a run
    ("gap_s = 9", {"t": [86399.0, 86399.2, 86399.4, 10.0, 10.2, 10.4]}),  # and between two
]


@pytest.mark.parametrize(("rule", "columns"), CUTS)
def test_runs_are_cut_where_the_mapping_states(tmp_path, rule, columns):
    runs = opened(
        tmp_path, {**columns, "enc": [1, 2, 3, 4, 5, 6]}, f"{IN_DEG}[data.runs]\n{rule}\n"
    )
    found = [np.degrees(run["motor_angle_rad"]).round().tolist() for run in runs]
    assert found == [[1, 2, 3], [4, 5, 6]]


def test_a_counter_that_starts_again_does_so_in_each_run_for_itself(tmp_path):
    """The second run begins with the counter at 0; one cell of it is empty."""
    table = (
        "t,trial,enc\n0,1,3072\n0.1,1,4095\n0.2,1,1024\n0.3,2,0\n0.4,2,4000\n0.5,2,\n0.6,2,3900\n"
    )
    text = SECONDS + 'motor_angle_rad = { column = "enc", unit = "rev/4096", wraps_at = 4096 }\n'
    first, second = opened(tmp_path, table, f'{text}[data.runs]\nchanges = ["trial"]')
    np.testing.assert_allclose(
        first["motor_angle_rad"], np.array([3072, 4095, 5120]) / 2048 * np.pi
    )
    np.testing.assert_allclose(
        second["motor_angle_rad"][[0, 1, 3]], np.array([0, -96, -196]) / 2048 * np.pi
    )


@pytest.mark.parametrize(
    ("trials", "names"),
    [
        ([1, 1, 1, 2, 2, 2], ["run-01", "run-02"]),
        ([9, 9, 9, 110, 110, 110], ["run-009", "run-110"]),
        (["Tag 3", "Tag 3", "Tag 3", "b/c", "b/c", "b/c"], ["run-tag-3", "run-b-c"]),
        ([1.5, 1.5, 1.5, 2.5, 2.5, 2.5], ["run-1.5", "run-2.5"]),
        (["a+", "a+", "a+", "a-", "a-", "a-"], ["run-00", "run-01"]),  # the same in a name
        ([1, 1, 2, 2, 1, 1], ["run-00", "run-01", "run-02"]),
    ],
)
def test_runs_are_named_by_their_trial_where_each_has_its_own(tmp_path, trials, names):
    rows = [f"{0.1 * k},{k},{trial}\n" for k, trial in enumerate(trials)]
    text = f'{IN_DEG}[data.runs]\nchanges = ["trial"]\n'
    runs = opened(tmp_path, "".join(["t,enc,trial\n", *rows]), text)
    assert [run.name for run in runs] == names


def test_each_run_is_on_a_clock_of_its_own_and_a_short_rest_is_left_out(tmp_path):
    path = tmp_path / "run.csv"
    text_table(path, {"t": [0.1 * k for k in range(7)], "enc": list(range(7))})
    remarks = []
    text = f"{IN_DEG}[data.runs]\nlap_s = 0.3\n"
    runs = list(read_runs(path, machine(tmp_path, text), remarks))
    assert [run.name for run in runs] == ["run-00", "run-01"]
    assert [run.time_s[0] for run in runs] == [0, 0]
    assert any("left out" in text for _, text in remarks)


def test_conditions_come_from_columns_names_of_files_and_a_side_file(tmp_path):
    for load, trial in ((100, 1), (200, 2)):
        columns = {"t": [0.0, 0.1, 0.2], "enc": [1, 2, 3], "trial": [trial] * 3}
        text_table(tmp_path / f"load_{load}g.csv", columns)
    (tmp_path / "about.csv").write_text(
        "file,operator,arm\nload_100g,Ada,10\nload_200g.csv,Max,15\n"
    )
    text = """
        [data]
        file_name = "load_(?P<load>[0-9]+)g"
        side_file = "about.csv"
        [data.columns]
        time_s = "t"
        motor_angle_rad = "enc:deg"
        [data.conditions]
        load_mass_kg = "load:g"
        trial = "trial"
        operator = "operator"
        arm_m = "arm:cm"
        bench = { value = "B2" }
        """
    first, second = open_table(tmp_path, machine(tmp_path, text))
    assert first.conditions == {
        "load_mass_kg": pytest.approx(0.1),
        "trial": 1,
        "operator": "Ada",
        "arm_m": pytest.approx(0.1),
        "bench": "B2",
    }
    assert second.conditions["operator"] == "Max"
    assert second.conditions["load_mass_kg"] == pytest.approx(0.2)


def test_channels_of_two_rates_in_one_table_are_each_interpolated(tmp_path):
    time = np.arange(200) / 100
    rows = "".join(
        f"{t * 1000},{90 * t},{100 * t if k % 5 == 0 else ''}\n" for k, t in enumerate(time)
    )
    (run,) = opened(tmp_path, "t,enc,i\n" + rows, "[data]\neven_rate_hz = 50\n" + MAPPED)
    remarks = []
    list(read_runs(tmp_path / "run.csv", machine(tmp_path), remarks))
    assert "160 samples with a cell that is empty, NaN or inf flagged" in remarks[-1][1]
    assert "even_rate_hz = 20.1 interpolates" in remarks[-1][1]
    inside = run.time_s <= 1.95
    assert not run.flags[inside].any()
    np.testing.assert_allclose(run["motor_current_a"][inside], 0.1 * run.time_s[inside], atol=1e-9)
    np.testing.assert_allclose(run["motor_angle_rad"], np.radians(90 * run.time_s), atol=1e-9)


def test_an_uneven_clock_is_made_even_where_asked_for(tmp_path):
    time_s = np.cumsum(np.random.default_rng(0).uniform(0.008, 0.012, 300))
    text = f"[data]\neven_rate_hz = 100\n{ANGLE}"
    (run,) = opened(tmp_path, {"t": time_s, "enc": 10 * time_s}, text)
    np.testing.assert_allclose(np.diff(run.time_s), 0.01)
    np.testing.assert_allclose(run["motor_angle_rad"], 10 * (run.time_s + time_s[0]), atol=1e-9)


@pytest.mark.parametrize("kind", ["matrices", "array of structs", "cells", "npz"])
def test_each_trial_of_a_file_is_a_run(tmp_path, kind):
    """Trials of different lengths, as variables, structs or cells, with a single value each."""
    times = [np.arange(n) / 10.0 for n in (4, 6, 5)]
    matrices = [np.column_stack([t, 2.0 * t]) for t in times]
    names = "1", "2"
    path, trials = tmp_path / "lab.mat", "test*"
    match kind:
        case "matrices":
            savemat(path, {f"test{k}": m for k, m in enumerate(matrices)} | {"note": "x"})
        case "npz":
            path = tmp_path / "lab.npz"
            np.savez(path, **{f"test{k}": m for k, m in enumerate(matrices)})
        case "array of structs":
            names, trials = ("t", "q"), "trial.*"
            fields = np.array(
                [(t, 2.0 * t, k) for k, t in enumerate(times)],
                dtype=[("t", object), ("q", object), ("mass", object)],
            )
            savemat(path, {"trial": fields})
        case "cells":
            trials = "data.*"
            cells = np.empty(3, object)
            cells[:] = matrices
            savemat(path, {"data": cells})
    text = f'[data]\ntrials = "{trials}"\n\n[data.columns]\ntime_s = "{names[0]}"\n'
    text += f'motor_angle_rad = "{names[1]}"\n'
    if kind == "array of structs":
        text += '\n[data.conditions]\nload_mass_kg = "mass"\n'
    runs = list(open_table(path, machine(tmp_path, text)))
    assert [len(run.time_s) for run in runs] == [4, 6, 5]
    for run, time_s in zip(runs, times, strict=True):
        np.testing.assert_allclose(run["motor_angle_rad"], 2.0 * time_s)
    if kind == "array of structs":
        assert [run.conditions["load_mass_kg"] for run in runs] == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("kind", ["matrix", "fields"])
def test_one_array_of_numpy_is_a_table(tmp_path, kind):
    rows = np.column_stack([*COLUMNS.values()])
    text = MAPPED
    if kind == "fields":
        rows = np.array([(*row,) for row in rows], dtype=[(name, float) for name in COLUMNS])
    else:
        for k, name in enumerate(COLUMNS):
            text = text.replace(f'"{name}:', f'"{k + 1}:')
    np.save(tmp_path / "run.npy", rows)
    (run,) = open_table(tmp_path / "run.npy", machine(tmp_path, text))
    np.testing.assert_allclose(run["motor_current_a"], CURRENT_MA / 1000)


@pytest.mark.parametrize("kind", ["files", "logs", "trials"])
def test_numbers_in_the_names_of_runs_count_by_their_value(tmp_path, kind):
    numbers = [*range(1, 12)]
    text, path = MAPPED, tmp_path / "data"
    path.mkdir()
    if kind == "trials":
        text = '[data]\ntrials = "test*"\n\n[data.columns]\ntime_s = "1"\nmotor_angle_rad = "2"\n'
        rows = {f"test{k}": np.column_stack([np.arange(4.0), np.full(4, k)]) for k in numbers}
        path = path / "lab.mat"
        savemat(path, dict(sorted(rows.items())))
    else:
        for k in numbers:
            columns = {"t": TIME_MS.tolist(), "enc": [float(k)] * N, "i": [0.1] * N}
            text_table(path / f"test {k}.csv", columns)
    runs = open_table(path, machine(tmp_path, text))
    if kind == "logs":
        for run in runs:
            write_recording(tmp_path / f"{run.name}.mcap", run)
        runs = open_campaign(tmp_path)
    angles = [float(run["motor_angle_rad"][0]) for run in runs]
    assert angles == sorted(angles)


def test_files_of_one_name_in_several_folders_are_runs_of_their_own(tmp_path):
    columns = {name: values.tolist() for name, values in COLUMNS.items()}
    for k in (1, 2, 10):
        (tmp_path / "data" / f"run{k}").mkdir(parents=True)
        text_table(tmp_path / "data" / f"run{k}" / "log.csv", columns)
    text = '[data]\nfiles = "*/*.csv"\nfile_name = "run(?P<load>[0-9]+)/"\n' + MAPPED
    text += '[data.conditions]\nload_mass_kg = "load:g"\n'
    with pytest.raises(UsageError, match="no file of a known kind") as error:
        open_table(tmp_path / "data", machine(tmp_path))
    assert 'files = "*/*.csv"' in error.value.fix
    runs = open_table(tmp_path / "data", machine(tmp_path, text))
    assert runs.names == ("run1-log", "run2-log", "run10-log")
    assert [run.conditions["load_mass_kg"] for run in runs] == pytest.approx([1e-3, 2e-3, 1e-2])


def test_a_pattern_of_trials_that_nothing_fits_names_what_there_is(tmp_path):
    savemat(tmp_path / "lab.mat", {"run1": np.eye(4)})
    text = '[data]\ntrials = "test*"\n\n[data.columns]\ntime_s = "1"\nmotor_angle_rad = "2"\n'
    with pytest.raises(DataError, match=r"no variable 'test\*'\. Its variables are run1\."):
        open_table(tmp_path / "lab.mat", machine(tmp_path, text))
