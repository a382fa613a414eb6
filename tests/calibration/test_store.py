"""The calibration store: nothing is overwritten, damage is noticed, rules warn and refuse."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calibration.errors import CalibrationError
from calibration.history import changes, deviation, earlier_ones
from calibration.linear import LinearCalibration, shipped_calibration_set
from calibration.record import CalibrationRecord, Fit, RawFile, Validity, record_of_line
from calibration.rules import UnfitCalibrationError, judge, judge_range, judge_raw, refuse_errors
from calibration.store import CalibrationStore, StoreError, active_lines, compose, default_folder

MADE = datetime(2026, 3, 1, 12, tzinfo=UTC)
LINE = LinearCalibration("proximal_torque_n_m", "proximal", 4e-5, 12.0, "certificate 1", True)


NOW = MADE.isoformat()


def line_record(**changes):
    record = record_of_line(LINE, kind="certificate", made_at=NOW, operator="Ada Bench")
    return replace(record, **changes)


@pytest.fixture
def store(tmp_path):
    return CalibrationStore(tmp_path / "store")


@pytest.fixture
def chosen(store):
    """Add a record and make it the active one; return its hash."""
    return lambda by="Ada", **changes: (
        store.use(store.add(line_record(**changes)), NOW, by).content_hash
    )


@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=4),
    st.text(st.characters(codec="utf-8"), max_size=20),
)
def test_a_record_survives_a_round_trip(coefficients, notes):
    parameters = {f"c{k}": value for k, value in enumerate(coefficients)}
    fit = Fit("polynomial", parameters, np.eye(len(parameters)), 0.1, 9)
    more = {"raw": (RawFile("a.mcap", "00"),), "validity": Validity(0.0, 1.0, 30.0)}
    record = line_record(fit=fit, notes=notes, **more)
    again = CalibrationRecord.from_json(record.to_json())
    assert again == record
    assert again.content_hash == record.content_hash


def test_a_record_is_found_by_the_beginning_of_its_hash(store):
    digest = store.add(line_record())
    assert store.get(digest[:6]) == line_record()
    assert store.add(line_record()) == digest
    assert len(store.records()) == 1
    other = "0" if digest[0] != "0" else "1"
    with pytest.raises(StoreError, match="No record"):
        store.get(other)


def test_no_file_changes_once_it_is_there(store, chosen):
    first = chosen()
    before = {p: p.read_bytes() for p in store.folder.rglob("*.json")}
    second = chosen(operator="Bob")
    chosen()
    assert all(path.read_bytes() == text for path, text in before.items())
    assert [choice.record for choice in store.choices()] == [first, second, first]
    assert [r.content_hash for r in store.active().values()] == [first]
    assert not list(store.folder.rglob(".new-*"))


def test_two_people_who_choose_at_once_both_have_their_choice_kept(store, chosen, monkeypatch):
    chosen("Ada")
    # Bob looked before Ada's choice was there, so he tries the number she took
    monkeypatch.setattr(store, "_choice_paths", list)
    chosen("Bob")
    monkeypatch.undo()
    assert [choice.by for choice in store.choices()] == ["Ada", "Bob"]


def test_a_record_that_was_edited_is_refused(store, chosen):
    digest = chosen()
    (path,) = (store.folder / "records").iterdir()
    path.chmod(0o644)
    path.write_text(path.read_text().replace("Ada", "Eve"))
    with pytest.raises(StoreError, match="changed after it was made"):
        store.get(digest)


def test_half_a_record_is_never_there(store, monkeypatch):
    monkeypatch.setattr("calibration.store.os.fsync", Mock(side_effect=OSError("disk full")))
    with pytest.raises(StoreError, match="disk full"):
        store.add(line_record())
    assert list((store.folder / "records").iterdir()) == []


def test_the_store_is_in_the_own_folder_unless_another_is_named(monkeypatch):
    own = Path.home() / ".config"
    for named, base, folder in (("", "", own), ("", "/c", Path("/c")), ("/s", "/c", None)):
        monkeypatch.setenv("RIG_CALIBRATIONS", named)
        monkeypatch.setenv("XDG_CONFIG_HOME", base)
        assert default_folder() == (folder / "rig/calibrations" if folder else Path(named))


def test_active_lines_take_the_place_of_the_sets_own(store, chosen):
    base = shipped_calibration_set("reference")
    assert compose(base, active_lines(store).values()) is base
    digest = chosen()
    composed = compose(base, active_lines(store).values())
    line = composed.channels["proximal_torque_n_m"]
    assert (line.slope, line.zero_counts, line.tared) == (4e-5, 12.0, True)
    assert digest in line.source
    assert composed.content_hash != base.content_hash
    assert composed.channels.keys() == base.channels.keys()


def test_a_record_of_this_instrument_goes_before_one_of_any(store, chosen):
    for instrument in ("", "S1", "S2"):
        chosen(instrument=instrument)
    assert active_lines(store, "S1")["proximal_torque_n_m"].instrument == "S1"
    assert active_lines(store, "S9")["proximal_torque_n_m"].instrument == ""


def test_a_record_that_reads_another_field_is_not_composed():
    with pytest.raises(CalibrationError, match="reads 'proximal'"):
        compose(shipped_calibration_set("reference"), [line_record(input="distal")])


def rules(verdicts):
    return [(v.rule, v.is_error) for v in verdicts]


@pytest.mark.parametrize(
    ("days", "expected"),
    [(29, []), (31, [("stale", False)]), (61, [("stale", True)]), (-1, [("future", True)])],
)
def test_age(days, expected):
    record = line_record(validity=Validity(days=30.0))
    assert rules(judge(record, MADE + timedelta(days=days))) == expected


def test_a_foreign_serial_is_refused_and_an_unknown_one_is_reported():
    record = line_record(serials={"proximal_sensor": "F7"})
    assert judge(record, MADE, {"proximal_sensor": "F7"}) == []
    unknown = judge(record, MADE, {})
    assert rules(unknown) == [("unknown_serial", False)]
    assert refuse_errors(unknown) == unknown
    foreign = judge(record, MADE, {"proximal_sensor": "F8"})
    with pytest.raises(UnfitCalibrationError, match="here is F8"):
        refuse_errors(foreign)


def test_out_of_range_is_a_warning_for_a_line_and_an_error_for_a_polynomial():
    line = line_record(validity=Validity(-10.0, 10.0))
    assert judge_range(line, [-10.0, 0.0, 10.0]) == []
    assert rules(judge_range(line, [11.0])) == [("out_of_range", False)]
    curve = replace(line, fit=Fit("polynomial", {"c0": 0.0}))
    assert rules(judge_range(curve, [0.0, np.nan])) == [("out_of_range", True)]


def test_raw_files_that_changed_are_noticed(tmp_path):
    raw = tmp_path / "weights.csv"
    raw.write_text("1,2\n")
    record = line_record(raw=(RawFile.of(raw),))
    assert judge_raw(record) == []
    raw.write_text("1,3\n")
    assert rules(judge_raw(record)) == [("raw_changed", True)]
    raw.unlink()
    assert rules(judge_raw(record)) == [("raw_missing", False)]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line_record(operator=" "), "who made it"),
        (lambda: line_record(made_at="2026-03-01T12:00:00"), "offset from UTC"),
        (lambda: line_record(made_at="yesterday"), "not a date"),
        (lambda: line_record(kind="../etc"), "file name"),
        (lambda: CalibrationRecord.from_json('{"kind": "torque"}'), "not a calibration record"),
        (lambda: Fit("line", {"slope": 1.0, "zero": 0.0}, ((1.0,),)), "2 x 2"),
    ],
)
def test_a_record_that_cannot_stand_is_refused(make, message):
    with pytest.raises(CalibrationError, match=message):
        make()


def on_day(day: int, slope: float = 1.0, **other) -> CalibrationRecord:
    fit = Fit("line", {"slope": slope, "zero": 100.0 * day}, ((1e-4, 0.0), (0.0, 1.0)))
    return line_record(made_at=f"2026-01-{day:02d}T00:00:00+00:00", **{"fit": fit, **other})


def test_the_latest_five_of_the_same_sensor_are_compared():
    stored = [on_day(day) for day in range(1, 9)]
    names = ({"channel": "distal_torque_n_m"}, {"instrument": "0042"}, {"kind": "torque"})
    others = [*(on_day(3, **name) for name in names), on_day(20)]
    found = earlier_ones(stored[-1], [*stored, *others])
    assert [one.made.day for one in found] == [7, 6, 5, 4, 3]


@pytest.mark.parametrize(("slope", "drifted"), [(1.0, False), (1.02, False), (1.05, True)])
def test_a_change_beyond_both_uncertainties_is_a_drift(slope, drifted):
    (change,) = changes(on_day(1), on_day(2, slope))
    assert change.parameter == "slope"
    assert change.drifted is drifted
    assert change.uncertainty == pytest.approx(2 * 0.01 * 2**0.5)


def test_a_zero_counts_if_it_is_not_measured_again_and_a_drift_if_its_uncertainty_is_known():
    found = changes(on_day(1, tared=False), on_day(2, tared=False))
    assert [change.parameter for change in found] == ["slope", "zero"]
    (change,) = changes(on_day(1, fit=Fit("line", {"slope": 5.0, "zero": 0.0})), on_day(2))
    assert (change.normalised_error, change.drifted) == (None, False)


def test_a_stored_record_keeps_the_uncertainty_of_each_parameter(store):
    fit = Fit("current", {"slope": 1.0, "friction": 2.0}, ((0.25, 0.1), (0.1, 4.0)))
    kept = store.get(store.add(on_day(1, fit=fit)))
    assert [deviation(kept, name) for name in ("slope", "friction")] == [0.5, 2.0]
