"""The demonstration and the fit, as a user runs them."""

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from rig.cli.main import main
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.schema import DiagnosisSchema
from rig.importers.registry import open_campaign

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return tmp_path_factory.mktemp("demo") / "out"


@pytest.fixture(scope="module")
def told(demo):
    """What `rig demo --json` prints, run once."""
    with redirect_stdout(io.StringIO()) as out:
        assert main(["demo", "--seed", "1", "--out", str(demo), "--json"]) == 0
    return json.loads(out.getvalue())


def test_the_demos_campaign_is_listed_with_its_verdict_and_its_use_is_logged(demo, told, answered):
    assert told["report"] == str(demo / "logs/diagnosis/diagnosis.html")
    (found,) = answered("campaigns verdict=identified --root", demo)["campaigns"]
    recordings = list(open_campaign(demo / "logs").evidence)
    assert len(found["runs"]) == len(recordings) == 14
    assert Ledger(Path(told["ledger"])).known(recordings) == {r.name for r in recordings}


def test_the_demo_finds_what_it_hid_on_runs_not_touched(told):
    found = told["diagnosis"]
    DiagnosisSchema.model_validate(found)
    (finding,) = found["findings"]
    assert (finding["verdict"], finding["family"]) == ("identified", "ripple.motor")
    assert finding["runs_improved"] == finding["runs_total"] == len(found["runs"]["confirm"])
    assert found["rmse_after"]["motor"] < 0.75 * found["rmse_before"]["motor"]
    assert found["exploratory"] is False
    assert "ripple.motor" in {t.effect.id for t in model_file.read(Path(told["model"])).terms}
    # the declared model's error is of training runs alone
    assert told["held_out"]["runs"] == 14 - len(found["runs"]["confirm"])


def test_what_was_planted_is_stated_and_is_what_was_found(told):
    planted, (finding,) = told["planted"], told["diagnosis"]["findings"]
    found = {name: value["value"] for name, value in finding["parameters"].items()}
    assert planted["name"] == "motor_ripple"
    assert found["order"] == pytest.approx(planted["periods_per_turn"], rel=0.01)
    amplitude = np.hypot(found["sine"], found["cosine"])
    assert amplitude == pytest.approx(planted["amplitude_n_m"], rel=0.1)


def test_the_page_has_all_that_was_found_and_what_is_not_decided(told):
    page, found = Path(told["report"]).read_text(), told["diagnosis"]
    parts = ('"name":"residual-1-1"', "held-out test runs", "What to check", "Next experiment")
    words = "torque or force that repeats along the turn or travel of a drive, such as cogging"
    identified = f"identified: {words} [ripple.motor]"
    wanted = (*parts, identified, "Declared", *found["runs"]["confirm"], *found["notes"])
    assert [part for part in wanted if part not in page] == []


def test_a_fit_reports_the_error_on_runs_it_was_not_fitted_on(demo, told, tmp_path, said, answered):
    out = tmp_path / "grip.model.toml"
    result = answered("fit --model grip", demo / "logs", "-o", out)
    assert 0 < result["held_out"]["rmse"] < 0.05
    assert result["held_out"]["runs"] == 14
    assert model_file.read(out).is_fitted
    printed = said("replay --speed 0 --json", demo / "logs", "--model", out).out
    assert json.loads(printed.splitlines()[-1])["summary"]["error_rms"] < 0.05
