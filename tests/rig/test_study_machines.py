"""`rig study machines` on small tables of the same layouts as the published ones."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import read_runs
from rig.machines.shipped import place_of
from rig.studies.machines.published import by_direction, standard
from rig.studies.machines.study import CASES
from tests.rig.test_own_machine_walk import ASYMMETRY, COULOMB, MASS, VISCOUS, drive_axis


@pytest.fixture
def data(tmp_path):
    folder = tmp_path / "emps"
    folder.mkdir()
    savemat(folder / "DATA_EMPS.mat", drive_axis())
    return tmp_path


def test_the_published_estimates_find_what_was_planted(data):
    whole = read_mapping(place_of(Path("emps")), [(("runs",), {}, "whole")])
    (recording,) = read_runs(data / "emps", whole, [])
    plain, split = standard(recording), by_direction(recording)
    assert plain.parameters["mass_kg"] == pytest.approx(MASS, rel=0.01)
    assert split.parameters["viscous_ahead_n_s_m"] == pytest.approx(VISCOUS + ASYMMETRY, rel=0.02)
    assert split.parameters["viscous_back_n_s_m"] == pytest.approx(VISCOUS - ASYMMETRY, rel=0.02)
    assert split.parameters["coulomb_ahead_n"] == pytest.approx(COULOMB, rel=0.2)
    assert split.percent < plain.percent


@pytest.mark.long
def test_absent_machines_are_named_and_the_others_studied(data, answered):
    page = data / "page.md"
    found = answered("study machines", data, "--out", page)
    (row,) = found["rows"]
    assert (row["case"], row["equation"]) == ("EMPS", "carriage")
    assert np.isfinite(row["declared_percent"])
    assert len(found["skipped"]) == len(CASES) - 1
    text = page.read_text()
    assert "no recordings in sts3215" in text
    assert "(../machines/emps.md)" in text


@pytest.mark.long
@pytest.mark.measured
def test_no_finding_raises_the_error_on_held_out_recordings(measured_data, answered):
    rows = answered("study machines", measured_data / "machines")["rows"]
    assert all(row["found_percent"] <= 1.01 * row["declared_percent"] for row in rows)
