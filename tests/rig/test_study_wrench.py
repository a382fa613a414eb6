"""`rig study wrench`: tables 3.1 to 3.3 of the thesis on simulated arms."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from rig.cli.study import study_app

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install 'rig[arm]')")

from rig.simulation.arm import contact, contact_motion, dahl
from rig.studies.pique_wrench import ati


def test_the_command_reports_every_seed_and_whether_it_is_fair(tmp_path):
    out = tmp_path / "wrench.md"
    words = ["wrench", "--seeds", "2", "--json", "--out", str(out), "--state", str(tmp_path)]
    ran = CliRunner().invoke(study_app, words)
    assert ran.exit_code == 0, ran.output
    found = json.loads(ran.stdout)
    assert found["seeds"] == [0, 1]
    assert len(found["cells"]) == 9
    assert all(len(cell["nrmsd_percent"]) == 2 for cell in found["cells"])
    thesis, ours = (
        np.mean([c["nrmsd_percent"] for c in found["cells"] if ("thesis" in c["method"]) is own])
        for own in (True, False)
    )
    assert ours < thesis
    assert set(found["fair"]) == {cell["table"] for cell in found["cells"]}
    assert "| thesis | 2.38 | 4.80 | 12.83 | 6.49 | 15.29 | 18.11 |" in out.read_text()


def test_dahl_friction_turns_over_its_displacement_and_stays_within_one():
    there_and_back = np.concatenate([np.linspace(0, 1, 1001), np.linspace(1, 0.9, 101)])[:, None]
    friction = dahl(there_and_back, np.array([0.05]))[:, 0]
    assert np.isclose(friction[1000], 1.0, atol=1e-3)
    assert np.isclose(friction[1050], 1 - 2 * (1 - np.exp(-1)), atol=0.02)
    assert np.abs(friction).max() <= 1


def test_contact_stays_within_seven_newton_and_the_sensor_close_to_it():
    rng = np.random.default_rng(3)
    wrench = contact(rng, contact_motion(rng, 20.0))
    assert 0 < np.abs(wrench[:, :3]).max() <= 7
    seen = ati(wrench, rng)
    assert not np.allclose(seen, wrench, atol=1e-3)
    assert np.sqrt(np.mean((seen - wrench)[:, :3] ** 2)) < 0.4
