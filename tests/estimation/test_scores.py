"""Error measures."""

import numpy as np
import pytest

from estimation.scores import ScoreError, rmse, score


def test_scores_of_a_small_example():
    found = score([1.0, 2.0, 3.0, 5.0], [1.0, 2.0, 4.0, 4.0])
    assert (found.samples, found.mae, found.rmse) == (4, 0.5, pytest.approx(np.sqrt(0.5)))
    assert found.p95 == 1.0
    assert found.pearson_r == pytest.approx(np.corrcoef([1, 2, 3, 5], [1, 2, 4, 4])[0, 1])
    assert rmse([1.0, 3.0], [0.0, 3.0]) == pytest.approx(np.sqrt(0.5))


def test_rank_correlation_sees_order_only():
    x = np.linspace(0, 3, 50)
    found = score(np.exp(x), x)
    assert found.spearman_rho == pytest.approx(1.0)
    assert found.pearson_r < 0.95


def test_a_constant_estimate_has_no_correlation():
    found = score([2.0, 2.0], [1.0, 3.0])
    assert np.isnan(found.pearson_r)
    assert np.isnan(found.spearman_rho)
    assert found.mae == 1.0


@pytest.mark.parametrize(("estimate", "truth"), [([1.0], [1.0, 2.0]), ([], []), ([np.nan], [1.0])])
def test_what_cannot_be_scored_is_refused(estimate, truth):
    with pytest.raises(ScoreError):
        score(estimate, truth)
