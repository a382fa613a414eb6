"""`rig calibrate` on the simulated rig: what was put in is found, and nothing is half done."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from calibration.fsr_curve import ZHANG_2022
from calibration.sessions.current import CurrentSession
from calibration.store import CalibrationStore
from rig.calibrate.hands import SimulatedHands
from rig.calibrate.shown import announced
from rig.cli.main import main
from rig.configuration.config import SIMULATED
from rig.importers.registry import open_campaign
from rig.log.convert import write_recording
from rig.simulation.parameters import PlantParameters
from tests.rig.browser import Opened, chromium

pytestmark = pytest.mark.integration


@pytest.fixture
def calibrate(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path)

    def run(*words, yes=True):
        asked = ["--yes"] if yes else []
        code = main(
            ["calibrate", *words, "--operator", "Ada", *asked, "--json", "--store", "store"]
        )
        return code, json.loads(capsys.readouterr().out)

    return run


def by_channel(said):
    return {r["channel"]: r["fit"]["parameters"] for r in said["records"].values()}


def hidden(tmp_path, words):
    path = tmp_path / "hidden.toml"
    path.write_text(SIMULATED.read_text().replace("seed = 0", f"seed = 0\nhidden = {words}"))
    return str(path)


@pytest.mark.parametrize("words", [("--out", "taken"), ("--store", "file/store")])
def test_what_could_not_be_kept_is_refused_before_the_first_weight(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").mkdir()
    (tmp_path / "file").write_text("no folder")
    asked = []
    monkeypatch.setattr(SimulatedHands, "prepare", lambda _, step: asked.append(step))
    assert main(["calibrate", "torque", "--sim", "--yes", "--operator", "Ada", *words]) == 2
    assert not asked


def test_torque_from_weights_to_a_session_that_uses_it(calibrate, tmp_path, capsys):
    code, said = calibrate("torque", "--masses-g", "50,100,150", "--use", "--out", "raw")
    assert code == 0
    assert by_channel(said)["proximal_torque_n_m"]["slope"] == pytest.approx(3.9811e-5, rel=2e-3)
    (record,) = CalibrationStore(tmp_path / "store").active().values()
    assert len(record.raw) == len(list((tmp_path / "raw").glob("*.mcap"))) == 7
    assert record.operator == "Ada"
    assert record.firmware_hash == "00000000"  # weights hang on the fake, built from no sources
    assert record.figure_svg.startswith("<svg xmlns")
    assert main(["cal", "check", "--store", "store"]) == 0
    assert main(["log", "check", "raw"]) == 0
    capsys.readouterr()
    # the same raw logs give the same numbers
    again = calibrate("torque", "--from", "raw", "--out", "again", yes=False)[1]
    assert by_channel(again) == by_channel(said)


def test_a_sensor_that_drifted_since_its_last_calibration_raises_an_alarm(calibrate, tmp_path):
    words = ("torque", "--masses-g", "50,100,150")
    said = calibrate(*words, "--out", "first")[1]
    assert said["drifted"] == []
    (digest,) = said["records"]
    record = CalibrationStore(tmp_path / "store").get(digest)
    parameters = dict(record.fit.parameters)
    parameters["slope"] *= 1.05
    changed = replace(record.fit, parameters=parameters)
    shutil.rmtree(tmp_path / "store")
    CalibrationStore(tmp_path / "store").add(
        replace(record, fit=changed, made_at="2026-01-02T00:00:00+00:00", raw=())
    )
    said = calibrate(*words, "--from", "first", "--out", "second", yes=False)[1]
    (alarm,) = said["drifted"]
    assert "proximal_torque_n_m, slope drifted" in alarm
    page = (tmp_path / "second" / "calibration.html").read_text()
    assert "slope drifted" in page
    assert "history-proximal_torque_n_m-slope" in page
    assert "slope over the last calibrations" in page


def test_the_page_of_a_calibration_draws_without_an_error(calibrate, tmp_path):
    said = calibrate("torque", "--masses-g", "50,100,150", "--out", "raw")[1]
    with chromium() as browser:
        opened = Opened(browser, Path(tmp_path / said["page"]))
        assert opened.messages == []
        assert len(opened.requests) == 1
        assert opened.page.locator("#chart-residuals .point").count() == 7
        opened.close()


def test_recordings_that_exist_verify_an_encoder(tmp_path, capsys):
    """A healthy rig raises no alarm; a spindle encoder mounted 17 degrees off is found."""
    folder = tmp_path / "logs"
    assert main(["record", "--sim", "--protocol", "quick", "-o", str(folder)]) == 0
    capsys.readouterr()
    assert main(["calibrate", "check", str(folder), "--json"]) == 0
    out = json.loads(capsys.readouterr().out)
    assert out["wrong"] == []
    assert [one["encoder"] for one in out["agreements"]] == ["spindle"]
    tared = {"proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"}
    assert {one["channel"] for one in out["zeros"]} == tared
    for one in out["zeros"]:
        assert one["runs"] == 12
        assert 0 < one["within_run"] <= one["limit"]
    (tmp_path / "off").mkdir()
    for handle in open_campaign(folder).runs:
        run = handle.recording()
        angle = run["spindle_angle_rad"] + math.radians(17)
        run = replace(run, columns={**run.columns, "spindle_angle_rad": angle})
        write_recording(tmp_path / "off" / f"{run.name}.mcap", run)
    assert main(["calibrate", "check", str(tmp_path / "off")]) == 1
    said = capsys.readouterr().out
    assert out["agreements"][0]["offset_rad"] == pytest.approx(0.0, abs=math.radians(1))
    assert re.search(r"1[67]\.\d deg off", said)
    assert "rig calibrate encoder --which spindle" in said


def test_current_finds_the_plant(calibrate):
    _, said = calibrate("current", "--loads-a", "0.1,0.5,0.9")
    plant = PlantParameters()
    fit = by_channel(said)["spindle_torque_n_m"]
    gain = plant.torque_constant_n_m_a * plant.gear_ratio
    assert fit["torque_constant_n_m_a"] == pytest.approx(gain, rel=0.01)
    assert fit["friction_n_m"] == pytest.approx(plant.motor_friction_n_m * 35, rel=0.03)
    driver = by_channel(said)["motor_current_a"]
    assert driver["gain_a"] == pytest.approx(plant.command_full_scale_a, rel=0.01)


@pytest.mark.parametrize("strength", [0.0, 1.0])
def test_gearbox_finds_stiffness_and_the_gap_that_is_there(calibrate, tmp_path, strength):
    config = hidden(tmp_path, f"{{ gear_backlash = {strength} }}")
    _, said = calibrate("gearbox", "--config", config)
    fit = by_channel(said)["gear_twist_rad"]
    assert fit["stiffness_n_m_rad"] == pytest.approx(5.4, rel=0.01)
    assert fit["backlash_rad"] == pytest.approx(0.015 * strength, abs=2e-4)
    assert said["found"]["backlash"].startswith("significant" if strength else "not significant")


def test_encoder_finds_the_wave_that_is_there(calibrate, tmp_path):
    config = hidden(tmp_path, "{ jaw_encoder_wave = 1.0 }")
    _, said = calibrate("encoder", "--which", "jaw", "--config", config)
    assert said["found"]["wave"] == "17 periods per turn"
    assert said["found"]["wave_amplitude_rad"] == pytest.approx(5e-3, rel=0.05)


def test_ft_finds_the_tool_and_reads_the_devices_counts(calibrate):
    _, said = calibrate("ft", "--jaw-mm", "0,0,300")
    tool = by_channel(said)["contact_wrench"]
    assert tool["mass_kg"] == pytest.approx(0.215, rel=1e-3)
    assert tool["centre_z_m"] == pytest.approx(0.031, abs=1e-4)
    assert tool["jaw_z_m"] == 0.3
    assert said["found"]["counts_per_n"] == pytest.approx(1e6)


def test_fsr_finds_the_cubic_its_hysteresis_and_its_creep(calibrate):
    _, said = calibrate("fsr", "--presses", "5", "--hold-s", "15")
    fit = by_channel(said)["fsr_force_n"]
    assert said["found"]["degree"] == "3"
    found = [fit[f"c{k}"] for k in range(4)]
    # what a single curve cannot hold is modelled, and some of it is left in the coefficients
    for volts in (0.2, 0.5, 0.8):
        force = sum(c * volts**k for k, c in enumerate(found))
        assert force == pytest.approx(float(ZHANG_2022.force_n(volts)), abs=0.03)
    assert said["found"]["loading_gap"] == "modelled"
    assert fit["creep_ratio"] == pytest.approx(0.01, rel=0.1)
    assert said["found"]["held_out_rmse_with_gap_n"] < 0.6 * said["found"]["held_out_rmse_n"]


def test_a_refused_or_unattended_session_leaves_nothing(calibrate, tmp_path):
    code, said = calibrate("torque", "--masses-g", "50,100,150", "--arm-mm", "0.001")
    assert code == 5
    assert "changes by" in said["error"]["what"]
    code, said = calibrate("torque", yes=False)
    assert code == 2
    assert "not a terminal" in said["error"]["what"]
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_leaves_nothing(calibrate, tmp_path, monkeypatch):
    prepare, seen = SimulatedHands.prepare, []

    def interrupted(self, step):
        seen.append(step.name)
        if len(seen) == 4:
            raise KeyboardInterrupt
        prepare(self, step)

    monkeypatch.setattr(SimulatedHands, "prepare", interrupted)
    assert main(["calibrate", "torque", "--operator", "Ada", "--yes"]) == 130
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def typed(monkeypatch, tmp_path, capsys):
    """Answer the questions of a torque session with what is given, one answer a question."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)

    def run(answers, *words):
        given = iter(answers)
        monkeypatch.setattr("builtins.input", lambda: next(given))
        how = ["--operator", "Ada", "--store", "store", "--masses-g", "50,100,150"]
        code = main(["calibrate", "torque", *how, *words])
        return code, *capsys.readouterr()

    return run


