"""Every kind of estimator goes through the one interface, on runs it was not fitted on."""

import pytest

from estimation.campaign import Campaign
from rig.studies.oneill import kinds as oneill_kinds
from rig.studies.oneill import page as shown
from rig.studies.oneill.kinds import FILTERS, recipes, run_kinds
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        cheap = {kind: recipe for kind, recipe in recipes().items() if "network" not in kind}
        patch.setattr(oneill_kinds, "recipes", lambda: cheap)
        patch.setattr(oneill_kinds, "FOLDS", 2)
        done: list[tuple[int, int]] = []
        found = run_kinds(
            Campaign.of(campaign()), {}, on_fit=lambda k, total: done.append((k, total))
        )
    assert done[-1] == (2 * len(cheap), 2 * len(cheap))
    return found


def test_each_kind_is_scored_without_lag_and_live(rows):
    assert len({(row.kind, row.filters) for row in rows}) == len(rows)
    assert {row.filters for row in rows} == set(FILTERS)
    assert len({row.score.samples for row in rows}) == 1


def test_physics_is_better_than_a_straight_line(rows):
    by = {row.kind: row.score.rmse for row in rows if row.filters == "zero-phase"}
    assert by["products of physical states"] < by["straight line"]


def test_the_table_has_a_row_for_each_kind(rows):
    table = shown.kinds_table(rows)
    assert [len(row) for row in table.rows] == [3] * len({row.kind for row in rows})
