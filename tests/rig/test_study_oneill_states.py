"""The rows of physical states: what is held out, what is claimed, what is shown."""

from dataclasses import replace

import numpy as np
import pytest

from rig.studies.oneill import states as oneill_states
from rig.studies.oneill import states_page as shown
from rig.studies.oneill.paper import DISTAL, JAW, PROXIMAL
from rig.studies.oneill.state_rows import StateJob
from rig.studies.oneill.states import run_states
from tests.estimation.synthetic import campaign_with_jaw

pytestmark = pytest.mark.long

EFFECT = "load of the last 0.5 s"


@pytest.fixture(scope="module")
def study():
    with pytest.MonkeyPatch.context() as patch:
        kinds = [StateJob("neutral", "current", PROXIMAL, protocol=p) for p in ("run-wise", "lofo")]
        kinds += [replace(kind, filters="live") for kind in kinds]
        kinds += [StateJob("neutral", "command", t, without=e)
                  for e in ("", EFFECT) for t in (PROXIMAL, DISTAL, JAW)]  # fmt: skip
        patch.setattr(oneill_states, "jobs", lambda poses: kinds)
        done: list[tuple[int, int]] = []
        found = run_states(
            campaign_with_jaw(), None, on_row=lambda k, total: done.append((k, total))
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


def test_the_tables_hold_the_rows(study):
    errors, levels, intervals, ablation = shown.tables(study)
    assert len(errors.rows) == 5  # three by command, two by current; frequencies in a column
    assert len(levels.rows) == 1
    assert len(intervals.rows) == 7
    assert [row[0] for row in ablation.rows] == ["nothing", EFFECT]
    assert any("No data of experiment 3, pitch" in note for note in shown.notes(study))
    numbers = np.array([[float(cell) for cell in row[1:]] for row in ablation.rows])
    assert np.isfinite(numbers).all()
