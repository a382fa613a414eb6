"""The rows of physical states: what is held out, what is claimed, what is shown."""

from dataclasses import replace

import numpy as np
import pytest

from estimation.campaign import Campaign
from rig.studies.oneill import goals
from rig.studies.oneill import states as oneill_states
from rig.studies.oneill import states_page as shown
from rig.studies.oneill.paper import DISTAL, JAW, PROXIMAL
from rig.studies.oneill.state_rows import StateJob, ablated
from rig.studies.oneill.states import run_states
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.long

EFFECT = "load of the last 0.5 s"


@pytest.fixture(scope="module")
def study():
    runs = [
        run.with_columns(**{JAW: 1.2 + run["spindle_angle_rad"] - run[DISTAL] / 2})
        for run in campaign()
    ]
    with pytest.MonkeyPatch.context() as patch:
        kinds = [StateJob("neutral", "current", PROXIMAL, protocol=p) for p in ("run-wise", "lofo")]
        kinds += [replace(kind, filters="live") for kind in kinds]
        kinds += [StateJob("neutral", "command", t, without=e)
                  for e in ("", EFFECT) for t in (PROXIMAL, DISTAL, JAW)]  # fmt: skip
        patch.setattr(oneill_states, "jobs", lambda poses: kinds)
        done: list[tuple[int, int]] = []
        found = run_states(
            Campaign.of(runs), {}, None, on_row=lambda k, total: done.append((k, total))
        )
    assert done[-1] == (len(kinds), len(kinds))
    return found


def test_every_run_is_held_out_once_and_the_claims_are_shares(study):
    for row in study.rows:
        assert row.runs == 9
        assert 0 <= row.covered_worst <= row.covered_median <= 1
        low, high = row.covered_between
        assert row.covered_worst <= low <= row.covered <= high <= 1
        assert 0 <= row.inside <= 1
        assert row.run_offset <= row.score.rmse * 1.5


def test_an_unseen_frequency_is_harder_than_an_unseen_run(study):
    by = {r.job.protocol: r for r in study.rows if r.job.surrogate == "current"}
    assert by["lofo"].score.rmse > by["run-wise"].score.rmse
    assert by["lofo"].inside < by["run-wise"].inside  # its speed was never fitted


def test_what_an_effect_brings_is_seen_by_leaving_it_out(study):
    rows = ablated(study.rows, PROXIMAL)
    assert set(rows) == {"", EFFECT}
    assert rows[""].score.rmse < rows[EFFECT].score.rmse


def test_the_tables_hold_the_rows(study):
    errors, levels, intervals, ablation = shown.tables(study)
    assert len(errors.rows) == 5  # three by command, two by current; frequencies in a column
    assert len(levels.rows) == 1
    assert len(intervals.rows) == 7
    assert [row[0] for row in ablation.rows] == ["nothing", EFFECT]
    assert any("No data of experiment 3, pitch" in note for note in shown.notes(study))
    numbers = np.array([[float(cell) for cell in row[1:]] for row in ablation.rows])
    assert np.isfinite(numbers).all()


def test_levels_left_out_add_up_to_the_row(study):
    (row,) = [r for r in study.rows if r.levels and r.job.filters == "live"]
    assert [level.value for level in row.levels] == sorted({level.value for level in row.levels})
    assert sum(level.samples for level in row.levels) == row.score.samples
    square = sum(level.samples * level.rmse**2 for level in row.levels) / row.score.samples
    assert square**0.5 == pytest.approx(row.score.rmse)
    inside = sum(level.samples * level.covered for level in row.levels) / row.score.samples
    assert inside == pytest.approx(row.covered)


def test_what_is_missed_is_said_with_its_size(study):
    (found,) = goals.reached(study, None)
    worse = replace(found.live, score=replace(found.live.score, rmse=3.3e-3))
    known = replace(found.without_lag, score=replace(found.live.score, rmse=2.9e-3))
    far = replace(worse, score=replace(worse.score, rmse=4.2e-3))
    late = goals.Reached(worse, known, {"lofo": far}, None)
    assert late.missed == ["live by 10.0%", "unseen frequency, +27.3%"]
    good = goals.Reached(known, known, {}, 6.9e-3)
    assert good.missed == []
    reached, told, intervals = goals.lead([late, good])
    assert "3.30 mN m in proximal torque" in reached
    assert "2.90 mN m (6.90) in proximal torque" in reached
    assert "of 2 estimates" in intervals
    assert told.startswith("Missed goals: neutral: proximal torque")
    assert [row[-1] for row in goals.table([late, good]).rows][1] == "nothing"


def test_the_planned_rows_hold_command_and_current_without_lag_and_live():
    planned = oneill_states.jobs(("neutral", "pitch"))
    assert {(j.surrogate, j.filters, j.protocol) for j in planned} >= {
        (s, f, p)
        for s in ("command", "current")
        for f in ("zero-phase", "live")
        for p in ("run-wise", "lofo", "lopo")
    }
    assert len(set(planned)) == len(planned)
    assert {j.pose for j in planned} == {"neutral", "pitch"}
