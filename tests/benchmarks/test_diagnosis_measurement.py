"""The measurement of the diagnosis: cases give nothing away, scoring is strict, lines are kept."""

from typing import Any

import pytest

from benchmarks.diagnosis.measure import Row
from benchmarks.diagnosis.own import CHAINS, CLEAN, Answer, draw, plans_of, record, truth_of
from benchmarks.diagnosis.page import Measured, append
from benchmarks.diagnosis.scoring import judge, judge_next, outcome
from benchmarks.diagnosis.truths import CATALOGUED, NOT_HIDDEN, TRUTHS
from estimation.derived import zero_phase_channels
from estimation.effects import families
from rig.log.convert import run_info
from rig.simulation.hidden import NAMES, HiddenEffect

pytestmark = pytest.mark.integration

RUNS = [plan.name for plan in plans_of("usual")]


def finding(verdict: str, family: str, balance: str = "motor", **more: Any) -> dict[str, Any]:
    base: dict[str, Any] = {"also_in": [], "alternatives": [], "depends_on": [], "confidence": None}
    return base | {"verdict": verdict, "family": family, "balance": balance} | more


def said(*findings: dict[str, Any], following: object = None) -> dict[str, Any]:
    return {"findings": list(findings), "next_experiment": following}


def hidden(kind, *names, either=(), runs=(0,)):
    effects = tuple(HiddenEffect(name) for name in names)
    return truth_of(Answer("case-x", kind, effects, runs, either=either))


def test_every_hidden_effect_has_an_answer():
    assert set(TRUTHS) == set(NAMES)


def test_every_family_is_hidden_in_some_case_or_cannot_be():
    hidden_ = {truth.family for truth in CATALOGUED.values()}
    assert not hidden_ & NOT_HIDDEN.keys()
    assert hidden_ | NOT_HIDDEN.keys() == set(families())


def test_what_comes_or_fades_does_so_from_run_to_run():
    wear = Answer("case-x", "strong", (HiddenEffect("gear_wear"),), (7, 8, 9))
    assert (wear.in_run(6), wear.in_run(8)) == ((), wear.effects)
    stiff = Answer("case-x", "strong", (HiddenEffect("cable_stiff"),), tuple(range(14)))
    strengths = [stiff.in_run(index)[0].strength for index in (0, 4, 12)]
    assert strengths == pytest.approx([1.0, 0.5, 0.25])


@pytest.mark.parametrize("number", range(len(CLEAN)))
def test_a_recording_gives_nothing_away(number):
    answer = draw("clean", number, 1)
    assert (answer.chain, answer.excitation) == CLEAN[number]
    (recording,) = record(answer, plans_of(answer.excitation)[:1])
    assert 13.0 < recording.duration_s < 15.0
    assert len(zero_phase_channels(recording, ["motor_velocity_rad_s"])) == len(recording)
    assert ("wrist_pitch_rad" in recording) == (CLEAN[number][1] == "wrist")
    said = repr(run_info(recording))
    assert not [word for word in (*CHAINS[1:], *NAMES, "clean") if word in said]


SCORED = """
clean | | nothing found
clean | something_missing unknown | false finding
strong motor_ripple | | nothing found
strong motor_ripple | identified ripple.motor | right name
strong motor_ripple | identified ripple.motor stretch | wrong name
strong motor_ripple | identified ripple.motor; identified friction.drag | wrong name
weak motor_ripple | one_of ripple.current motor ripple.motor | one of
strong torque_constant_sag | identified sensor.gain_nonlinear | right name
pair motor_ripple gear_backlash | identified ripple.motor | nothing found
outside jaw_detent | depends_on unknown cable spindle_angle | depends on
outside jaw_detent | depends_on unknown cable jaw_angle,time | something missing
outside cable_load_notch | identified friction.position cable | wrong name
confounded gear_load_friction | identified friction.load | wrong name
confounded gear_load_friction | one_of friction.load motor friction.position | something missing
confounded gear_load_friction | one_of friction.load motor friction.position + | one of
"""
"""Kind and hidden effects; the findings, each with its verdict, family, equation and what else is
named; the score. A plus is a proposed experiment."""


@pytest.mark.parametrize("row", SCORED.strip().splitlines())
def test_an_answer_is_scored(row):
    true, answer, result = (part.strip() for part in row.split("|"))
    kind, *names = true.split()
    either = ("friction.load", "friction.position") if kind == "confounded" else ()
    truth = hidden(kind, *names, either=either)
    findings = []
    for words in filter(None, (part.removesuffix("+").split() for part in answer.split(";"))):
        others = {"one_of": "alternatives", "depends_on": "depends_on"}.get(words[0])
        named = {others: words[3].split(",")} if others else {}
        findings.append(finding(*words[:3], **named))
    report = said(*findings, following={"protocol": "x"} if "+" in answer else None)
    assert outcome(truth, report) == result
    best = {"clean": "nothing found", "outside": "depends on", "confounded": "one of"}
    assert judge(truth, report).right == (result == best.get(truth.kind, "right name"))


def test_a_wrong_name_is_sure_from_nine_tenths_on():
    answer = hidden("strong", "motor_ripple")
    true = finding("identified", "ripple.motor", confidence=0.99)
    for confidence in (0.89, 0.9):
        wrong = finding("identified", "friction.drag", confidence=confidence)
        judged = judge(answer, said(true, wrong))
        assert (judged.right, judged.extra) == (False, 1)
        assert judged.sure_and_wrong == (confidence >= 0.9)


def test_an_effect_of_some_runs_needs_the_runs_but_for_one():
    answer = hidden("some_runs", "motor_ripple", runs=(1, 2, 3, 4, 5))
    for affected, right in (
        ([1, 2, 3, 4, 5], True),
        ([1, 2, 3, 4], True),
        ([1, 2, 3, 8, 9], False),
    ):
        found = finding("identified", "ripple.motor", runs_affected=[RUNS[k] for k in affected])
        assert judge(answer, said(found)).right == right


def test_a_confounded_case_is_solved_by_the_single_true_name():
    answer = hidden(
        "confounded", "gear_load_friction", either=("friction.load", "motor.saturation")
    )
    assert judge_next(answer, said(finding("identified", "friction.load"))).right
    both = finding("one_of", "friction.load", alternatives=["motor.saturation"])
    assert not judge_next(answer, said(both)).right


def test_a_judging_seed_is_seen_when_another_version_had_it_from_the_same_generator(tmp_path):
    page = tmp_path / "page.md"
    row = Row("clean-0", "clean", True, False, 0, [], None, None, 1.0, 1.0, False, "")
    for version, generator in (("a1", "varied"), ("b2", "strangers"), ("c3", "varied")):
        append(page, Measured(version, generator, 2_000_000), [row])
    lines = [line.split(" | ") for line in page.read_text().splitlines() if "2000000" in line]
    assert [cells[4] for cells in lines] == ["judge", "judge", "seen"]
