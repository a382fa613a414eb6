"""`rig import`: what a person sees before anything is written, and what is written then."""

import json
import re

import numpy as np
import pytest
from scipy.io import savemat

from estimation.files import write_text_atomic
from estimation.plant import Axis, Plant, Sensor, Transmission
from estimation.plant_file import to_toml
from estimation.recording import Recording
from rig.errors import ExitCode
from rig.importers.questions import questions as questions_of
from rig.importers.registry import left_out, open_campaign
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import open_table, read_runs
from rig.importers.table.preview import preview
from tests.estimation.causes.synthetic import HOIST, hoisted
from tests.rig.importers.conftest import text_table

TIME = np.arange(0, 8, 0.01)
WAVE = np.sin(2 * TIME)


def asked(path, *flags):
    """Return the questions of a preview about the table at a path."""
    return preview(list(read_runs(path, read_mapping(None, flags), [])), []).questions


def questions(tmp_path, **columns):
    return asked(text_table(tmp_path / "run.csv", columns))


@pytest.mark.parametrize(
    ("name", "values", "word"),
    [
        ("motor_current_a", np.full(TIME.size, 0.2), "constant"),
        ("motor_current_a", np.clip(WAVE, -0.8, 0.8), "clipped"),
        ("motor_angle_rad", 400 * WAVE, "unusually large"),
        ("motor_temperature_k", 20 + WAVE, "degC"),
        ("motor_angle_rad", np.mod(2 * TIME, 2 * np.pi), "every 6.283 rad? wraps_at"),
        ("motor_angle_rad", np.mod(20 * WAVE, 5.03), "every 5.03 rad? wraps_at"),
        ("slide_position_m", np.mod(9 * WAVE + 2, 4) - 2, "every 4 m? wraps_at"),
    ],
)
def test_what_looks_wrong_with_a_channel_is_asked(tmp_path, name, values, word):
    found = questions(tmp_path, time_s=TIME, **{name: values})
    assert found
    for question in found:
        assert question.startswith(f"{name}: ")
        assert word in question


def test_a_table_as_it_should_be_raises_no_question(tmp_path):
    """A velocity that fits, and a motion that comes to rest at its end, which is not clipped."""
    there_and_back = 0.5 - 0.5 * np.cos(np.minimum(TIME, np.pi))
    columns = {"motor_angle_rad": WAVE, "motor_velocity_rad_s": 2 * np.cos(2 * TIME)}
    assert questions(tmp_path, time_s=TIME, **columns, jaw_angle_rad=there_and_back) == []


def spiked(values, **samples):
    found = values.copy()
    for place, value in samples.items():
        found[int(place[1:])] = value
    return found


def test_a_single_sample_far_beyond_all_others_is_named_with_its_remedy(tmp_path):
    force = 400 + 100 * WAVE
    (found,) = questions(tmp_path, time_s=TIME, load_force_n=spiked(force, k500=1e6))
    assert "1 sample far beyond all others, 1e+06 N at 5 s of run; was it so?" in found
    when = re.search(r"when = '(.*?)'", found)[1]
    flags = [(("invalid",), [{"when": when, "reason": "spike", "missing": True}], "")]
    (run,) = read_runs(tmp_path / "run.csv", read_mapping(None, flags), [])
    assert np.flatnonzero(~run.valid).tolist() == [500]
    assert questions(tmp_path, time_s=TIME, load_force_n=force) == []


