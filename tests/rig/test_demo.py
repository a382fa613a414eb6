"""The demonstration and the fit, as a user runs them."""

import json
import re
from pathlib import Path

import pytest

from estimation import model_file
from rig.cli.main import main
from rig.diagnosis.ledger import Ledger
from rig.diagnosis.schema import DiagnosisSchema
from rig.importers.registry import open_campaign
from rig.log.reader import read_log

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return tmp_path_factory.mktemp("demo") / "out"


@pytest.fixture(scope="module")
def told(demo):
    """What `rig demo --json` prints, run once."""
    import contextlib
    import io

    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["demo", "--seed", "1", "--out", str(demo), "--json"]) == 0
    return json.loads(out.getvalue())


def test_the_demo_leaves_logs_a_model_and_a_page(demo, told):
    assert len(list((demo / "logs").glob("*.mcap"))) == 14
    page = demo / "logs/diagnosis/diagnosis.html"
    assert told["report"] == str(page)
    assert "</html>" in page.read_text()


def test_the_demos_campaign_is_listed_with_its_verdict(demo, told, capsys):
    assert main(["campaigns", "verdict=identified", "--root", str(demo), "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["campaigns"]
    assert len(found["runs"]) == 14


def test_the_demo_finds_what_it_hid_on_runs_not_touched(demo, told):
    found = told["diagnosis"]
    DiagnosisSchema.model_validate(found)
    (finding,) = found["findings"]
    assert (finding["verdict"], finding["family"]) == ("identified", "ripple.motor")
    assert finding["runs_improved"] == finding["runs_total"] == len(found["runs"]["confirm"])
    assert found["rmse_after"]["motor"] < 0.75 * found["rmse_before"]["motor"]
    assert found["exploratory"] is False
    assert "ripple.motor" in {t.effect.id for t in model_file.read(Path(told["model"])).terms}


def test_the_page_has_all_that_was_found_and_what_is_not_decided(demo, told):
    page = Path(told["report"]).read_text()
    found = told["diagnosis"]
    assert '"name":"residual-1-1"' in page
    assert "identified: torque that is periodic in the motor angle (cogging) [ripple.motor]" in page
    assert "held-out test runs" in page
    assert all(run in page for run in found["runs"]["confirm"])
    for part in ("What to check", "Next experiment", "Parameters of the findings", "Declared"):
        assert part in page
    for note in found["notes"]:
        assert note in page


def test_the_declared_models_error_is_of_training_runs_alone(told):
    assert told["held_out"]["runs"] == 14 - len(told["diagnosis"]["runs"]["confirm"])


def test_the_demo_logs_its_use_of_held_out_data(demo, told):
    recordings = list(open_campaign(demo / "logs").evidence)
    assert Ledger(Path(told["ledger"])).known(recordings) == {r.name for r in recordings}


def test_the_logs_do_not_contain_the_hidden_effect(demo, told):
    from rig.simulation.hidden import NAMES

    for path in (demo / "logs").glob("*.mcap"):
        log = read_log(path)
        content = json.dumps([dict(log.run.conditions), log.run.notes, dict(log.run.details)])
        content += "".join(a.data.decode() for a in log.attachments)
        assert not [name for name in NAMES if re.search(rf"\b{name}\b", content)]


def test_a_fit_reports_the_error_on_runs_it_was_not_fitted_on(demo, told, tmp_path, capsys):
    out = tmp_path / "grip.model.toml"
    words = ["fit", str(demo / "logs"), "-m", "grip", "-o", str(out), "--json"]
    assert main(words) == 0
    result = json.loads(capsys.readouterr().out)
    assert 0 < result["held_out"]["rmse"] < 0.05
    assert result["held_out"]["runs"] == 14
    fitted = model_file.read(out)
    assert fitted.is_fitted
    assert main(["replay", str(demo / "logs"), "--model", str(out), "--speed", "0", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])["summary"]
    assert summary["error_rms"] < 0.05
