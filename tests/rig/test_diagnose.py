"""`rig diagnose` from a path to JSON, report, model file and ledger."""

import io
import json
import re
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimation import model_file
from estimation.campaign import Campaign
from estimation.diagnosis.split import cut_and_split
from estimation.estimator import load
from estimation.recording import Recording
from rig.cli.main import main
from rig.diagnosis import subject
from rig.diagnosis.ledger import Ledger, look_at
from rig.diagnosis.run import run_diagnosis
from rig.diagnosis.schema import DiagnosisSchema
from tests.estimation.synthetic import runs, spring
from tests.rig.simulated import protocol_file

pytestmark = pytest.mark.long


def run(folder: Path, *words: str) -> dict[str, Any]:
    out, ledger = folder / "diagnosis.json", str(folder / "looks.jsonl")
    whole = ["diagnose", str(folder), "--json-out", str(out), "--ledger", ledger, *words]
    assert main(whole) == 0
    return json.loads(out.read_text())


@dataclass(frozen=True)
class Whole:
    """One diagnosis of recordings that lack a spring: folder, JSON, what is printed, result."""

    recordings: list[Recording]
    folder: Path
    found: dict[str, Any]
    printed: str
    done: Any


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    recordings, folder, done = runs(spring, count=9, seconds=5.0), tmp_path_factory.mktemp("d"), []

    def kept(*words, **options):
        done.append(run_diagnosis(*words, **options))
        return done[-1]

    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as printed:
        patch.setattr(subject, "open_campaign", lambda *_: Campaign.of(recordings))
        patch.setattr("rig.diagnosis.run.run_diagnosis", kept)
        outputs = ["--model-out", str(folder / "model.toml"), "--report", str(folder / "report")]
        found = run(folder, "--equation", "motor", *outputs)
    return Whole(recordings, folder, found, printed.getvalue(), *done)


@pytest.fixture
def campaign(whole, monkeypatch):
    monkeypatch.setattr(subject, "open_campaign", lambda *_: Campaign.of(whole.recordings))


@pytest.fixture
def done(whole, campaign, monkeypatch):
    """Every diagnosis is the one that was computed."""
    monkeypatch.setattr("rig.diagnosis.run.run_diagnosis", lambda *_, **__: whole.done)


def test_a_diagnosis_leaves_json_report_and_model(whole):
    found = whole.found
    DiagnosisSchema.model_validate(found)
    (finding,) = found["findings"]
    assert finding["family"] == "spring.position"
    # few short runs of one equation cannot exclude these
    others = {"hysteresis.presliding", "sensor.crosstalk", "gravity.payload"}
    assert set(finding["alternatives"]) <= others
    assert finding["rmse_after"] < 0.2 * finding["rmse_before"]
    assert finding["runs_improved"] == finding["runs_total"] == len(found["runs"]["confirm"])
    stiffness = finding["parameters"]["stiffness"]
    # a spring subtracts from the target of this equation, so its stiffness is positive there
    assert stiffness["value"] == pytest.approx(0.02, rel=0.05)  # along the spindle's angle
    assert stiffness["ci95"][0] <= stiffness["value"] <= stiffness["ci95"][1]
    assert stiffness["unit"] == "N m/rad"
    assert found["verdict"] == ("one_of" if finding["alternatives"] else "identified")
    assert (found["next_experiment"] is None) == (not finding["alternatives"])
    assert found["exploratory"] is False
    assert found["rmse_after"]["motor"] < found["rmse_before"]["motor"]
    written = model_file.read(whole.folder / "model.toml")
    assert "spring.position" in {t.effect.id for t in written.terms}
    # as after `rig fit`, a watch and a display know at once what is usual
    assert list(written.evidence.runs) == found["runs"]["discover"]
    assert written.evidence.rmse == pytest.approx(found["rmse_after"]["motor"], rel=0.5)
    assert written.evidence.made_at
    page = (whole.folder / "report/diagnosis.html").read_text()
    charts = ("residual over ", "error of each held-out test run", "measured and estimated")
    parts = [f"motor: {chart}" for chart in charts]
    parts += ["Parameters of the findings", "Probability of each name", "What to check"]
    parts += ["Declared parameters: motor", "Next experiment", "[spring.position]"]
    assert [part for part in parts if part not in page] == []
    assert "[spring.position]" in whole.printed


def test_the_written_model_runs_live_with_the_error_that_is_reported(whole):
    estimator = load(whole.folder / "model.toml")
    (one, *_) = [r for r in whole.recordings if r.name in whole.found["runs"]["confirm"]]
    stepper = estimator.stepper(one.sample_rate_hz)
    parts = [slice(k, k + 64) for k in range(0, len(one), 64)]
    live = np.concatenate(
        [stepper.step(one.time_s[p], {c: v[p] for c, v in one.columns.items()}) for p in parts]
    )
    assert live == pytest.approx(estimator.predict(one, causal=True), rel=1e-12, abs=1e-14)
    (note,) = [n for n in whole.found["notes"] if "causal" in n]
    zero_phase, causal, shown = (float(n) for n in re.findall(r"([\d.]+) mN m", note))
    assert zero_phase == pytest.approx(1e3 * whole.found["rmse_after"]["motor"], rel=0.01)
    assert shown > causal > zero_phase


