"""The figures that the pages begin with, made again from the measured runs."""

from pathlib import Path

import numpy as np
import pytest

from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.cross_validation import held_out_score
from estimation.estimators.bank import BankEstimator, BankRecipe, fit_runs
from rig.importers.jaw_steps import with_one_zero
from rig.importers.registry import open_campaign
from rig.models.adapt import run_adaptation

pytestmark = [pytest.mark.long, pytest.mark.measured]

ROOT = Path(__file__).parents[2]
TARGET, LOAD = "proximal_torque_n_m", "motor_current_a"
RUNAWAY = "07"


def archive_of(folder: Path, name: str) -> Path:
    path = folder / f"mrdlab-{name}.tar.xz"
    if not path.is_file():
        pytest.skip(f"no measured data at {path}")
    return path


def opened(folder: Path, name: str) -> Campaign:
    return open_campaign(archive_of(folder, name))


def rows(page: str, start: str) -> list[list[str]]:
    """Return the cells of the rows of a result page that begin with a text."""
    lines = (ROOT / "docs/results" / page).read_text().splitlines()
    return [
        [cell.strip() for cell in line.strip("| ").split(" | ")]
        for line in lines
        if line.startswith(f"| {start}")
    ]


@pytest.fixture(scope="module")
def reference(measured_data) -> Campaign:
    return opened(measured_data, "Tool_4_Maryland_L_4")


@pytest.fixture(scope="module")
def source(reference) -> BankEstimator:
    return BankRecipe(TARGET, Bank(LOAD)).fit(reference)


@pytest.mark.parametrize("tool", ["Tool_4_Maryland_L_2", "Tool_5_Maryland_L_2"])
def test_an_adapted_estimator_has_the_pages_error(measured_data, source, tool):
    campaign = opened(measured_data, tool)
    page = [
        row
        for row in rows("adapt.md", f"products of physical states | {tool}")
        if row[2] in ("11", "00, 11, 22")
    ]
    assert len(page) == 2
    for _, _, used, as_it_is, adapted, *_ in page:
        found, _ = run_adaptation(
            source, Path("source"), campaign, used.split(", "), from_scratch=False
        )
        assert 1e3 * found.as_it_is.rmse == pytest.approx(float(as_it_is), rel=0.02)
        assert 1e3 * found.adapted.rmse == pytest.approx(float(adapted), rel=0.02)


def test_a_live_fit_has_the_pages_error_on_runs_left_out(measured_data, answered):
    archive = archive_of(measured_data, "Tool_4_Maryland_L_4")
    (row,) = rows("oneill.md", "neutral: proximal torque, mN m, from current | 7")
    found = answered("fit --model states --live --surrogate", LOAD, archive)
    error = found["held_out"]["rmse"]
    # other folds than the page's, and the runaway run is in
    assert 1e3 * error == pytest.approx(float(row[4]), rel=0.1)


def test_intervals_cover_frequencies_and_loads_left_out(reference):
    recipe = BankRecipe(TARGET, Bank(LOAD))
    kept = [run for run in reference.evidence if run.name != RUNAWAY]
    evidence = [(run.conditions, recipe.evidence_of(run)) for run in kept]
    for condition in ("frequency_hz", "load_command_a"):
        inside = []
        for level in {conditions[condition] for conditions, _ in evidence}:
            rest = [run for conditions, run in evidence if conditions[condition] != level]
            fitted = fit_runs(rest, recipe.bank, TARGET)
            for conditions, run in evidence:
                if conditions[condition] == level:
                    error = np.abs(run.design @ fitted.weights - run.truth)
                    inside.append(error <= fitted.interval.half_width(run.design, run.places))
        assert 0.93 <= np.concatenate(inside).mean() <= 0.98


def test_the_jaws_angle_gains_by_counting_its_steps_out(reference):
    recipe = BankRecipe("jaw_angle_rad", Bank(LOAD))
    whole, steps = with_one_zero(reference, recipe.target)
    assert [step.run for step in steps] == ["39", "43"]
    for seed in range(3):
        before, after = (
            np.degrees(held_out_score(recipe, runs.exclude({RUNAWAY: "runaway"}), 5, seed).rmse)
            for runs in (reference, whole)
        )
        assert after < min(0.95 * before, 0.26)
