"""The blind study itself: cases give nothing away, scoring is strict, a study resumes."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from estimation.derived import zero_phase_channels
from estimation.diagnosis.candidate import FAMILIES
from rig.importers.registry import open_campaign
from rig.log.reader import read_log
from rig.simulation.hidden import NAMES, HiddenEffect
from tests.blind import baselines
from tests.blind.excitation import EXCITATIONS
from tests.blind.generate import CHAINS, CLASSES, CONTROLS, Answer, draw, record, write
from tests.blind.run import _ratio, blind
from tests.blind.score import outcome, right, wilson
from tests.blind.strength import shown
from tests.blind.true_structure import told, true_rmse
from tests.blind.truths import CATALOGUED, NOT_HIDDEN, TRUTHS

FAKE = """
import json, pathlib, sys
case, out = map(pathlib.Path, sys.argv[1:])
assert sorted(p.suffix for p in case.iterdir()) == [".mcap"], "logs only"
with (out.parent / "asked.txt").open("a") as log:
    print(case.name, file=log)
runs = {"discover": [], "confirm": []}
answer = {"findings": [], "next_experiment": None, "runs": runs, "rmse_after": {}}
pathlib.Path(out).write_text(json.dumps(answer))
"""


def finding(verdict: str, family: str, balance: str = "motor", **more: Any) -> dict[str, Any]:
    base: dict[str, Any] = {"also_in": [], "alternatives": [], "depends_on": []}
    return base | {"verdict": verdict, "family": family, "balance": balance} | more


def said(*findings: dict[str, Any], following: object = None) -> dict[str, Any]:
    return {"findings": list(findings), "next_experiment": following}


def hidden(kind: str, *names: str, either: tuple[str, ...] = ()) -> Answer:
    return Answer("case-x", kind, tuple(HiddenEffect(n) for n in names), (0,), either=either)


def test_every_hidden_effect_has_an_answer() -> None:
    assert set(TRUTHS) == set(NAMES)


def test_every_family_is_hidden_in_some_case_or_cannot_be() -> None:
    hidden_ = {truth.family for truth in CATALOGUED.values()}
    assert not hidden_ & NOT_HIDDEN.keys()
    assert hidden_ | NOT_HIDDEN.keys() == set(FAMILIES)


@pytest.mark.parametrize("name", ["torque_lag", "jaw_weight", "gear_wear", "cable_dwell"])
def test_a_strong_effect_is_a_clear_share_of_what_is_left(name: str) -> None:
    assert max(one.share for one in shown(name, range(1, 14, 4))) > 0.25


def test_what_comes_or_fades_does_so_from_run_to_run() -> None:
    wear = Answer("case-x", "strong", (HiddenEffect("gear_wear"),), (7, 8, 9))
    assert (wear.in_run(6), wear.in_run(8)) == ((), wear.effects)
    stiff = Answer("case-x", "strong", (HiddenEffect("cable_stiff"),), tuple(range(14)))
    strengths = [stiff.in_run(index)[0].strength for index in (0, 4, 12)]
    assert strengths == pytest.approx([1.0, 0.5, 0.25])


@pytest.mark.parametrize("kind", CLASSES)
def test_a_draw_is_seeded_and_its_name_gives_nothing_away(kind: str) -> None:
    drawn = [draw(kind, number, 7) for number in range(30)]
    assert drawn == [draw(kind, number, 7) for number in range(30)]
    assert len({answer.case for answer in drawn}) == 30
    assert all(kind not in answer.case for answer in drawn)
    assert all(a.excitation in EXCITATIONS and len(a.runs) > 0 for a in drawn)
    assert all(len(a.effects) == {"pair": 2, "control": 0}.get(kind, 1) for a in drawn)


def test_weak_cases_have_a_third_of_the_strength() -> None:
    def strengths(kind: str) -> list[float]:
        effects = [draw(kind, k, 1).effects[0] for k in range(60)]
        return [effect.strength / TRUTHS[effect.name].scale for effect in effects]

    assert np.mean(strengths("weak")) == pytest.approx(0.3 * np.mean(strengths("strong")), rel=0.1)


@pytest.mark.parametrize("number", range(len(CONTROLS)))
def test_a_case_is_a_folder_of_logs_and_the_answer_lies_elsewhere(
    tmp_path: Path, number: int
) -> None:
    answer = draw("control", number, 1)
    folder = write(answer, tmp_path / "cases", tmp_path / "answers", runs=1)
    assert [path.suffix for path in folder.iterdir()] == [".mcap"]
    kept = json.loads((tmp_path / "answers" / f"{answer.case}.json").read_text())
    assert (kept["chain"], kept["excitation"]) == CONTROLS[number]
    (recording,) = open_campaign(folder)
    assert 13.0 < recording.duration_s < 15.0
    assert len(zero_phase_channels(recording, ["motor_velocity_rad_s"])) == len(recording)
    assert ("wrist_pitch_rad" in recording) == (CONTROLS[number][1] == "wrist")
    for text in (recording.source, recording.notes, recording.rig):
        assert not any(word in text for word in CHAINS[1:])


def test_a_hidden_effect_is_in_the_runs_that_have_it_only(tmp_path: Path) -> None:
    effect = (HiddenEffect("cable_growing_friction", 2.0),)
    torque = []
    for runs in ((), (0,)):
        answer = Answer("case-00000000ab", "partial", effect, runs)
        folder = write(answer, tmp_path / str(len(runs)), tmp_path / "answers", runs=2)
        for path in folder.iterdir():
            log = read_log(path)
            told_ = [dict(log.run.conditions), log.run.notes, log.run.source, dict(log.run.details)]
            words = json.dumps(told_) + "".join(a.data.decode() for a in log.attachments)
            assert not [name for name in NAMES if name in words]
        torque.append([recording["proximal_torque_n_m"] for recording in open_campaign(folder)])
    assert np.std(torque[1][0] - torque[0][0]) > 1e-3
    assert np.array_equal(torque[1][1], torque[0][1])


@pytest.mark.parametrize(
    ("answer", "diagnosis", "result"),
    [
        (hidden("control"), said(), "nothing found"),
        (hidden("control"), said(finding("something_missing", "unknown")), "false finding"),
        (hidden("strong", "motor_ripple"), None, "failed"),
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
def test_a_diagnosis_is_scored(
    answer: Answer, diagnosis: dict[str, Any] | None, result: str
) -> None:
    assert outcome(answer, diagnosis) == result
    best = {"control": "nothing found", "outside": "depends on", "confounded": "one of"}
    assert right(answer, result) == (result == best.get(answer.kind, "right name"))


def test_wilsons_interval_is_the_published_one() -> None:
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(0, 100)[0] == 0.0


def test_a_study_scores_reports_and_resumes(tmp_path: Path) -> None:
    fake = tmp_path / "fake.py"
    fake.write_text(FAKE)
    app = typer.Typer()
    app.command()(blind)
    out, report = tmp_path / "study", tmp_path / "blind.md"

    def study(counts: str) -> dict[str, Any]:
        words = ["--out", str(out), "--counts", counts, "--runs", "1", "--report", str(report)]
        words += ["--command", f"{sys.executable} {fake} {{case}} {{out}}", "--json"]
        result = CliRunner().invoke(app, words, catch_exceptions=False)
        assert result.exit_code == 0
        return dict(json.loads(result.stdout)["results"])

    assert study("control=1")["control/0"]["outcome"] == "nothing found"
    both = study("control=1,strong=1")
    assert both["strong/0"]["outcome"] == "nothing found"
    assert not both["strong/0"]["right"]
    assert len((out / "asked.txt").read_text().split()) == 2  # the first was not asked again
    assert not any((out / "cases").iterdir())
    text = report.read_text()
    assert "| control | 1 | 1/1 (21-100 %) | 0/1 (0-79 %) |" in text
    assert "seed 1" in text


def test_textbook_methods_find_a_plain_effect_and_a_true_sum_of_squares() -> None:
    random = np.random.default_rng(0)
    declared, clear, idle = (random.standard_normal((4000, 1)) for _ in range(3))
    noise = 0.1 * random.standard_normal(4000)
    target = declared[:, 0] + 0.5 * clear[:, 0] + noise
    given = baselines.Library.of(target, declared, [("clear", clear), ("idle", idle)])
    for name, method in baselines.METHODS.items():
        assert method(given) == ["clear"], name
    _, squares, *_ = np.linalg.lstsq(declared, target)
    assert given.target @ given.target == pytest.approx(squares[0])


@pytest.mark.parametrize(
    ("name", "balance"),
    [("gear_stribeck", "motor"), ("proximal_bend", "gearbox"), ("wrist_pull", "stretch")],
)
def test_the_true_structure_leaves_what_a_rig_without_the_effect_does(
    name: str, balance: str
) -> None:
    truth = TRUTHS[name]
    places = range(1, 14, 3)
    effects = (HiddenEffect(name, truth.scale),)
    hiding = Answer("case-00000000ab", "strong", effects, tuple(range(14)), truth.needs)
    plain = replace(hiding, effects=())
    assert told(hiding, balance)

    def left(told_: Answer, played: Answer) -> float:
        recordings = list(record(played, places))
        return true_rmse(told_, balance, recordings, [r.name for r in recordings[::2]])

    true, clean, declared = left(hiding, hiding), left(plain, plain), left(plain, hiding)
    assert true == pytest.approx(clean, rel=0.3)
    assert true < 0.7 * declared


def test_the_error_is_held_against_the_true_structure_of_named_cases_only(tmp_path: Path) -> None:
    answer = replace(hidden("strong", "gear_backlash"), case="case-00000000ab")
    folder = write(answer, tmp_path / "cases", tmp_path / "answers", runs=1)
    nothing = said() | {"runs": {"discover": [], "confirm": []}}
    assert _ratio(folder, answer, nothing) is None
    untold = said(finding("identified", "transmission.backlash", "gearbox"))
    assert _ratio(folder, answer, nothing | untold) is None
