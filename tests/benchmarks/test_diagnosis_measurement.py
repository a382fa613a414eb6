"""The measurement of the diagnosis: cases give nothing away, scoring is strict, lines are kept."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from benchmarks.diagnosis import __main__ as command
from benchmarks.diagnosis import machines, otherlab, varied
from benchmarks.diagnosis.asking import Rig
from benchmarks.diagnosis.case import KINDS, Case, Judgement, write_recordings
from benchmarks.diagnosis.draw import CHAINS, CLEAN, Answer, draw, record, write_next
from benchmarks.diagnosis.excitation import EXCITATIONS, plans_of
from benchmarks.diagnosis.measure import measure
from benchmarks.diagnosis.own import truth_of
from benchmarks.diagnosis.page import Measured, append, judged_seeds
from benchmarks.diagnosis.ratio import errors_without
from benchmarks.diagnosis.scoring import Truth, judge, judge_next, outcome
from benchmarks.diagnosis.seeds import next_to_judge
from benchmarks.diagnosis.truths import CATALOGUED, NOT_HIDDEN, TRUTHS
from benchmarks.rigs import DEVELOP, JUDGE, HiddenTruth
from benchmarks.rigs import Truth as VariedTruth
from estimation.derived import zero_phase_channels
from estimation.effects import families
from estimation.recording import Recording
from rig.importers.registry import open_campaign
from rig.log.convert import run_info
from rig.simulation.hidden import NAMES, HiddenEffect

pytestmark = pytest.mark.integration

RUNS = [plan.name for plan in plans_of("usual")]


def finding(verdict: str, family: str, balance: str = "motor", **more: Any) -> dict[str, Any]:
    base: dict[str, Any] = {"also_in": [], "alternatives": [], "depends_on": [], "confidence": None}
    return base | {"verdict": verdict, "family": family, "balance": balance} | more


def said(*findings: dict[str, Any], following: object = None) -> dict[str, Any]:
    return {"findings": list(findings), "next_experiment": following}


def hidden(
    kind: str, *names: str, either: tuple[str, ...] = (), runs: tuple[int, ...] = (0,)
) -> Truth:
    effects = tuple(HiddenEffect(name) for name in names)
    return truth_of(Answer("case-x", kind, effects, runs, either=either))


def test_every_hidden_effect_has_an_answer() -> None:
    assert set(TRUTHS) == set(NAMES)


def test_every_family_is_hidden_in_some_case_or_cannot_be() -> None:
    hidden_ = {truth.family for truth in CATALOGUED.values()}
    assert not hidden_ & NOT_HIDDEN.keys()
    assert hidden_ | NOT_HIDDEN.keys() == set(families())


def test_what_comes_or_fades_does_so_from_run_to_run() -> None:
    wear = Answer("case-x", "strong", (HiddenEffect("gear_wear"),), (7, 8, 9))
    assert (wear.in_run(6), wear.in_run(8)) == ((), wear.effects)
    stiff = Answer("case-x", "strong", (HiddenEffect("cable_stiff"),), tuple(range(14)))
    strengths = [stiff.in_run(index)[0].strength for index in (0, 4, 12)]
    assert strengths == pytest.approx([1.0, 0.5, 0.25])


@pytest.mark.parametrize("kind", KINDS)
def test_a_draw_is_seeded_and_its_name_gives_nothing_away(kind: str) -> None:
    drawn = [draw(kind, number, 7) for number in range(30)]
    assert drawn == [draw(kind, number, 7) for number in range(30)]
    assert len({answer.case for answer in drawn}) == 30
    assert all(kind not in answer.case for answer in drawn)
    assert all(a.excitation in EXCITATIONS and len(a.runs) > 0 for a in drawn)
    assert all(len(a.effects) == {"pair": 2, "clean": 0}.get(kind, 1) for a in drawn)


def test_weak_cases_have_a_third_of_the_strength() -> None:
    def strengths(kind: str) -> list[float]:
        effects = [draw(kind, k, 1).effects[0] for k in range(60)]
        return [effect.strength / TRUTHS[effect.name].scale for effect in effects]

    assert np.mean(strengths("weak")) == pytest.approx(0.3 * np.mean(strengths("strong")), rel=0.1)


@pytest.mark.parametrize("number", range(len(CLEAN)))
def test_a_recording_gives_nothing_away(number: int) -> None:
    answer = draw("clean", number, 1)
    assert (answer.chain, answer.excitation) == CLEAN[number]
    (recording,) = record(answer, plans_of(answer.excitation)[:1])
    assert 13.0 < recording.duration_s < 15.0
    assert len(zero_phase_channels(recording, ["motor_velocity_rad_s"])) == len(recording)
    assert ("wrist_pitch_rad" in recording) == (CLEAN[number][1] == "wrist")
    said = repr(run_info(recording))
    assert not [word for word in (*CHAINS[1:], *NAMES, "clean") if word in said]


def test_a_hidden_effect_is_in_the_runs_that_have_it_only() -> None:
    effect = (HiddenEffect("cable_growing_friction", 2.0),)
    torque = []
    for runs in ((), (0,)):
        answer = Answer("case-00000000ab", "some_runs", effect, runs)
        made = record(answer, plans_of("usual")[:2])
        torque.append([recording["proximal_torque_n_m"] for recording in made])
    assert np.std(torque[1][0] - torque[0][0]) > 1e-3
    assert np.array_equal(torque[1][1], torque[0][1])


def test_an_error_is_held_against_the_declared_model_without_the_effect() -> None:
    answer = Answer("case-00000000ab", "strong", (HiddenEffect("motor_ripple"),), tuple(range(14)))
    plans = plans_of("usual")[::5]
    runs = {"discover": [p.name for p in plans[:2]], "confirm": [plans[2].name]}

    def left(effects: tuple[HiddenEffect, ...]) -> float:
        def write(folder: Path) -> None:
            write_recordings(folder, record(replace(answer, effects=effects), plans))

        return errors_without(write, {"runs": runs}, ["motor"])["motor"]

    assert left(answer.effects) > 1.3 * left(())


def test_a_proposed_protocol_is_played_on_the_same_rig_with_the_effect(tmp_path: Path) -> None:
    protocol = tmp_path / "next.toml"
    protocol.write_text(
        'name = "next"\ndescription = "more"\n'
        '[[runs]]\nkind = "sine"\nfrequencies_hz = [0.5]\nloads_a = [0.4]\nduration_s = 2.0\n'
    )
    torque = []
    for effects in ((), (HiddenEffect("cable_growing_friction", 2.0),)):
        folder = tmp_path / f"runs-{len(effects)}"
        folder.mkdir()
        write_next(Answer("case-00000000ab", "confounded", effects, (0,)), protocol, folder)
        (recording,) = open_campaign(folder)
        torque.append(recording["proximal_torque_n_m"])
    assert recording.name.startswith("next-")
    assert np.std(torque[1] - torque[0]) > 1e-3


@pytest.mark.parametrize(
    ("truth", "report", "result"),
    [
        (hidden("clean"), said(), "nothing found"),
        (hidden("clean"), said(finding("something_missing", "unknown")), "false finding"),
        (hidden("strong", "motor_ripple"), said(), "nothing found"),
        (
            hidden("strong", "motor_ripple"),
            said(finding("identified", "ripple.motor")),
            "right name",
        ),
        (
            hidden("strong", "motor_ripple"),
            said(finding("identified", "ripple.motor", "stretch")),
            "wrong name",
        ),
        (
            hidden("strong", "motor_ripple"),
            said(finding("identified", "ripple.motor"), finding("identified", "friction.drag")),
            "wrong name",
        ),
        (
            hidden("weak", "motor_ripple"),
            said(finding("one_of", "ripple.current", alternatives=["ripple.motor"])),
            "one of",
        ),
        (
            hidden("strong", "torque_constant_sag"),
            said(finding("identified", "sensor.gain_nonlinear")),
            "right name",
        ),
        (
            hidden("pair", "motor_ripple", "gear_backlash"),
            said(finding("identified", "ripple.motor")),
            "nothing found",
        ),
        (
            hidden("outside", "jaw_detent"),
            said(finding("depends_on", "unknown", "cable", depends_on=["spindle_angle"])),
            "depends on",
        ),
        (
            hidden("outside", "jaw_detent"),
            said(finding("depends_on", "unknown", "cable", depends_on=["jaw_angle", "time"])),
            "something missing",
        ),
        (
            hidden("outside", "cable_load_notch"),
            said(finding("identified", "friction.position", "cable")),
            "wrong name",
        ),
        (
            hidden(
                "confounded", "gear_load_friction", either=("friction.load", "friction.position")
            ),
            said(finding("identified", "friction.load")),
            "wrong name",
        ),
        (
            hidden(
                "confounded", "gear_load_friction", either=("friction.load", "friction.position")
            ),
            said(
                finding("one_of", "friction.load", alternatives=["friction.position"]),
                following={"protocol": "x"},
            ),
            "one of",
        ),
        (
            hidden(
                "confounded", "gear_load_friction", either=("friction.load", "friction.position")
            ),
            said(finding("one_of", "friction.load", alternatives=["friction.position"])),
            "something missing",
        ),
    ],
)
def test_an_answer_is_scored(truth: Truth, report: dict[str, Any], result: str) -> None:
    assert outcome(truth, report) == result
    best = {"clean": "nothing found", "outside": "depends on", "confounded": "one of"}
    assert judge(truth, report).right == (result == best.get(truth.kind, "right name"))


def test_a_wrong_name_is_sure_from_nine_tenths_on() -> None:
    answer = hidden("strong", "motor_ripple")
    true = finding("identified", "ripple.motor", confidence=0.99)
    for confidence in (0.89, 0.9):
        wrong = finding("identified", "friction.drag", confidence=confidence)
        judged = judge(answer, said(true, wrong))
        assert (judged.right, judged.extra) == (False, 1)
        assert judged.sure_and_wrong == (confidence >= 0.9)


def test_an_effect_of_some_runs_needs_the_runs_but_for_one() -> None:
    answer = hidden("some_runs", "motor_ripple", runs=(1, 2, 3, 4, 5))
    for affected, right in (
        ([1, 2, 3, 4, 5], True),
        ([1, 2, 3, 4], True),
        ([1, 2, 3, 8, 9], False),
    ):
        found = finding("identified", "ripple.motor", runs_affected=[RUNS[k] for k in affected])
        assert judge(answer, said(found)).right == right


def test_a_confounded_case_is_solved_by_the_single_true_name() -> None:
    answer = hidden(
        "confounded", "gear_load_friction", either=("friction.load", "motor.saturation")
    )
    assert judge_next(answer, said(finding("identified", "friction.load"))).right
    both = finding("one_of", "friction.load", alternatives=["motor.saturation"])
    assert not judge_next(answer, said(both)).right


FAKE = """#!{python}
import json, pathlib, sys
here = pathlib.Path(__file__).parent
if "--help" in sys.argv:
    print("  {option} <path>  Where the answer goes.   --protocol-out <path>")
    sys.exit()