def test_a_second_look_at_the_same_runs_is_exploratory_with_any_seed(whole, campaign, tmp_path):
    ledger = tmp_path / "looks.jsonl"
    ledger.write_text((whole.folder / "looks.jsonl").read_text())
    assert run(tmp_path, "--equation", "motor", "--quick", "--seed", "5")["exploratory"] is True
    assert len(ledger.read_text().splitlines()) == 2


@pytest.mark.usefixtures("done")
def test_a_diagnosis_that_leaves_nothing_does_not_use_up_the_runs(monkeypatch, tmp_path, said):
    """A fault while its page is made, after the held-out runs were opened."""

    def broken(*_: object) -> str:
        raise ValueError("no page")

    monkeypatch.setattr("rig.reports.diagnosis.page", broken)
    ledger = tmp_path / "looks.jsonl"
    words = ("diagnose --equation motor", tmp_path, "--ledger", ledger)
    said(*words, "--report", tmp_path, code=70)
    assert not ledger.exists()


@pytest.mark.usefixtures("done")
def test_a_reader_that_leaves_early_has_the_files(monkeypatch, tmp_path):
    class Left(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr("sys.stdout", Left())
    out, ledger = tmp_path / "diagnosis.json", tmp_path / "looks.jsonl"
    words = ["diagnose", str(tmp_path), "--equation", "motor", "--ledger", str(ledger)]
    main([*words, "--json-out", str(out)])
    assert json.loads(out.read_text())["schema"] == "rig.diagnosis/1"
    assert len(ledger.read_text().splitlines()) == 1


def test_every_equation_that_is_decided_goes_into_the_model_file(campaign, tmp_path):
    path = tmp_path / "found.model.toml"
    found = run(tmp_path, "--model-out", str(path), "--quick")
    assert set(found["undecided"]) == {"stretch"}  # no jaw encoder
    decided = [m.balance for m in model_file.read_all(path)]
    assert decided == list(found["unit"]) == ["motor", "gearbox", "cable"]


def test_campaigns_keep_their_diagnoses_and_are_diagnosed_once(
    tmp_path, monkeypatch, said, answered
):
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    root = tmp_path / "logs"
    for k, protocol in enumerate(("quick", "quick", protocol_file(tmp_path, duration_s=4.0))):
        said(f"record --sim --seed {k} -p", protocol, "-o", root / f"day-{k}")
    pages = [root / name / "diagnosis/diagnosis.html" for name in ("day-0", "day-1")]
    printed = said("diagnose --equation motor --quick", root / "day-0").out
    assert f"Report: {pages[0]}" in printed.replace("\n", "")
    made = pages[0].stat().st_mtime_ns
    rows = answered("campaigns --diagnose --root", root)["campaigns"]
    failed = {Path(row["folder"]).name: row["failed"] for row in rows}
    assert "too few" in failed.pop("day-2")
    assert failed == {"day-0": "", "day-1": ""}
    assert all(page.read_text().startswith("<!DOCTYPE html>") for page in pages)
    assert len((tmp_path / "state/looks.jsonl").read_text().splitlines()) == len(pages)
    assert pages[0].stat().st_mtime_ns == made  # newer than its logs
    made = pages[1].stat().st_mtime_ns
    again = answered("campaigns --diagnose --root", root)["campaigns"]
    assert again == rows  # a second call has nothing to do
    assert pages[1].stat().st_mtime_ns == made
    listed = answered("campaigns --root", root)["campaigns"]
    assert sum(bool(one["diagnosis"]) for one in listed) == len(pages)


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
    ledger = Ledger(tmp_path / "looks.jsonl")
    ledger.enter(look_at(paths, cut_and_split(paths)[1]))
    found = run(tmp_path, "--equation", "motor", "--quick")
    assert len(found["runs"]["discover"]) == len(found["runs"]["confirm"]) == 6
    assert "Two recorded paths only" in found["notes"][0]
    assert found["exploratory"] is True
    assert any(
        note.startswith("Exploratory: 6 of the 6 test runs were used by an earlier diagnosis: ")
        for note in found["notes"]
    )


def test_a_protocol_shows_which_effects_its_runs_distinguish(answered):
    plan = answered("diagnose --plan quick --equation motor")
    assert (plan["source"], plan["runs"]) == ("quick", 12)
    chance = {(e["place"], e["family"]): e["probability"] for e in plan["effects"]}
    assert chance["motor", "ripple.motor"] > chance["motor", "hysteresis.bouc_wen"]
