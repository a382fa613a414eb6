"""`rig study pique` on a made arm with known hidden effects, and on the measured paths."""

from pathlib import Path

import numpy as np
import pytest

from estimation.arm.motion import motion_of
from estimation.arm.regressor import regressor
from estimation.arm.tables import PSM
from estimation.arm.wrist import candidates
from estimation.campaign import Campaign
from estimation.recording import Recording
from rig.arm import search as arm_search
from rig.errors import DataError
from rig.importers.dvrk_psm import MOTOR_TO_JOINT
from rig.studies.pique import study as pique
from tests.rig.arms import RATE_HZ, psm_recording, waving

pytestmark = pytest.mark.long

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")

ROOT = Path(__file__).parents[2]
HIDDEN = "presliding J2"
TRIED = [e for e in candidates(PSM) if e.name.endswith(("J2", "hysteresis"))]


def made_path(name: str, seed: int, seconds: float = 20.0) -> Recording:
    """A path of an arm with known parameters, a hidden effect and a little noise."""
    rng = np.random.default_rng(seed)
    position = waving(seconds, 0.16, 0.2, rng)
    motion = motion_of(position, 1 / RATE_HZ, arm_search.FINE)
    torque = regressor(PSM, motion) @ np.random.default_rng(1).uniform(0.05, 1, 68)
    (hidden,) = (e for e in candidates(PSM) if e.name == HIDDEN)
    torque += hidden.columns(motion)[:, :6] @ np.full(3, 0.15 * np.ptp(torque[:, 1]))
    torque += 0.002 * np.ptp(torque, axis=0) * rng.normal(size=torque.shape)
    return psm_recording(name, position, motion.velocity, torque, RATE_HZ)


@pytest.fixture(scope="module")
def paths():
    return made_path("a", 11), made_path("b", 12)


@pytest.fixture(scope="module")
def study(paths):
    return pique.run_study(*paths, tried=TRIED)


def errors(study, model):
    return np.mean([r.nrmsd_percent for r in study.rows if r.model == model], axis=0)


def test_the_hidden_effect_is_found_and_halves_its_joints_error_also_on_the_other_path(study):
    assert study.trials[0].effect == HIDDEN
    assert study.trials[0].kept_in_round == 1
    assert study.trials[0].other_way_percent > 0
    for model in (pique.EFFECTS, pique.WITHIN):  # chosen on both paths, and on one alone
        assert errors(study, model)[1] < 0.5 * errors(study, pique.FILTERED)[1]


def test_the_command_prints_json_and_writes_markdown(paths, monkeypatch, tmp_path, answered):
    three = Campaign.of((*paths, made_path("c", 13)))
    monkeypatch.setattr(arm_search, "open_campaign", lambda path: three)
    monkeypatch.setattr(pique, "candidates", lambda arm: TRIED)
    out = tmp_path / "pique.md"
    found = answered("study pique --data x --paths a b --also c --out", out)
    assert found["schema"] == "rig.study.pique/1"
    assert len(found["rows"]) == 20
    text = out.read_text()
    assert "thesis, table 3.2 (another robot)" in text
    assert "| 2.38 | 4.80 | 12.83 | 6.49 | 15.29 | 18.11 |" in text
    assert HIDDEN in text.split("## Effects kept")[1].split("## Effects tried")[0]


def test_a_missing_path_names_those_there(paths, monkeypatch, tmp_path):
    monkeypatch.setattr(arm_search, "open_campaign", lambda path: Campaign.of(paths))
    with pytest.raises(DataError, match="no run one18"):
        arm_search.open_paths(tmp_path, ("one18", "b"))


def test_the_table_and_the_importer_agree_on_the_coupling():
    np.testing.assert_array_equal(np.array(PSM.wrist_coupling), MOTOR_TO_JOINT)


def rows_of(page: str, heading: str) -> list[list[str]]:
    """Return the cells of the table under a heading of a page."""
    part = page.split(f"## {heading}")[1].split("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[1:]]


@pytest.mark.measured
def test_the_measured_paths_give_the_reference_and_the_pages_rows(measured_data):
    if not (measured_data / "psm").is_dir():
        pytest.skip(f"no arm data at {measured_data / 'psm'}")
    page = (ROOT / "docs/results/pique.md").read_text()
    kept = [row[0] for row in rows_of(page, "Effects kept, in order")]
    tried = [e for e in candidates(PSM) if e.name in kept]
    runs = arm_search.open_paths(measured_data / "psm", ("one18", "two18"))
    found = pique.run_study(*runs, tried=tried)
    there, back = (r.nrmsd_percent for r in found.rows if r.model == pique.THESIS)
    # an independent run of the thesis' model on these files
    np.testing.assert_allclose(there, [1.71, 3.84, 4.21, 8.67, 10.00, 9.25], rtol=0.05)
    np.testing.assert_allclose(back, [1.54, 3.40, 4.61, 7.20, 9.97, 10.94], rtol=0.05)
    one, other = (arm_search.prepare(run, tried) for run in runs)
    ways = [arm_search.score(way, kept) for way in ((one, other), (other, one))]
    shown = {row[0]: row for row in rows_of(page, "NRMSD on the path that was not fitted, %")}
    for way, name in zip(ways, ("one18 to two18", "two18 to one18"), strict=True):
        stated = [float(cell) for cell in shown[f"with the effects kept, {name}"][2:]]
        np.testing.assert_allclose(way, stated, rtol=0.02, atol=0.01)