def test_a_value_that_stands_for_no_reading_is_named_with_its_remedy_alone(tmp_path):
    """The size of the run is not asked about: this value is most of it."""
    for number in range(6):
        columns = {"motor_angle_rad": WAVE, "motor_current_a": 0.1 + 0.02 * number * WAVE}
        if number == 3:
            columns["motor_angle_rad"] = spiked(WAVE, **{f"k{k}": -174.5 for k in range(100, 110)})
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    (found,) = (q for q in asked(tmp_path) if "same" not in q)
    assert found.startswith("motor_angle_rad: 10 samples far beyond all others, exactly -174.5 rad")
    assert "from 1 s of run3 to 1.09 s of run3; does that mean that nothing was read?" in found
    when = re.search(r"when = '(.*?)'", found)[1]
    flags = [(("invalid",), [{"when": when, "reason": "no reading", "missing": True}], "")]
    runs = list(read_runs(tmp_path, read_mapping(None, flags), []))
    assert [int((~run.valid).sum()) for run in runs] == [0, 0, 0, 10, 0, 0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("huge", [1e300, -3.4e38])
def test_a_number_that_cannot_be_a_reading_is_an_empty_cell(tmp_path, huge):
    force = spiked(400 + 100 * WAVE, k500=huge)
    (found,) = questions(tmp_path, time_s=TIME, load_force_n=force)
    assert "the column 'load_force_n' holds 1 number beyond any reading" in found
    assert " in line 502, taken as an empty cell" in found
    (run,) = open_table(tmp_path, read_mapping(None, []))
    assert np.flatnonzero(~run.valid).tolist() == [500]


def test_a_position_that_switches_to_and_fro_does_not_wrap(tmp_path):
    noise = np.random.default_rng(0).normal(0, 0.01, TIME.size)
    angle = np.sign(np.sin(2 * TIME + 0.1)) + noise
    assert questions(tmp_path, time_s=TIME, motor_angle_rad=angle) == []


def test_a_run_that_is_there_twice_is_asked_about_and_counts_once(tmp_path, said):
    columns = {"time_s": TIME, "motor_angle_rad": WAVE}
    for name in ("a", "b", "c"):
        factor = 1.1 if name == "b" else 1.0
        text_table(tmp_path / f"{name}.csv", columns | {"motor_angle_rad": factor * WAVE})
    (found,) = asked(tmp_path)
    assert found.startswith("a, c: these runs are the same, sample by sample")
    campaign = open_table(tmp_path, read_mapping(None, []))
    assert campaign.evidence.names == ("a", "b")
    logs = tmp_path / "logs"
    said("import", tmp_path, "--out", logs)
    campaign = open_campaign(logs)
    assert campaign.evidence.names == ("a", "b")
    assert left_out(logs, campaign) == [
        "Run c does not count: it is the same as a, sample by sample; delete one of them"
    ]


def test_a_channel_that_is_clipped_in_some_runs_is_named_with_them(tmp_path):
    for number in range(4):
        force = np.minimum(WAVE, 0.8) if number == 2 else (0.7 + 0.01 * number) * WAVE
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, "load_force_n": force})
    (found,) = asked(tmp_path)
    assert "held at the greatest value, 0.8 N in run2; is it clipped?" in found


def test_a_noisy_channel_that_is_clipped_is_asked_about(tmp_path):
    """The step before a plateau is small by chance in some of them."""
    random = np.random.default_rng(8)
    force = np.minimum(np.round(WAVE + random.normal(0, 0.01, TIME.size), 3), 0.9)
    text_table(tmp_path / "run.csv", {"time_s": TIME, "load_force_n": force})
    (found,) = asked(tmp_path)
    share = 100 * np.mean(force == 0.9)
    assert float(found.split()[1]) == pytest.approx(share, rel=0.15)


def test_a_temperature_that_is_read_in_whole_degrees_is_not_clipped(tmp_path):
    random = np.random.default_rng(0)
    for number in range(4):
        warm = 293.4 + 0.8 * number + 0.1 * TIME + random.normal(0, 0.1, TIME.size)
        columns = {"time_s": TIME, "case_temperature_k": np.round(warm), "motor_angle_rad": WAVE}
        text_table(tmp_path / f"run{number}.csv", columns)
    assert not any("clipped" in question for question in asked(tmp_path))


def test_a_copy_of_a_run_with_another_clock_is_asked_about_and_counts_once(tmp_path):
    for name, start in (("a", 0.0), ("b", 0.0), ("c", 5.25)):
        factor = 1.1 if name == "b" else 1.0
        columns = {"time_s": start + TIME, "motor_angle_rad": factor * WAVE}
        text_table(tmp_path / f"{name}.csv", columns)
    assert any(q.startswith("a, c: these runs are the same, sample by") for q in asked(tmp_path))
    assert open_table(tmp_path, read_mapping(None, [])).evidence.names == ("a", "b")


SCREW = Plant(
    name="lift",
    axes=(Axis("motor", "rad"), Axis("slide", "m")),
    transmissions=(Transmission("screw", "motor", "slide", -628.0),),
    sensors=(Sensor("motor_angle_rad", "motor", "position"),),
)


