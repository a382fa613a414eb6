"""Bounds hold in a fit and in each replicate of it; an interval holds its own value."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.fitting import fit
from estimation.model import Model
from estimation.recording import Recording
from estimation.within_bounds import solve_within
from tests.estimation.campaigns import runs


def test_beside_an_active_bound_the_others_are_the_best() -> None:
    random = np.random.default_rng(3)
    columns = random.normal(size=(400, 3))
    target = columns @ [1.0, -2.0, 3.0] + 0.5 * columns[:, 0]
    low, high = np.array([-9.0, 0.0, -9.0]), np.array([9.0, 9.0, 2.0])
    found = solve_within(columns.T @ columns, columns.T @ target, low, high)
    assert np.all((found >= low) & (found <= high))
    assert (found[1], found[2]) == (0.0, 2.0)
    left = target - columns[:, 1:] @ found[1:]
    assert found[0] == pytest.approx(columns[:, 0] @ left / (columns[:, 0] @ columns[:, 0]))


def negative_friction() -> list[Recording]:
    """Runs whose drive seems to push by itself: no friction of an allowed sign describes them."""
    made = runs(count=8, seconds=2.0)
    return [
        r.with_columns(
            proximal_torque_n_m=r["proximal_torque_n_m"]
            + (0.05 + 0.01 * k) * np.sign(np.gradient(r["motor_angle_rad"]))
        )
        for k, r in enumerate(made)
    ]


def outside(model: Model) -> list[str]:
    """Parameters whose value or interval is beyond a bound, or whose interval lacks the value."""
    return [
        f"{term.effect.id}.{p.name}: {estimate}"
        for term in model.terms
        for p in term.parameters
        if (estimate := term.values[p.name]).ci95 is not None
        and not p.lower <= estimate.ci95[0] <= estimate.value <= estimate.ci95[1] <= p.upper
    ]


@pytest.mark.parametrize("recordings", [negative_friction(), runs(count=3, seconds=2.0)])
def test_every_interval_of_a_fit_holds_its_value(
    recordings: Sequence[Recording],
) -> None:
    declared = model_file.read(Path("motor"))
    fitted = fit(declared, Campaign.of(recordings))
    assert outside(fitted) == []
