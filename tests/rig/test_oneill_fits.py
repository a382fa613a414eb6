"""The linear fits of O'Neill et al. 2018."""

import numpy as np
import pytest

from rig.studies.oneill import fits
from tests.estimation.synthetic import campaign

pytestmark = pytest.mark.integration


def test_fits_find_the_line():
    random = np.random.default_rng(0)
    x = random.normal(size=4000)
    y = 3.0 * x - 0.5
    y[:500] = 100.0  # the authors' fit does not see the first eighth
    line, score = fits.score_authors(x, y)
    assert (line.gain, line.offset) == pytest.approx((3.0, -0.5))
    assert (score.samples, score.rmse) == (3500, pytest.approx(0.0, abs=1e-12))
    assert fits.score(fits.fit_line(x, y)(x), y).rmse > 1.0
    _, held_out = fits.score_random(x, y, seed=1)
    assert held_out.samples == 600
    assert fits.score_random(x, y, seed=1) == fits.score_random(x, y, seed=1)


def test_a_constant_surrogate_cannot_be_fitted():
    with pytest.raises(fits.StudyError, match="closing samples"):
        fits.fit_line(np.ones(10), np.arange(10.0))


def test_run_wise_scores_use_every_run_once_and_are_worse_than_pooled():
    closing = fits.closing_campaign(campaign(), [fits.TARGET, "motor_current_a"])
    table = closing.concatenate([fits.TARGET, "motor_current_a"])
    current, torque = table.columns["motor_current_a"], table.columns[fits.TARGET]
    pooled = fits.score(fits.fit_line(current, torque)(current), torque)
    fitter = fits.linear_fitter("motor_current_a")
    scored = {
        name: fits.held_out(splits, ["motor_current_a"], fitter)
        for name, splits in (
            ("run-wise", closing.folds(5, seed=0)),
            ("LOFO", closing.leave_one_condition_out("frequency_hz")),
            ("LOPO", closing.leave_one_condition_out("load_command_a")),
        )
    }
    for table in scored.values():
        assert sorted(table.names) == sorted(closing.names)
        found = fits.score_table(table)
        assert found.samples == pooled.samples
        assert found.rmse > pooled.rmse


@pytest.mark.measured
def test_measured_data_gives_the_published_counts_and_linear_rows(measured_data):
    from rig.importers.registry import open_campaign

    runs = open_campaign(measured_data / "mrdlab-Tool_4_Maryland_L_4.tar.xz")
    names = [fits.TARGET, *fits.SURROGATES.values()]
    table = fits.closing_campaign(runs, names).concatenate(names, valid_only=False)
    assert len(table.run) == 308_117
    torque = table.columns[fits.TARGET]
    rmse = {
        name: 1e3 * fits.score_authors(table.columns[channel], torque)[1].rmse
        for name, channel in fits.SURROGATES.items()
    }
    expected = {"command": 14.17, "current": 14.24, "gearbox": 43.14}
    assert rmse == pytest.approx(expected, abs=0.02)
