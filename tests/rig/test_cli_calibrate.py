"""`rig calibrate` on the simulated rig: what was put in is found, and nothing is half done."""

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
from rig.configuration.config import SIMULATED
from rig.importers.registry import open_campaign
from rig.log.convert import write_recording
from rig.simulation.parameters import PlantParameters
from tests.rig.browser import Opened, chromium

pytestmark = pytest.mark.integration


@pytest.fixture
def calibrate(tmp_path, monkeypatch, answered):
    """Calibrate the simulated rig, by default with a yes to each question."""
    monkeypatch.setenv("RIG_CALIBRATIONS", str(tmp_path / "store"))
    monkeypatch.chdir(tmp_path)
    how = "--operator Ada --store store"
    return lambda *words, asked="--yes", code=0: answered(
        "calibrate", *words, how, asked, code=code
    )


def by_channel(said):
    return {r["channel"]: r["fit"]["parameters"] for r in said["records"].values()}


def hidden(tmp_path, words):
    path = tmp_path / "hidden.toml"
    path.write_text(SIMULATED.read_text().replace("seed = 0", f"seed = 0\nhidden = {words}"))
    return path


@pytest.mark.parametrize("words", ["--out taken", "--store file/store"])
def test_what_could_not_be_kept_is_refused_before_the_first_weight(
    words, tmp_path, monkeypatch, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").mkdir()
    (tmp_path / "file").write_text("no folder")
    asked = []
    monkeypatch.setattr(SimulatedHands, "prepare", lambda _, step: asked.append(step))
    said("calibrate torque --sim --yes --operator Ada", words, code=2)
    assert not asked


WEIGHTS = "torque --masses-g 50,100,150"


def test_torque_from_weights_to_a_session_that_uses_it(calibrate, tmp_path, said):
    told = calibrate(WEIGHTS, "--use --out raw")
    assert by_channel(told)["proximal_torque_n_m"]["slope"] == pytest.approx(3.9811e-5, rel=2e-3)
    (record,) = CalibrationStore(tmp_path / "store").active().values()
    assert len(record.raw) == len(list((tmp_path / "raw").glob("*.mcap"))) == 7
    assert record.operator == "Ada"
    assert record.firmware_hash == "00000000"  # weights hang on the fake, built from no sources
    assert record.figure_svg.startswith("<svg xmlns")
    said("calibrate check --store store")
    said("log check raw")
    # the same raw logs give the same numbers
    again = calibrate("torque --from raw --out again", asked="")
    assert by_channel(again) == by_channel(told)


def test_a_sensor_that_drifted_since_its_last_calibration_raises_an_alarm(calibrate, tmp_path):
    assert calibrate(WEIGHTS, "--out first")["drifted"] == []
    store = CalibrationStore(tmp_path / "store")
    (record,) = store.records()
    slope = record.fit.parameters["slope"]
    off = replace(record.fit, parameters={**record.fit.parameters, "slope": 1.05 * slope})
    shutil.rmtree(store.folder)
    store.add(replace(record, fit=off, made_at="2026-01-02T00:00:00+00:00", raw=()))
    (alarm,) = calibrate(WEIGHTS, "--from first --out second", asked="")["drifted"]
    assert "proximal_torque_n_m, slope drifted" in alarm
    page = (tmp_path / "second" / "calibration.html").read_text()
    for part in ("slope drifted", "history-proximal_torque_n_m-slope", "slope over the last cal"):
        assert part in page


def test_the_page_of_a_calibration_draws_without_an_error(calibrate, tmp_path):
    said = calibrate(WEIGHTS, "--out raw")
    with chromium() as browser:
        opened = Opened(browser, Path(tmp_path / said["page"]))
        assert opened.messages == []
        assert len(opened.requests) == 1
        assert opened.page.locator("#chart-residuals .point").count() == 7
        opened.close()


def test_recordings_that_exist_verify_an_encoder(tmp_path, said, answered):
    """A healthy rig raises no alarm; a spindle encoder mounted 17 degrees off is found."""
    folder = tmp_path / "logs"
    said("record --sim --protocol quick -o", folder)
    out = answered("calibrate check", folder)
    assert out["wrong"] == []
    (agreement,) = out["agreements"]
    assert agreement["encoder"] == "spindle"
    assert agreement["offset_rad"] == pytest.approx(0.0, abs=math.radians(1))
    tared = {"proximal_torque_n_m", "distal_torque_n_m", "motor_current_a"}
    assert {one["channel"] for one in out["zeros"]} == tared
    for one in out["zeros"]:
        assert one["runs"] == 12
        assert 0 < one["within_run"] <= one["limit"]
    (tmp_path / "off").mkdir()
    for run in open_campaign(folder):
        off = run.with_columns(spindle_angle_rad=run["spindle_angle_rad"] + math.radians(17))
        write_recording(tmp_path / "off" / f"{run.name}.mcap", off)
    printed = said("calibrate check", tmp_path / "off", code=1).out
    assert re.search(r"1[67]\.\d deg off", printed)
    assert "rig calibrate encoder --which spindle" in printed


def test_current_finds_the_plant(calibrate):
    said = calibrate("current --loads-a 0.1,0.5,0.9")
    plant, fits = PlantParameters(), by_channel(said)
    torque = fits["spindle_torque_n_m"]
    assert torque["torque_constant_n_m_a"] == pytest.approx(plant.torque_constant_n_m_a * 35, 0.01)
    assert torque["friction_n_m"] == pytest.approx(plant.motor_friction_n_m * 35, rel=0.03)
    gain_a = fits["motor_current_a"]["gain_a"]
    assert gain_a == pytest.approx(plant.command_full_scale_a, rel=0.01)


@pytest.mark.parametrize("strength", [0.0, 1.0])
def test_gearbox_finds_stiffness_and_the_gap_that_is_there(calibrate, tmp_path, strength):
    config = hidden(tmp_path, f"{{ gear_backlash = {strength} }}")
    said = calibrate("gearbox --config", config)
    fit = by_channel(said)["gear_twist_rad"]
    assert fit["stiffness_n_m_rad"] == pytest.approx(5.4, rel=0.01)
    assert fit["backlash_rad"] == pytest.approx(0.015 * strength, abs=2e-4)
    assert said["found"]["backlash"].startswith("significant" if strength else "not significant")


def test_encoder_finds_the_wave_that_is_there(calibrate, tmp_path):
    config = hidden(tmp_path, "{ jaw_encoder_wave = 1.0 }")
    said = calibrate("encoder --which jaw --config", config)
    assert said["found"]["wave"] == "17 periods per turn"
    assert said["found"]["wave_amplitude_rad"] == pytest.approx(5e-3, rel=0.05)


def test_ft_finds_the_tool_and_reads_the_devices_counts(calibrate):
    said = calibrate("ft --jaw-mm 0,0,300")
    tool = by_channel(said)["contact_wrench"]
    assert tool["mass_kg"] == pytest.approx(0.215, rel=1e-3)
    assert tool["centre_z_m"] == pytest.approx(0.031, abs=1e-4)
    assert tool["jaw_z_m"] == 0.3
    assert said["found"]["counts_per_n"] == pytest.approx(1e6)


def test_fsr_finds_the_cubic_its_hysteresis_and_its_creep(calibrate):
    said = calibrate("fsr --presses 5 --hold-s 15")
    fit = by_channel(said)["fsr_force_n"]
    assert said["found"]["degree"] == "3"
    # what a single curve cannot hold is modelled, and some of it is left in the coefficients
    for volts in (0.2, 0.5, 0.8):
        force = sum(fit[f"c{k}"] * volts**k for k in range(4))
        assert force == pytest.approx(float(ZHANG_2022.force_n(volts)), abs=0.03)
    assert said["found"]["loading_gap"] == "modelled"
    assert fit["creep_ratio"] == pytest.approx(0.01, rel=0.1)
    assert said["found"]["held_out_rmse_with_gap_n"] < 0.6 * said["found"]["held_out_rmse_n"]


def test_a_refused_or_unattended_session_leaves_nothing(calibrate, tmp_path):
    said = calibrate(WEIGHTS, "--arm-mm 0.001", code=5)
    assert "changes by" in said["error"]["what"]
    assert "not a terminal" in calibrate("torque", asked="", code=2)["error"]["what"]
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_leaves_nothing(calibrate, tmp_path, monkeypatch, said):
    prepare, seen = SimulatedHands.prepare, []

    def interrupted(self, step):
        seen.append(step.name)
        if len(seen) == 4:
            raise KeyboardInterrupt
        prepare(self, step)

    monkeypatch.setattr(SimulatedHands, "prepare", interrupted)
    said("calibrate torque --operator Ada --yes", code=130)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def typed(monkeypatch, tmp_path, said):
    """Answer the questions of a torque session with what is given, one answer a question."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)

    def run(answers, *words, code=0):
        given = iter(answers)
        monkeypatch.setattr("builtins.input", lambda: next(given))
        return said("calibrate", WEIGHTS, "--operator Ada --store store", *words, code=code)

    return run


def test_a_person_sees_each_reading_and_can_go_back(typed):
    answers = ["", "", "banana", "", "b", *[""] * 5]
    out, err = typed(answers, "--out raw")
    first = err.index("Calibration of torque: 7 steps with the logger, 7 of them set up by hand")
    assert first < err.index("The rig does not move by itself.") < err.index("1/7")
    assert err.count("3/7") == 2  # the third step was measured again
    assert re.search(r"counts, [+-]0\.\d+% of the range off the line so far", err)
    assert "'banana' is none of these" in err
    assert len(list(Path("raw").glob("*.mcap"))) == 7
    for part in ("slope 39.8", "uN m a count", "Good"):
        assert part in out


def test_a_stopped_session_goes_on_where_it_was(typed):
    assert "3 of 7 steps are kept" in typed(["", "", "", "q"], code=5).err
    (folder,) = Path("logs").glob("*-unfinished-torque")
    err = typed([""] * 4, "--out raw --resume", folder).err
    assert "4/7" in err
    assert "3/7" not in err
    assert len(list(Path("raw").glob("*.mcap"))) == 7
    assert "other steps" in typed([], "--arm-mm 90 --resume", folder, code=2).err


@pytest.mark.parametrize("words", ["--masses-g 50,100", "--sensor middle", "--operator ' '"])
def test_what_cannot_be_calibrated_is_reported_before_the_first_weight(typed, words):
    assert "1/" not in typed([], words, code=2).err


def test_raw_logs_of_another_kind_are_refused(calibrate):
    calibrate("ft --out raw")
    said = calibrate("torque --from raw", code=2)
    assert said["error"]["fix"] == "Type `rig calibrate ft`."
    shutil.rmtree("raw")
    calibrate("ft --from raw", code=2)


def test_a_zero_that_moves_within_a_run_is_an_alarm(tmp_path, said):
    text = said("config show --sim").out
    tight, folder = tmp_path / "tight.toml", tmp_path / "logs"
    tight.write_text(re.sub(r"(\[drift\][^[]*motor_current_a = )\S+", r"\g<1>1e-6", text))
    said("record --protocol quick -c", tight, "-o", folder, code=1)
    printed = said("calibrate check", folder, code=1).out
    assert "ALARM: zero of motor_current_a" in printed
    assert "good: zero of distal_torque_n_m" in printed


def test_a_session_that_moves_the_rig_states_how_far():
    assert "itself: the spindle turns between" in announced(CurrentSession())[1]