case = pathlib.Path(sys.argv[2])
with (here / "asked.txt").open("a") as log:
    print(sorted(path.name for path in case.iterdir()), sys.argv[3:], file=log)
runs = {{"discover": [], "confirm": []}}
answer = {{"findings": [], "runs": runs}}
pathlib.Path(sys.argv[sys.argv.index("{option}") + 1]).write_text(json.dumps(answer))
pathlib.Path(sys.argv[sys.argv.index("--protocol-out") + 1]).write_text("a protocol")
"""


def fake_rig(folder: Path, option: str) -> Rig:
    path = folder / ".venv" / "bin" / "rig"
    path.parent.mkdir(parents=True)
    path.write_text(FAKE.format(python=sys.executable, option=option))
    path.chmod(0o755)
    return Rig(path)


def case_of(name: str, kind: str, *, right: bool | None) -> Case:
    return Case(
        name,
        kind,
        lambda folder: (folder / "run.log").touch(),
        lambda report: Judgement(right, equations=("motor",) if right else ()),
        write_next=lambda protocol, folder: (folder / "next.log").write_text(protocol.read_text()),
        judge_next=lambda report: Judgement(True),
    )


@pytest.mark.parametrize("option", ["--json", "--json-out"])
def test_any_version_of_rig_is_asked_once_for_each_answer(tmp_path: Path, option: str) -> None:
    rig = fake_rig(tmp_path / "checkout", option)
    cases = [case_of("a", "strong", right=True), case_of("b", "weak", right=False)]
    for _ in range(2):
        rows = measure(cases, rig, tmp_path / "answers", on_row=lambda row: None)
    assert [(row.right, row.ratio, row.solved) for row in rows] == [
        (True, None, True),
        (False, None, True),
    ]
    asked = (rig.path.parent / "asked.txt").read_text().splitlines()
    assert [line.split("]")[0] for line in asked] == [
        "['run.log'",
        "['next.log', 'run.log'",
        "['run.log'",
        "['next.log', 'run.log'",
    ]
    lines = (tmp_path / "answers" / "rows.jsonl").read_text().splitlines()
    assert [json.loads(line)["case"] for line in lines] == ["a", "b"]


def test_a_version_that_gives_no_answer_is_wrong_and_named_so(tmp_path: Path) -> None:
    rig = fake_rig(tmp_path / "checkout", "--json")
    rig.path.write_text(f"#!{sys.executable}\nimport sys\nsys.exit('no such model')\n")
    rig.__dict__["_help"] = "--json"
    (row,) = measure(
        [case_of("a", "clean", right=True)], rig, tmp_path / "out", on_row=lambda r: None
    )
    assert (row.failed, row.right) == (True, False)
    assert "no such model" in row.note


def test_a_line_stands_beside_those_of_other_versions(tmp_path: Path) -> None:
    rig = fake_rig(tmp_path / "checkout", "--json")
    page = tmp_path / "page.md"

    def line(version: str, seed: int | None, *, right: bool | None, kind: str = "strong") -> None:
        cases = [case_of("a", kind, right=right)]
        rows = measure(cases, rig, tmp_path / f"{version}{right}", on_row=lambda row: None)
        append(page, Measured(version, "own", seed), rows)

    line("old", 2_000_000, right=False)
    line("new", 2_000_000, right=True)
    line("old", 2_000_000, right=True)
    line("old", None, right=None, kind="machine")
    table = [
        r.split(" | ") for r in page.read_text().splitlines() if r.startswith(("| old", "| new"))
    ]
    cells = [[cell.strip("| ") for cell in row] for row in table]
    assert [(row[0], row[4], row[5]) for row in cells[:2]] == [
        ("new", "seen", "1/1"),
        ("old", "seen", "1/1"),
    ]
    assert cells[2][2:5] == ["a", "nothing missing", "-"]
    assert judged_seeds(page) == {2_000_000}


def test_a_judging_block_is_taken_once() -> None:
    spent = {JUDGE[0], JUDGE[1500], 5}
    assert next_to_judge(spent) in JUDGE
    assert next_to_judge(spent) // 1000 not in {seed // 1000 for seed in spent}


def test_a_varied_case_is_drawn_once_and_judged_by_its_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    effect = HiddenTruth(
        "gear", "unknown", ("spindle_angle", "velocity"), (0,), 3.0, "cable", "recipe", 1.0
    )
    columns = {"motor": (np.zeros((4, 1)),), "cable": (np.ones((4, 1)),)}
    truth = VariedTruth((effect,), {}, {}, {}, columns)
    stage = SimpleNamespace(plans=[SimpleNamespace(name="000-sine")])
    drawn = []

    def draw_(seed: int, kind: str, *, gear_ratio: float | None) -> SimpleNamespace:
        drawn.append((seed, kind, gear_ratio))
        return SimpleNamespace(truth=truth, stage=stage)

    monkeypatch.setattr(varied, "draw", draw_)
    for variables, equation, right in (
        (["jaw_angle", "velocity"], "cable", True),
        (["jaw_angle", "velocity"], "motor", False),
        (["jaw_angle", "load"], "cable", False),
    ):
        (case,) = varied.cases(DEVELOP[7], {"outside": 1}, tmp_path, 35.0)
        found = finding("depends_on", "unknown", equation, depends_on=variables)
        assert case.judge(said(found)).right == right
    assert drawn == [(DEVELOP[7], "outside", 35.0)]


OTHER = {
    "cases": """