def test_a_person_sees_each_reading_and_can_go_back(typed):
    answers = ["", "", "banana", "", "b", *[""] * 5]
    code, out, err = typed(answers, "--out", "raw")
    assert code == 0
    first = err.index("Calibration of torque: 7 steps with the logger, 7 of them set up by hand")
    assert first < err.index("The rig does not move by itself.") < err.index("1/7")
    assert err.count("3/7") == 2  # the third step was measured again
    assert "counts, +0." in err or "counts, -0." in err
    assert "of the range off the line so far" in err
    assert "'banana' is none of these" in err
    assert len(list(Path("raw").glob("*.mcap"))) == 7
    assert "slope 39.8" in out
    assert "uN m a count" in out
    assert "Good" in out


def test_a_stopped_session_goes_on_where_it_was(typed):
    code, _, err = typed(["", "", "", "q"])
    assert code == 5
    assert "3 of 7 steps are kept" in err
    (folder,) = Path("logs").glob("*-unfinished-torque")
    code, _, err = typed([""] * 4, "--resume", str(folder), "--out", "raw")
    assert code == 0
    assert "4/7" in err
    assert "3/7" not in err
    assert len(list(Path("raw").glob("*.mcap"))) == 7
    code, _, err = typed([], "--resume", str(folder), "--arm-mm", "90")
    assert code == 2
    assert "other steps" in err