@pytest.mark.parametrize(("size", "is_asked"), [(250.0, False), (20_000.0, True)])
def test_the_travel_of_a_motor_counts_behind_its_gear(tmp_path, said, size, is_asked):
    file = tmp_path / "lift.toml"
    file.write_text(f"{to_toml(SCREW)}\n[data]\n")
    columns = {"time_s": TIME, "motor_angle_rad": size * WAVE}
    path = text_table(tmp_path / "run.csv", columns)
    shown = said("import", path, "--machine", file, "--preview").err
    assert ("is unusually large" in shown) == is_asked
    asked = questions_of(list(read_runs(path, read_mapping(file, []), [])), SCREW)
    assert bool(asked) == is_asked


@pytest.mark.parametrize(
    ("channel", "turned"),
    [("rope_force_n", ()), ("rope_force_n", (6, 9)), ("drive_command_v", (6, 9))],
)
def test_a_channel_of_the_other_sign_in_some_runs_is_named_by_the_equation(
    tmp_path, said, channel, turned
):
    """As `rig machine check` does; of a weight, the correlation of two channels shows no sign."""
    for k, run in enumerate(hoisted()):
        columns = {**run.columns, channel: -run[channel] if k in turned else run[channel]}
        text_table(tmp_path / f"{run.name}.csv", {"time_s": run.time_s, **columns})
    file = tmp_path / "hoist.toml"
    file.write_text(f"{HOIST}\n[data]\n")
    asked = f"{channel} is about -1 times what the other runs predict for it in 06, 09; is its"
    shown = said("import", tmp_path, "--machine", file, "--preview")
    assert (asked in shown.err) == bool(turned)
    assert ("Nothing looks wrong" in shown.out) != bool(turned)
    checked = " ".join(said("machine check", file, tmp_path).out.split())
    assert (asked in checked) == bool(turned)
    assert checked.count("is about -1 times") == bool(turned)


def test_a_file_in_another_unit_is_named_where_the_others_are_right(tmp_path):
    """A third of the runs: the usual size is not known, but that of these cannot be."""
    for number in range(6):
        unit = 1000.0 if number in (1, 4) else 1.0
        columns = {"time_s": TIME, "motor_current_a": (0.8 + number) * unit * WAVE}
        text_table(tmp_path / f"run{number}.csv", columns)
    found = asked(tmp_path)
    (large,) = (one for one in found if "unusually large" in one)
    assert "is unusually large in run1, run4, and the other runs are not" in large
    assert "milliamperes or counts there? A unit of [data] is that of all files" in large


def test_a_run_whose_zero_moved_is_asked_about(tmp_path):
    for number in range(8):
        zero = np.full(TIME.size, 3.0 if number == 5 else 1 + 0.01 * number)
        wave = (1 + 0.01 * number) * WAVE
        columns = {"time_s": TIME, "motor_angle_rad": wave, "zero": zero}
        text_table(tmp_path / f"run{number}.csv", columns)
    (found,) = asked(tmp_path, (("conditions", "motor_zero_offset_rad"), "zero", ""))
    assert found.startswith("motor_zero_offset_rad: run5 has its zero at 3")


def of_runs(tmp_path, angles, currents):
    """Return the questions about runs of these sizes of an angle and a current."""
    for number, (angle, current) in enumerate(zip(angles, currents, strict=True)):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {"motor_angle_rad": angle * wave, "motor_current_a": current * wave}
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    return asked(tmp_path)


@pytest.mark.parametrize(
    ("factor", "question"),
    [
        (np.pi / 180, "is it stated in deg without being so there?"),
        (180 / np.pi, "is it in deg there?"),
        (1 / 20, "are unit and gain right there?"),
    ],
)
def test_one_run_in_another_unit_is_asked_once(tmp_path, factor, question):
    angles = np.array([1.0, 0.9, 1.2, factor, 1.1, 0.8])
    (found,) = of_runs(tmp_path, angles, [0.5, 0.6, 0.5, 0.5, 0.6, 0.4])
    assert "motor_angle_rad: it varies" in found
    assert "in run3 as in the other runs" in found
    assert question in found


def test_a_run_in_which_a_channel_is_constant_is_asked_about_as_that(tmp_path):
    """At any value: rounding of the mean is no variation."""
    for number in range(6):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {"motor_angle_rad": wave, "load_force_n": 122.9 + (number != 3) * wave}
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    found = preview(read_runs(tmp_path, read_mapping(None, []), []), []).questions
    (asked,) = [one for one in found if "constant" in one]
    assert asked == (
        "load_force_n: it is constant in run3, and varies in the other runs; is the sensor"
        " connected and within its range there?"
    )
    assert not any("times as much" in one for one in found)


