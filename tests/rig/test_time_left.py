"""The time that a diagnosis still takes, from how long its stages took before."""

from pathlib import Path

import pytest

from rig.diagnosis.durations import Durations, work_of
from rig.diagnosis.subject import subject
from rig.output.console import time_left

STAGES = ("reading", "searching", "opening")


@pytest.fixture
def known(tmp_path):
    return Durations(tmp_path / "durations.jsonl")


def test_nothing_is_stated_before_anything_was_measured(known):
    assert known.expected("motor .mcap", 1e6) == {}
    assert time_left({}, "reading", 3.0) == ""


def test_the_time_left_follows_the_amount_of_data_and_shrinks(known):
    known.add("motor .mcap", 1e6, dict(zip(STAGES, (1.0, 20.0, 4.0), strict=True)))
    known.add("motor .mcap", 2e6, dict(zip(STAGES, (2.0, 60.0, 8.0), strict=True)))
    known.add("four .mcap", 1e6, dict(zip(STAGES, (9.0, 900.0, 9.0), strict=True)))
    expected = known.expected("motor .mcap", 1e6)
    assert list(expected) == list(STAGES)
    assert expected["searching"] == pytest.approx((20.0, 30.0))
    assert time_left(expected, "searching", 5.0) == "19 to 29 s left"
    assert time_left(expected, "searching", 25.0) == "4 to 9 s left"
    assert time_left(expected, "searching", 50.0) == "longer than before"
    assert time_left(expected, "opening", 1.0) == "about 3 s left"
    assert time_left(known.expected("motor .mcap", 1e8), "reading", 0.0) == "42 to 58 min left"


def test_a_stage_that_was_not_there_before_and_a_damaged_file_state_nothing(known):
    known.add("motor .mcap", 1e6, {"reading": 1.0})
    assert time_left(known.expected("motor .mcap", 1e6), "fitting the links", 0.0) == ""
    known.add("motor .mcap", 0.0, {"reading": 1.0})  # recordings without files
    assert known.expected("motor .mcap", 0.0) == {"reading": (0.0, 0.0)}
    known.path.write_text("no json\n")
    assert known.expected("motor .mcap", 1e6) == {}


def test_the_work_of_a_diagnosis_is_its_equations_format_and_bytes():
    folder = Path(__file__).parents[2] / "logs" / "example"
    asked = subject(folder, Path("motor"))
    kind, size = work_of(asked)
    assert "motor" in kind
    assert size == sum(path.stat().st_size for path in folder.glob("*.mcap"))
