"""Error measures."""

import numpy as np
import pytest

from estimation.scores import ScoreError, rmse, score


def test_scores_of_a_small_example_and_of_a_constant_estimate():
    found = score([1.0, 2.0, 3.0, 5.0], [1.0, 2.0, 4.0, 4.0])
    assert (found.samples, found.mae, found.p95) == (4, 0.5, 1.0)
    assert found.rmse == rmse([1.0, 3.0], [0.0, 3.0]) == pytest.approx(np.sqrt(0.5))
    assert found.pearson_r == pytest.approx(np.corrcoef([1, 2, 3, 5], [1, 2, 4, 4])[0, 1])
    constant = score([2.0, 2.0], [1.0, 3.0])
    assert np.isnan([constant.pearson_r, constant.spearman_rho]).all()
    assert constant.mae == 1.0


def test_rank_correlation_sees_order_only():
    x = np.linspace(0, 3, 50)
    found = score(np.exp(x), x)
    assert found.spearman_rho == pytest.approx(1.0)
    assert found.pearson_r < 0.95


@pytest.mark.parametrize(("estimate", "truth"), [([1.0], [1.0, 2.0]), ([], []), ([np.nan], [1.0])])
def test_what_cannot_be_scored_is_refused(estimate, truth):
    with pytest.raises(ScoreError):
        score(estimate, truth)
