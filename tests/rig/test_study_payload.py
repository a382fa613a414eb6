"""`rig study payload` on the measured runs with and without a mass."""

import json

import pytest
from typer.testing import CliRunner

from rig.cli.study import study_app

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install 'rig[arm]')")


@pytest.mark.measured
def test_the_measured_mass_is_found_and_none_where_there_is_none(measured_data, tmp_path):
    if not (measured_data / "psm").is_dir():
        pytest.skip(f"no arm data at {measured_data / 'psm'}")
    out = tmp_path / "payload.md"
    words = ["payload", "--data", str(measured_data / "psm"), "--out", str(out), "--json"]
    words += ["--on", "one19_insertion_105g", "--on", "one19"]
    ran = CliRunner().invoke(study_app, words)
    assert ran.exit_code == 0, ran.output
    with_mass, without = json.loads(ran.stdout)["masses"]
    assert with_mass["mass_kg"] == pytest.approx(0.105, rel=0.03)
    assert abs(without["mass_kg"]) < 0.002
    assert "| one19_insertion_105g |" in out.read_text()
