"""Screening a residual for structure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.model_file import read
from estimation.residual import ResidualError, largest_structure
from tests.estimation.synthetic import TRUE, campaign


def screened(extra=None, model="motor"):
    runs = campaign(extra)
    return largest_structure(fit(read(Path(model)), runs, bootstrap=0), runs)


def test_nothing_stands_out_when_nothing_is_left():
    structures = screened()
    assert not any(s.stands_out for s in structures)
    assert "no structure above chance" in structures[0].sentence()
    assert {s.variable for s in structures} == {
        "velocity_sign",
        "velocity",
        "spindle_angle",
        "motor_angle",
        "load",
        "current",
        "acceleration",
        "time",
    }


def test_a_ripple_is_seen_at_its_order():
    first = screened(lambda angle, speed, load: 2e-3 * np.sin(7 * angle + 0.3))[0]
    assert (first.variable, first.unit) == ("motor_angle", "N m")
    assert "7 times a motor turn" in first.detail
    assert first.stands_out
    assert 1e-3 < first.amplitude < 2e-3  # the 50 Hz filter takes its share at speed
    assert "identifies no effect" in first.sentence()


def test_missing_coulomb_friction_is_seen_over_the_direction():
    def extra(angle, speed, load):
        return (
            0.01 * np.sign(speed)
            - TRUE["damping"] * speed
            - TRUE["friction"] * np.tanh(speed / TRUE["width"])
        )

    first = screened(extra, model="linear")[0]
    assert first.variable == "velocity_sign"
    assert "opening" in first.detail or "closing" in first.detail


def test_what_differs_between_runs_is_seen_only_when_it_is_no_nuisance():
    runs = Campaign.of(
        r.with_columns(proximal_torque_n_m=r["proximal_torque_n_m"] + 0.05 * (int(r.name) % 10))
        for r in campaign()
    )
    found = {}
    for declared in (True, False):
        model = fit(replace(read(Path("motor")), run_offsets=declared), runs, bootstrap=0)
        assert model.run_offsets is declared
        found[declared] = largest_structure(model, runs)[0]
    assert not found[True].stands_out
    assert found[False].amplitude > 5 * found[True].amplitude


def test_one_run_is_too_few():
    runs = campaign()
    model = fit(read(Path("motor")), runs, bootstrap=0)
    with pytest.raises(ResidualError, match="too few"):
        largest_structure(model, Campaign(runs.runs[:1]))