ALL = [dict(name=n, kind=k, accept=["friction.load"], pair=None, balance="motor", confused=[],
            args=dict(seed=1, ea="load_friction", aa=0.1))
       for n, k in (("s-load", "single"), ("w-load", "single"), ("n-clean-0", "control"))]
""",
    "rigsim": """
import json, pathlib
def make_case(folder, **args): pathlib.Path(folder, "run.TXT").write_text(json.dumps(args))
""",
    "score": """
def judge(case, report):
    first = report["findings"][0]
    ok = first["family"] in case["accept"]
    return dict(ok=ok, extra=0, confidence=first["confidence"], why="")
""",
}


def test_cases_of_another_simulator_are_judged_by_its_own_scorer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in OTHER.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in OTHER:
        monkeypatch.delitem(sys.modules, name, raising=False)
    strong, weak, clean = otherlab.cases(tmp_path)
    assert [case.kind for case in (strong, weak, clean)] == ["strong", "weak", "clean"]
    assert clean.write_without is None
    assert strong.write_without is not None
    strong.write_without(tmp_path)
    assert json.loads((tmp_path / "run.TXT").read_text())["ea"] == "none"
    right = strong.judge(said(finding("identified", "friction.load", confidence=0.99)))
    assert (right.right, right.sure_and_wrong, right.equations) == (True, False, ("motor",))
    wrong = strong.judge(said(finding("identified", "friction.drag", confidence=0.95)))
    assert (wrong.right, wrong.sure_and_wrong, wrong.equations) == (False, True, ())


def test_a_folder_that_is_not_there_is_named_and_skipped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["--otherlab", str(tmp_path / "none"), "--rig", str(tmp_path / "a" / "b" / "rig")]
    monkeypatch.setattr(sys, "argv", ["measure", "measure", *words])
    assert command.main() == 0
    assert "there is no folder" in capsys.readouterr().err


def test_a_drive_axis_is_cut_in_laps_and_its_asymmetry_is_the_answer(tmp_path: Path) -> None:
    count = 24841
    data = {"t": np.arange(count) * 1e-3, "qm": np.linspace(0, 0.1, count), "gtau": 35.0}
    (tmp_path / "emps").mkdir()
    savemat(tmp_path / "emps" / "DATA_EMPS.mat", data | {"vir": np.ones(count)})
    cases = {case.name: case for case in machines.cases(tmp_path)}
    case = cases["emps, half laps, motor_current_a"]
    folder = tmp_path / "runs"
    folder.mkdir()
    case.write(folder)
    runs = list(open_campaign(folder))
    assert [len(run) for run in runs] == [3120] * 7 + [count - 7 * 3120]
    assert runs[-1]["carriage_position_m"][-1] == pytest.approx(0.1)
    assert runs[0]["motor_current_a"] == pytest.approx(np.full(3120, 35.0))
    rmse = {"motor": 3.5}
    report = {"runs": {"confirm": [runs[0].name]}}
    report |= {"rmse_with_means_before": rmse, "rmse_with_means_after": rmse}
    asymmetry = "friction.viscous_asymmetry"
    for found, right, sure in (
        (finding("identified", asymmetry, confidence=0.9), True, False),
        (finding("one_of", "friction.drag", alternatives=[asymmetry], confidence=0.4), True, False),
        (finding("identified", "sensor.creep", confidence=0.98), False, True),
        (finding("identified", "sensor.creep", confidence=0.4), False, False),
    ):
        judged = case.judge(report | said(found))
        assert (judged.right, judged.sure_and_wrong) == (right, sure)
        assert judged.note.startswith("10.00 -> 10.00 %")


def handed_over(folder: Path, name: str) -> list[Recording]:
    """Return the runs of the first hand-over of a machine."""
    return machines.read(folder, next(machines.MACHINES[name]()))


def test_a_servo_s_run_is_its_drive_and_what_does_not_count_is_flagged(tmp_path: Path) -> None:
    entries = [
        {
            "timestamp": 0.01 * k,
            "position": -3.14 if k == 20 else 0.1,
            "goal_position": 0.4,
            "input_volts": 12.0,
            "torque": 12.74,  # the sign bit, 10.24, and 2.5
            "temp": 30.0,
            "torque_enable": k >= 10,
        }
        for k in range(50)
    ]
    head = {"mass": 1.1682, "length": 0.1, "kp": 8, "trajectory": "sin"}
    (tmp_path / "run.json").write_text(json.dumps({**head, "entries": entries}))
    other = {**head, "mass": 0.5, "entries": entries}
    (tmp_path / "other.json").write_text(json.dumps(other))
    (run,) = handed_over(tmp_path, "sts3215")
    assert run["drive_ratio"][run.valid] == pytest.approx(np.full(run.valid.sum(), 0.25))
    assert run["motor_temperature_k"][0] == pytest.approx(303.15)
    assert not run.valid[:10].any()
    assert run.valid[11:20].all()
    assert not run.valid[20]


def test_a_grasper_s_file_is_cut_where_the_sweep_begins_again(tmp_path: Path) -> None:
    rows = [f"0,20.4,{pwm},10,3000,-500" for pwm in (30, 30, 35, 40, 30, 35, 40)]
    path = tmp_path / "Force_Calibration_05_05_2021_0.csv"
    head = "Trial,Jaw Distance (mm),PWM,Grasper Force Sensor (Counts),"
    head += "External Force Sensor (Counts),Encoder Value (Pulses)"
    path.write_text("\n".join([head, *rows]) + "\n")
    first, second = handed_over(tmp_path, "smart-grasper")
    assert (len(first), len(second)) == (4, 3)
    assert second["motor_current_a"][-1] == pytest.approx(0.4 * 40 / 255)
    assert first.conditions == {"jaw_distance_m": pytest.approx(0.0204), "date": "05_05_2021"}


def test_a_joint_s_runs_hold_both_directions(tmp_path: Path) -> None:
    time_s = np.arange(0.0, 60.0, 0.01)
    rows = np.zeros((time_s.size, 31))
    rows[:, 0], rows[:, 6] = 300.0 + time_s, np.cos(2 * np.pi * (time_s - 2.7) / 10.0)
    np.savetxt(tmp_path / "ur-joint_6.csv", rows, delimiter=",")
    runs = handed_over(tmp_path, "ur10e")
    assert len(runs) >= 7
    for run in runs:
        steps = np.diff(run["joint_6_angle_rad"])
        assert min(np.mean(steps > 0), np.mean(steps < 0)) > 0.4
