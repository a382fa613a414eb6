"""`rig diagnose` from a path to JSON, report, model file and ledger."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.result import VERDICTS, Diagnosis, Finding
from estimation.diagnosis.split import Sealed, split
from estimation.estimator import load
from rig.cli.main import main
from rig.diagnosis import subject
from rig.diagnosis.ledger import Ledger, LedgerError
from rig.diagnosis.schema import FILE, DiagnosisSchema, json_schema
from tests.estimation.campaigns import runs, spring, tight_spot

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


@pytest.fixture
def campaign(monkeypatch):
    recordings = runs(spring, count=9, seconds=5.0)
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    return recordings


def run(folder: Path, *words: str) -> dict:
    out = folder / "diagnosis.json"
    ledger = str(folder / "looks.jsonl")
    whole = ["diagnose", str(folder), "--json-out", str(out), "--ledger", ledger, *words]
    assert main(whole) == 0
    return json.loads(out.read_text())


def test_a_diagnosis_leaves_json_report_and_model(campaign, tmp_path, capsys):
    model, report = tmp_path / "model.toml", tmp_path / "report"
    found = run(tmp_path, "--model-out", str(model), "--report", str(report), "--equation", "motor")
    DiagnosisSchema.model_validate(found)
    (finding,) = found["findings"]
    assert finding["family"] == "spring.position"
    # few short runs of one equation cannot exclude these
    assert set(finding["alternatives"]) <= {"hysteresis.presliding", "sensor.crosstalk"}
    assert found["verdict"] == ("one_of" if finding["alternatives"] else "identified")
    assert (found["next_experiment"] is None) == (not finding["alternatives"])
    assert found["exploratory"] is False
    assert found["rmse_after"]["motor"] < found["rmse_before"]["motor"]
    written = model_file.read(model)
    assert "spring.position" in {t.effect.id for t in written.terms}
    # as after `rig fit`, a watch and a display know at once what is usual
    assert list(written.evidence.runs) == found["runs"]["discover"]
    assert written.evidence.rmse == pytest.approx(found["rmse_after"]["motor"], rel=0.5)
    assert written.evidence.made_at
    page = (report / "diagnosis.html").read_text()
    assert "[spring.position]" in page
    for part in (
        "motor: residual over ",
        "motor: error of each held-out test run",
        "motor: measured and estimated",
        "Parameters of the findings",
        "Probability of each name",
        "Declared parameters: motor",
        "What to check",
        "Next experiment",
    ):
        assert part in page
    assert "[spring.position]" in capsys.readouterr().out


def test_a_folder_of_logs_keeps_its_diagnosis_with_them(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "monday"
    words = ["record", "--sim", "-p", "quick", "-o", str(folder), "--seed", "5"]
    assert main(words) == 0
    words = ["diagnose", str(folder), "--equation", "motor", "--quick"]
    assert main([*words, "--ledger", str(tmp_path / "looks.jsonl")]) == 0
    out = capsys.readouterr().out
    page = folder / "diagnosis" / "diagnosis.html"
    assert f"Report: {page}" in out.replace("\n", "")
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert main(["campaigns", "--root", str(tmp_path), "--json"]) == 0
    (campaign,) = json.loads(capsys.readouterr().out)["campaigns"]
    assert campaign["diagnosis"]["verdict"]


def test_every_campaign_found_is_diagnosed_once(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    root = tmp_path / "logs"
    one_run = tmp_path / "one.toml"
    one_run.write_text(
        'name = "one"\n[[runs]]\nkind = "sine"\nfrequencies_hz = [0.5]\nloads_a = [0.4]\n'
        "duration_s = 4.0\n"
    )
    for k, protocol in enumerate(("quick", "quick", str(one_run))):
        words = ["record", "--sim", "-p", protocol, "-o", str(root / f"day-{k}")]
        assert main([*words, "--seed", str(k)]) == 0
    words = ["campaigns", "--root", str(root), "--diagnose", "--json"]
    capsys.readouterr()
    assert main(words) == 0
    rows = json.loads(capsys.readouterr().out)["campaigns"]
    failed = {Path(row["folder"]).name: row["failed"] for row in rows}
    assert "too few" in failed.pop("day-2")
    assert set(failed.values()) == {""}
    pages = [root / name / "diagnosis/diagnosis.html" for name in failed]
    assert all(page.read_text().startswith("<!DOCTYPE html>") for page in pages)
    assert len((tmp_path / "state/looks.jsonl").read_text().splitlines()) == len(pages)
    made = [page.stat().st_mtime_ns for page in pages]
    assert main(words) == 0  # a second call has nothing to do
    assert [page.stat().st_mtime_ns for page in pages] == made
    assert json.loads(capsys.readouterr().out)["campaigns"] == rows


def test_every_equation_that_is_decided_goes_into_the_model_file(campaign, tmp_path):
    path = tmp_path / "found.model.toml"
    found = run(tmp_path, "--model-out", str(path), "--quick")
    assert set(found["undecided"]) == {"stretch"}  # no jaw encoder
    decided = [m.balance for m in model_file.read_all(path)]
    assert decided == list(found["unit"]) == ["motor", "gearbox", "cable"]


def test_the_written_model_runs_live_with_the_error_that_is_reported(campaign, tmp_path):
    path = tmp_path / "model.toml"
    found = run(tmp_path, "--model-out", str(path), "--equation", "motor", "--quick")
    estimator = load(path)
    (one, *_) = [r for r in campaign if r.name in found["runs"]["confirm"]]
    stepper = estimator.stepper(one.sample_rate_hz)
    parts = [slice(k, k + 64) for k in range(0, len(one), 64)]
    live = np.concatenate(
        [stepper.step(one.time_s[p], {c: v[p] for c, v in one.columns.items()}) for p in parts]
    )
    assert live == pytest.approx(estimator.predict(one, causal=True), rel=1e-12, abs=1e-14)
    (note,) = [n for n in found["notes"] if "causal" in n]
    zero_phase, causal = (float(n) for n in re.findall(r"([\d.]+) mN m", note))
    assert zero_phase == pytest.approx(1e3 * found["rmse_after"]["motor"], rel=0.01)
    assert causal > zero_phase


def test_what_has_no_name_is_reported_and_in_no_model_file(monkeypatch, tmp_path, capsys):
    recordings = runs(tight_spot, count=9, seconds=4.0)
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
    path, report = tmp_path / "model.toml", tmp_path / "report"
    words = ["--model-out", str(path), "--report", str(report), "--equation", "motor"]
    found = run(tmp_path, *words, "--quick")
    DiagnosisSchema.model_validate(found)
    (finding,) = found["findings"]
    assert finding["verdict"] == "depends_on"
    assert "motor_angle" in finding["depends_on"]
    assert "unknown form; it depends on" in capsys.readouterr().out
    assert "unknown form; it depends on" in (report / "diagnosis.html").read_text()
    declared = model_file.read(Path("motor"))
    assert len(model_file.read(path).terms) == len(declared.terms)
    assert any("not added to the model file" in note for note in found["notes"])


def test_a_second_look_at_the_same_runs_is_exploratory(campaign, tmp_path):
    assert run(tmp_path, "--equation", "motor")["exploratory"] is False
    again = run(tmp_path, "--equation", "motor")
    assert again["exploratory"] is True
    # another seed confirms on runs that were seen all the same
    assert run(tmp_path, "--equation", "motor", "--seed", "5")["exploratory"] is True
    assert len((tmp_path / "looks.jsonl").read_text().splitlines()) == 3


def test_new_runs_are_a_first_look(tmp_path):
    ledger = Ledger(tmp_path / "looks.jsonl")
    first, second = runs(count=6, seconds=1.0), runs(count=6, seconds=1.0, first_seed=50)
    ledger.write(first, split(first))
    assert set(ledger.seen(first, split(first))) == set(split(first).confirm)
    assert ledger.seen(second, split(second)) == ()


def test_other_names_and_folders_do_not_make_runs_new(tmp_path):
    ledger = Ledger(tmp_path / "looks.jsonl")
    first = runs(count=6, seconds=1.0)
    ledger.write(first, split(first))
    renamed = [replace(r, name=f"round-9/{k}", source="copy") for k, r in enumerate(first)]
    assert set(ledger.seen(renamed, split(renamed))) == set(split(renamed).confirm)


def test_beside_runs_already_seen_only_new_ones_confirm(tmp_path):
    ledger = Ledger(tmp_path / "looks.jsonl")
    first = runs(count=6, seconds=1.0)
    ledger.write(first, split(first))
    fresh = [
        replace(r, name=f"new{k}") for k, r in enumerate(runs(count=6, seconds=1.0, first_seed=50))
    ]
    both = [*first, *fresh]
    sealed = split(both, 0, ledger.known(both))
    assert len(sealed.confirm) == 2
    assert set(sealed.confirm) <= {r.name for r in fresh}
    assert ledger.seen(both, sealed) == ()
    # two new runs are too few to confirm by themselves: all are split, and the look says so
    few = [*first, *fresh[:2]]
    assert ledger.seen(few, split(few, 0, ledger.known(few)))


def test_a_damaged_ledger_is_reported(tmp_path):
    (tmp_path / "looks.jsonl").write_text("nonsense\n")
    first = runs(count=3, seconds=1.0)
    with pytest.raises(LedgerError, match="cannot be read"):
        Ledger(tmp_path / "looks.jsonl").seen(first, split(first))


def jumping(recording):
    time_s = recording.time_s.copy()
    time_s[700:] += 0.4
    return replace(recording, time_s=time_s)


def test_runs_whose_clock_jumps_are_left_out_and_named(monkeypatch, tmp_path, capsys):
    recordings = runs(count=6, seconds=2.0)
    spoilt = [jumping(recordings[0]), *recordings[1:]]
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(spoilt))
    found = run(tmp_path, "--equation", "motor", "--quick")
    assert recordings[0].name not in {*found["runs"]["discover"], *found["runs"]["confirm"]}
    assert any("jumps by 0.401 s at 0.699 s" in note for note in found["notes"])


def test_a_diagnosis_without_a_finding_has_a_page(monkeypatch, tmp_path):
    clean = Campaign.of(runs(lambda angle, speed, load: 0.0 * angle, count=9, seconds=5.0))
    monkeypatch.setattr(subject, "open_campaign", lambda *_: clean)
    found = run(tmp_path, "--report", str(tmp_path / "report"), "--equation", "motor", "--quick")
    assert found["findings"] == []
    assert "No unmodelled effect" in (tmp_path / "report/diagnosis.html").read_text()


def test_when_every_clock_jumps_nothing_is_decided(monkeypatch, tmp_path, capsys):
    spoilt = [jumping(r) for r in runs(spring, count=6, seconds=2.0)]
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(spoilt))
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--ledger", str(tmp_path / "l")]
    assert main(words) == 5
    said = capsys.readouterr().err
    assert "its clock jumps" in said
    assert "too few to diagnose" in said


def test_two_paths_are_diagnosed_by_their_periods_and_the_claim_reports_it(monkeypatch, tmp_path):
    def periodic(name, seed):
        one = runs(count=1, seconds=24.0, first_seed=seed)[0]
        time_s = one.time_s
        angle = 0.5 * np.sin(np.pi * time_s) + 0.2 * np.cos(1.5 * np.pi * time_s + seed)
        speed = 35 * np.gradient(angle, time_s)
        load = 0.05 * (1.2 + np.sin(np.pi * time_s / 2 + seed))
        noise = 1e-3 * np.random.default_rng(seed).normal(size=len(one))
        friction = 0.012 * np.tanh(speed / 3) + 2e-5 * np.gradient(speed, time_s)
        return replace(
            one.with_columns(
                motor_angle_rad=35 * angle,
                spindle_angle_rad=angle,
                motor_current_a=(load + friction) / 0.94,
                proximal_torque_n_m=load + noise,
            ),
            name=name,
            conditions={},
        )

    paths = [periodic("one", 1), periodic("two", 2)]
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(paths))
    found = run(tmp_path, "--equation", "motor", "--quick")
    assert len(found["runs"]["discover"]) == len(found["runs"]["confirm"]) == 6
    assert "Two recorded paths only" in found["notes"][0]
    assert found["exploratory"] is False
    assert run(tmp_path, "--equation", "motor", "--quick")["exploratory"] is True


def test_an_unknown_balance_is_a_usage_error(tmp_path, capsys):
    assert main(["diagnose", str(tmp_path), "--equation", "elbow"]) == 2
    assert "elbow" in capsys.readouterr().err


def test_the_published_schema_is_the_one_that_checks():
    assert (ROOT / FILE).read_text() == json_schema()


def finding(verdict: str) -> Finding:
    return Finding("motor", "unknown", verdict, 1.0, 0.5, 3, 4)


@pytest.mark.parametrize(
    ("verdicts", "whole"),
    [
        ([], "nothing_missing"),
        (["identified"], "identified"),
        (["identified", "one_of"], "one_of"),
        (["depends_on", "identified"], "depends_on"),
        (["something_missing", "one_of"], "something_missing"),
    ],
)
def test_the_verdict_is_the_weakest_findings(verdicts, whole):
    diagnosis = Diagnosis(
        tuple(finding(v) for v in verdicts), {}, {}, {}, {}, Sealed((), (), 0, "", "")
    )
    assert diagnosis.verdict == whole
    assert whole in VERDICTS
    found = diagnosis.to_json()
    DiagnosisSchema.model_validate(found)
    assert (found["findings"] == []) == (whole == "nothing_missing")


def test_what_is_not_defined_is_null():
    bad = Finding("motor", "unknown", "something_missing", float("nan"), float("inf"), 0, 0)
    found = Diagnosis((bad,), {}, {}, {}, {}, Sealed((), (), 0, "", "")).to_json()
    assert found["findings"][0]["rmse_before"] is None
    assert found["findings"][0]["rmse_after"] is None
    json.dumps(found, allow_nan=False)
