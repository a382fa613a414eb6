"""The paper's processing and its linear fits."""

import numpy as np
import pytest

from estimation import oneill
from estimation.recording import Flag, Stretch
from tests.estimation.synthetic import campaign, run


def test_closing_samples_are_fast_enough_and_away_from_the_ends():
    done = oneill.processed(run("a", 0.3, 0.1, seed=1), ["motor_current_a"])
    kept = oneill.closing_samples(done)
    assert kept["spindle_velocity_rad_s"].min() >= 0.25
    assert kept.time_s.min() >= 1.0
    assert kept.time_s.max() < 7.0
    inner = slice(1000, -1000)
    assert len(kept) == np.count_nonzero(done["spindle_velocity_rad_s"][inner] >= 0.25)


def test_flagged_samples_count_by_default():
    recording = run("a", 0.3, 0.1, seed=1).with_stretch(Stretch(3, 5, Flag.SUSPECT, "test"))
    done = oneill.processed(recording, ["motor_current_a"])
    assert len(oneill.closing_samples(done, keep_flagged=False)) < len(oneill.closing_samples(done))


def test_fits_find_the_line():
    random = np.random.default_rng(0)
    x = random.normal(size=4000)
    y = 3.0 * x - 0.5
    y[:500] = 100.0  # the authors' fit does not see the first eighth
    line, score = oneill.score_authors(x, y)
    assert (line.gain, line.offset) == pytest.approx((3.0, -0.5))
    assert (score.samples, score.rmse) == (3500, pytest.approx(0.0, abs=1e-12))
    assert oneill.score_pooled(x, y)[1].rmse > 1.0
    _, held_out = oneill.score_random(x, y, seed=1)
    assert held_out.samples == 600
    assert oneill.score_random(x, y, seed=1) == oneill.score_random(x, y, seed=1)


def test_a_constant_surrogate_cannot_be_fitted():
    with pytest.raises(oneill.StudyError, match="closing samples"):
        oneill.fit_line(np.ones(10), np.arange(10.0))


def test_run_wise_scores_use_every_run_once_and_are_worse_than_pooled():
    closing = oneill.closing_campaign(campaign(), [oneill.TARGET, "motor_current_a"])
    table = closing.concatenate([oneill.TARGET, "motor_current_a"])
    _, pooled = oneill.score_pooled(table.columns["motor_current_a"], table.columns[oneill.TARGET])
    fitter = oneill.linear_fitter("motor_current_a")
    scored = {
        name: oneill.held_out(splits, ["motor_current_a"], fitter)
        for name, splits in (
            ("run-wise", closing.folds(5, seed=0)),
            ("LOFO", closing.leave_one_condition_out("frequency_hz")),
            ("LOPO", closing.leave_one_condition_out("load_command_a")),
        )
    }
    for table in scored.values():
        assert sorted(table.names) == sorted(closing.names)
        found = oneill.score_table(table)
        assert found.samples == pooled.samples
        assert found.rmse > pooled.rmse


@pytest.mark.measured
def test_measured_data_gives_the_published_counts_and_linear_rows(measured_data):
    from rig.importers.registry import open_campaign

    runs = open_campaign(measured_data / "mrdlab-Tool_4_Maryland_L_4.tar.xz")
    names = [oneill.TARGET, *oneill.SURROGATES.values()]
    table = oneill.closing_campaign(runs, names).concatenate(names, valid_only=False)
    assert len(table.run) == 308_117
    torque = table.columns[oneill.TARGET]
    rmse = {
        name: 1e3 * oneill.score_authors(table.columns[channel], torque)[1].rmse
        for name, channel in oneill.SURROGATES.items()
    }
    expected = {"command": 14.17, "current": 14.24, "gearbox": 43.14}
    assert rmse == pytest.approx(expected, abs=0.02)