@pytest.mark.parametrize(
    ("angles", "currents"),
    [
        ([1.0, 0.9, 1.2, 0.02, 1.1], [0.5, 0.5, 0.6, 0.01, 0.5]),  # one moves less
        ([1.0, 0.9, 0.3, 0.02, 5.0], [0.5, 0.5, 0.6, 0.5, 0.5]),  # runs of all sizes
    ],
)
def test_a_run_that_moves_less_is_not_asked_about(tmp_path, angles, currents):
    assert of_runs(tmp_path, angles, currents) == []


def test_a_position_that_is_the_integral_of_a_speed_is_not_asked_about(tmp_path):
    """By chance it varies little in a run whose speed varies as usual."""
    speed = Sensor("drum_velocity_rad_s", "drum", "speed")
    plant = Plant("drum", axes=(Axis("drum", "rad"),), sensors=(speed,))
    runs = []
    for number in range(6):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {"motor_supply_v": wave, "drum_velocity_rad_s": wave}
        columns["drum_angle_rad"] = (0.16 if number == 3 else 1.0) * wave
        runs.append(Recording(f"run{number}", TIME, columns))
    assert any(one.startswith("drum_angle_rad: ") for one in questions_of(runs))
    assert questions_of(runs, plant) == []


@pytest.mark.parametrize(
    ("size", "of_noise", "is_asked"),
    [(0.16, 1.0, False), (0.16, 0.16, True), (0.16, None, True)],
)
def test_a_run_that_moves_less_by_friction_alone_is_known_by_its_noise(
    tmp_path, size, of_noise, is_asked
):
    """Friction is most of the current. A unit would change the noise, too, or only one angle."""
    random = np.random.default_rng(4)
    for number in range(6):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {"motor_current_a": np.sign(wave) + 0.2 * wave}
        for name in ("load_angle_rad", "motor_angle_rad"):
            is_odd = number == 3 and (of_noise or name == "load_angle_rad")
            noise = 0.01 * random.normal(size=TIME.size)
            columns[name] = (size if is_odd else 1.0) * wave
            columns[name] += (of_noise or 1.0 if is_odd else 1.0) * noise
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    found = asked(tmp_path)
    assert any("load_angle_rad: it varies 0.1" in one for one in found) == is_asked


@pytest.mark.parametrize(
    ("masses", "is_asked"),
    [
        ([0.0, 5.0, 9.0, 12.0, 0.0, 5.0, 9.0, 12.0], False),  # no payload explains it
        ([12.0, 5.0, 9.0, 12.0, 0.0, 5.0, 9.0, 12.0], True),
        ([0.0, 5.0, 9.0, 12.0, 5.0, 0.0, 9.0, 12.0], True),  # another one without it varies more
    ],
)
def test_a_condition_explains_that_a_channel_varies_less(tmp_path, masses, is_asked):
    forces = [1.0, 5.1, 9.3, 12.2, 1.1, 5.2, 9.0, 12.1]
    for number, (mass, force) in enumerate(zip(masses, forces, strict=True)):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {"motor_angle_rad": wave, "rope_force_n": force * wave, "mass": 0 * TIME + mass}
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    found = asked(tmp_path, (("conditions", "load_mass_kg"), "mass", ""))
    assert bool(found) == is_asked
    assert all("rope_force_n: it varies" in one for one in found)


def of_all_sizes(tmp_path, odd=1.0, odd_name="drive_command_v", fast=1.0):
    """Return the questions about runs of all sizes with noise, a channel of one of them changed."""
    random = np.random.default_rng(2)
    for number, size in enumerate([1.0, 3.0, 0.2, 0.5, 9.0, 2.0, 0.1, 5.0]):
        time_s = TIME * (fast if number == 3 else 1.0)
        wave = size * np.sin(time_s * (2 + 0.1 * number))
        rate = size * np.cos(time_s * (2 + 0.1 * number))
        columns = {
            "motor_angle_rad": wave + 1e-4 * random.normal(size=TIME.size),
            "drive_command_v": rate + 0.3 * wave + 0.01 * random.normal(size=TIME.size),
            "rope_force_n": 100 * size + 5 * random.normal(size=TIME.size),
        }
        columns[odd_name] *= odd if number == 3 else 1.0
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    return asked(tmp_path)