@pytest.mark.parametrize(
    "words", [["--masses-g", "50,100"], ["--sensor", "middle"], ["--operator", " "]]
)
def test_what_cannot_be_calibrated_is_reported_before_the_first_weight(typed, words):
    code, _, err = typed([], *words)
    assert code == 2
    assert "1/" not in err


def test_raw_logs_of_another_kind_are_refused(calibrate):
    calibrate("ft", "--out", "raw")
    code, said = calibrate("torque", "--from", "raw")
    assert code == 2
    assert said["error"]["fix"] == "Type `rig calibrate ft`."
    shutil.rmtree("raw")
    code, said = calibrate("ft", "--from", "raw")
    assert code == 2


def test_a_zero_that_moves_within_a_run_is_an_alarm(tmp_path, capsys):
    assert main(["config", "show", "--sim"]) == 0
    tight = tmp_path / "tight.toml"
    text = capsys.readouterr().out
    tight.write_text(re.sub(r"(\[drift\][^[]*motor_current_a = )\S+", r"\g<1>1e-6", text))
    folder = tmp_path / "logs"
    assert main(["record", "-c", str(tight), "--protocol", "quick", "-o", str(folder)]) == 1
    assert main(["calibrate", "check", str(folder)]) == 1
    said = capsys.readouterr().out
    assert "ALARM: zero of motor_current_a" in said
    assert "good: zero of distal_torque_n_m" in said


def test_a_session_that_moves_the_rig_states_how_far():
    _, moving, *_ = announced(CurrentSession())
    assert moving.startswith("The rig moves by itself: the spindle turns between")
