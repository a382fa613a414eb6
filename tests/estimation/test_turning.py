"""How wide friction's sign is: told by all samples, where samples in motion do not mind."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.diagnosis.balance import lay_out
from estimation.diagnosis.design import prepare
from estimation.diagnosis.frozen import freeze, squares
from estimation.diagnosis.turning import FREE, turned
from estimation.fitting import fit
from estimation.model_file import read
from tests.estimation.synthetic import TRUE, run


@pytest.fixture(scope="module")
def balance():
    # slow enough to rest for long at each reversal
    runs = [run(f"r{k}", 0.1, 0.05 + 0.02 * k, seed=k, noise_n_m=2e-3) for k in range(4)]
    model = fit(read(Path("motor")), Campaign.of(runs), bootstrap=0)
    return lay_out(model, [prepare(r, [*model.channels, model.target], model) for r in runs])


@pytest.mark.parametrize("share", [0.7, 1.4])
def test_a_width_moves_to_what_all_samples_tell_at_no_cost_in_motion(balance, share):
    off = [
        replace(t, shape=(share * TRUE["width"],)) if t.family == "friction.coulomb" else t
        for t in balance.terms
    ]
    told = turned(balance, off)
    width = next(t.shape[0] for t in told if t.family == "friction.coulomb")
    assert abs(np.log(width / TRUE["width"])) < 0.3 * abs(np.log(share))
    assert balance.loss(told) <= FREE * balance.loss(off)


def test_a_frozen_model_errs_less_over_all_samples_than_with_the_width_it_was_given(balance):
    given = freeze(replace(balance, runs=[moving_only(r) for r in balance.runs]), [])
    mine = freeze(balance, [])
    whole = [squares(f, balance.runs, at_rest=True).sum() for f in (given, mine)]
    assert whole[1] <= whole[0]


def moving_only(prepared):
    return replace(prepared, valid=prepared.used)