@pytest.mark.parametrize(
    ("name", "odd", "words"),
    [
        ("drive_command_v", 1e-3, "from sample to sample in run3 as in the other runs, and other"),
        ("drive_command_v", 1e-3, "is it stated in mV without being so there?"),
        ("drive_command_v", 1e3, "is it in mV there?"),
        ("rope_force_n", 10.0, "rope_force_n: it varies"),
        ("rope_force_n", 100.0, "are unit and gain right there?"),
        (
            "drive_command_v",
            -1.0,
            "drive_command_v: it goes against the motion of motor_angle_rad in run3,",
        ),
        (
            "motor_angle_rad",
            -1.0,
            "drive_command_v: it goes against the motion of motor_angle_rad in run3,",
        ),
    ],
)
def test_one_of_runs_of_all_sizes_in_another_unit_or_sign_is_asked_once(tmp_path, name, odd, words):
    (found,) = of_all_sizes(tmp_path, odd, name)
    assert words in found


@pytest.mark.parametrize("fast", [1.0, 6.0])
def test_runs_of_all_sizes_or_speeds_are_not_asked_about(tmp_path, fast):
    assert of_all_sizes(tmp_path, fast=fast) == []


def test_a_reference_without_noise_of_a_faster_run_is_not_asked_about(tmp_path):
    random = np.random.default_rng(6)
    for number, speed in enumerate([2.0, 2.1, 1.9, 5.0, 2.2, 1.8]):
        wave = np.sin(speed * TIME)
        noise = 0.01 * random.normal(size=TIME.size)
        columns = {"target_angle_rad": wave, "motor_current_a": np.sign(wave) + noise}
        columns["motor_angle_rad"] = wave + noise
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    assert asked(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "runs", "is_asked"),
    [
        ("slide_position_m", [3], True),
        ("rope_force_n", [3], True),
        ("slide_position_m", [], False),
        ("rope_force_n", [1, 3, 5], False),  # so often that it is probably so
        ("wrist_angle_rad", [3], False),  # an axis of its own may rest
    ],
)
def test_a_channel_that_stands_still_while_the_machine_moves_is_named(
    tmp_path, name, runs, is_asked
):
    random = np.random.default_rng(3)
    for number in range(8):
        wave = np.sin(TIME * (2 + 0.1 * number))
        columns = {
            "motor_angle_rad": 100 * wave,
            "slide_position_m": 0.1 * wave,
            "rope_force_n": 30 * wave + 3 * np.cos(7 * TIME),
            "wrist_angle_rad": np.cos(TIME * (3 - 0.1 * number)),
        }
        for values in columns.values():
            values += 0.01 * np.ptp(values) * random.normal(size=TIME.size)
        if number in runs:
            columns[name][300:500] = columns[name][300]
        text_table(tmp_path / f"run{number}.csv", {"time_s": TIME, **columns})
    found = asked(tmp_path)
    assert len(found) == is_asked
    assert all(one.startswith(f"{name}: it stands still in run3 from 3 to 4.99 s") for one in found)


RANDOM = np.random.default_rng(1)
CLOCKS = {
    "a gap": (np.where(TIME > 4, TIME + 1, TIME), ["1 gap in time", "gap_s"]),
    "jitter": (TIME + RANDOM.uniform(0, 0.0099, TIME.size), ["even_rate_hz"]),
    "lost samples": (
        TIME[RANDOM.uniform(size=TIME.size) > 0.05],
        ["short gaps in time", "even_rate_hz = 100 under [data]"],
    ),
    "a step that no filter counts": (
        TIME + 0.006 * (np.arange(TIME.size) == 100),
        ["steps of time are between 4 and 16 ms, 10 ms is usual", "even_rate_hz = 100"],
    ),
}


@pytest.mark.parametrize("case", CLOCKS.values(), ids=CLOCKS)
def test_what_looks_wrong_with_the_clock_is_asked(tmp_path, case):
    time_s, words = case
    (question,) = questions(tmp_path, time_s=time_s, motor_angle_rad=np.sin(2 * time_s))
    assert all(word in question for word in words)
    assert ("gap_s" in question) == ("gap_s" in words)


@pytest.mark.parametrize(
    ("factor", "question"),
    [
        (0.9e-3, "time_s: 1.111e+05 samples a second over 0.00719 s in every run; is s taken for"),
        (1e3, "time_s: 0.1 samples a second over 7.99e+03 s in every run; is ms taken for s,"),
        (1.0, None),
    ],
)
def test_a_time_in_another_unit_is_asked_about(tmp_path, factor, question):
    found = questions(tmp_path, time_s=factor * TIME, motor_angle_rad=WAVE)
    assert len(found) == (question is not None)
    assert all(one.startswith(question) for one in found)


