"""What earlier diagnoses leave: the runs that they used, and how long they took."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from estimation.diagnosis.split import split
from rig.diagnosis.durations import add, expected, work_of
from rig.diagnosis.ledger import Ledger, LedgerError, look_at
from rig.diagnosis.subject import subject
from rig.output.console import time_left
from tests.estimation.synthetic import runs

STAGES = ("reading", "searching", "opening")
FIRST = runs(count=6, seconds=1.0)


@pytest.fixture
def ledger(tmp_path):
    used = Ledger(tmp_path / "looks.jsonl")
    used.enter(look_at(FIRST, split(FIRST)))
    return used


def test_runs_are_known_by_their_samples_not_by_names_and_folders(ledger):
    assert ledger.known(FIRST) == {r.name for r in FIRST}
    assert ledger.known(runs(count=6, seconds=1.0, first_seed=50)) == frozenset()
    renamed = [replace(r, name=f"round-9/{k}", source="copy") for k, r in enumerate(FIRST)]
    assert ledger.known(renamed) == {r.name for r in renamed}


def test_next_to_used_runs_only_new_ones_confirm(ledger):
    fresh = runs(count=6, seconds=1.0, first_seed=50)
    both = [*FIRST, *(replace(r, name=f"new{k}") for k, r in enumerate(fresh))]
    sealed = split(both, 0, ledger.known(both))
    assert len(sealed.confirm) == 2
    assert not {*sealed.confirm} & ledger.known(both)
    # two new runs are too few to confirm by themselves: all are split
    few = both[:8]
    assert {*split(few, 0, ledger.known(few)).confirm} & ledger.known(few)


def test_entries_of_diagnoses_that_end_at_once_are_all_kept(ledger):
    look, count = look_at(FIRST, split(FIRST)), 200
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(ledger.enter, [look] * count))
    assert len(ledger.path.read_text().splitlines()) == 1 + count


def test_a_damaged_ledger_is_reported(ledger):
    ledger.path.write_text("nonsense\n")
    with pytest.raises(LedgerError, match="cannot be read"):
        ledger.known(FIRST)


def test_the_time_left_follows_the_amount_of_data_and_shrinks(tmp_path):
    place = tmp_path / "durations.jsonl"
    assert expected(place, "motor .mcap", 1e6) == {}  # before anything was measured
    assert time_left({}, "reading", 3.0) == ""
    add(place, "motor .mcap", 1e6, dict(zip(STAGES, (1.0, 20.0, 4.0), strict=True)))
    add(place, "motor .mcap", 2e6, dict(zip(STAGES, (2.0, 60.0, 8.0), strict=True)))
    add(place, "four .mcap", 1e6, dict(zip(STAGES, (9.0, 900.0, 9.0), strict=True)))
    known = expected(place, "motor .mcap", 1e6)
    assert list(known) == list(STAGES)
    assert known["searching"] == pytest.approx((20.0, 30.0))
    assert time_left(known, "searching", 5.0) == "19 to 29 s left"
    assert time_left(known, "searching", 25.0) == "4 to 9 s left"
    assert time_left(known, "searching", 50.0) == "longer than before"
    assert time_left(known, "opening", 1.0) == "about 3 s left"
    assert time_left(known, "fitting the links", 0.0) == ""  # a stage that was not there before
    assert time_left(expected(place, "motor .mcap", 1e8), "reading", 0.0) == "42 to 58 min left"


def test_recordings_without_files_and_a_damaged_file_state_nothing(tmp_path):
    place = tmp_path / "durations.jsonl"
    add(place, "motor .mcap", 0.0, {"reading": 1.0})
    assert not place.exists()
    place.write_text("no json\n")
    assert expected(place, "motor .mcap", 1e6) == {}


def test_the_work_of_a_diagnosis_is_its_equations_format_and_bytes():
    folder = Path(__file__).parents[2] / "logs" / "example"
    kind, size = work_of(subject(folder, Path("motor")))
    assert "motor" in kind
    assert size == sum(path.stat().st_size for path in folder.glob("*.mcap"))