def test_the_same_question_about_several_runs_is_asked_once(tmp_path):
    for number in range(3):
        gap = np.where(TIME > 4, TIME + 1 + number, TIME)
        text_table(tmp_path / f"run{number}.csv", {"time_s": gap, "motor_angle_rad": WAVE})
    (question,) = asked(tmp_path)
    assert question.startswith("run0: 1 gap in time, the longest of 1.01 s;")
    assert question.endswith("(2 others alike)")


def test_a_velocity_that_contradicts_its_angle_is_asked(tmp_path):
    columns = {"motor_angle_rad": WAVE, "motor_velocity_rad_s": 20 * np.cos(2 * TIME)}
    (question,) = questions(tmp_path, time_s=TIME, **columns)
    assert "motor_velocity_rad_s" in question


def test_import_writes_recordings_that_open(tmp_path, said):
    table = text_table(tmp_path / "bench.csv", {"t": 1e3 * TIME, "q": np.degrees(WAVE)})
    columns = "--column time_s=t:ms --column motor_angle_rad=q:deg --runs lap_s=4"
    words = ("import", table, columns, "--out", tmp_path / "logs")
    assert "wrote 2 recordings" in said(*words).out
    runs = list(open_campaign(tmp_path / "logs"))
    assert [len(run) for run in runs] == [400, 400]
    np.testing.assert_allclose(runs[1]["motor_angle_rad"], WAVE[400:], atol=1e-7)
    said(*words, code=2)  # nothing recorded is overwritten


def test_a_preview_writes_nothing_and_shows_si_units(tmp_path, said):
    table = text_table(
        tmp_path / "bench.csv", {"t": 1e3 * TIME, "q": np.degrees(WAVE), "i": -0.0 * TIME}
    )
    page = tmp_path / "p.html"
    columns = "--column time_s=t:ms --column motor_angle_rad=q:deg --column motor_current_a=i:mA"
    in_si = said("import", table, columns.replace(":mA", ""), "--preview").out
    assert "-0" not in in_si.split()
    answer = said("import", table, columns, "--preview --json --plots", page)
    shown = json.loads(answer.out)["preview"]
    assert shown["first"]["motor_angle_rad"][1] == pytest.approx(WAVE[1])
    (angle, current) = shown["channels"]
    assert angle["greatest"] == pytest.approx(1.0, abs=1e-3)
    assert current["wrong"]
    assert "motor_current_a: it is constant" in answer.err
    assert "motor angle" in page.read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.csv", "p.html"]


def test_a_table_of_which_nothing_is_mapped_is_listed(tmp_path, said, answered):
    table = text_table(tmp_path / "bench.csv", {"t": 1e3 * TIME, "q [deg]": 90 * WAVE})
    printed = said("import", table, "--preview").out
    assert "Columns of bench.csv" in printed
    (row,) = [line for line in printed.splitlines() if "q [deg]" in line and "│" in line]
    assert "1.79988" in row
    assert 'time_s = "COLUMN:UNIT"' in printed
    assert f"rig machine new FILE --axis motor:rad --from {table}" in " ".join(printed.split())
    shown = answered("import", table, "--preview")
    assert shown["columns"]["t"][:2] == [0.0, 10.0]
    refused = said("import", table, "--out", tmp_path / "logs", code=5).err
    assert f"rig import {table} --preview" in " ".join(refused.split())


@pytest.mark.parametrize("names", [("trial1", "trial2"), ("trial", "reference")])
def test_structs_that_differ_in_their_number_are_proposed_as_trials(tmp_path, said, names):
    path = tmp_path / "lab.mat"
    savemat(path, {name: {"t": TIME, "q": WAVE} for name in names})
    printed = " ".join(said("import", path, "--preview").out.split())
    proposed = 'state trials = "trial*" under [data], and the columns are t, q'
    assert (proposed in printed) == (names[1] == "trial2")


def test_a_campaign_of_this_program_is_named_as_one(tmp_path, said):
    write_text_atomic(tmp_path / "campaign.json", "{}")
    err = said("import", tmp_path, "--preview", code=ExitCode.USAGE).err
    assert "a recording of this program already" in err
