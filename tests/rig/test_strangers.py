"""Machines that nobody has, from a table to a named effect in a model that runs live."""

import json
import math

import pytest

from rig.diagnosis.schema import DiagnosisSchema
from tests.rig.strangers import ARM, AXIS, DRIVE, arm_table, axis_table, drive_table

pytestmark = pytest.mark.integration


@pytest.fixture
def run(tmp_path, monkeypatch, said):
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    return lambda *words, code=0: said(*words, code=code).out


@pytest.fixture
def diagnosed(run):
    """Diagnose a table by a machine file, both in the folder of the test."""
    return lambda name, words="": json.loads(
        run(f"diagnose {name}.csv --quick --json --machine {name}.toml {words}")
    )


@pytest.mark.parametrize(
    ("hidden", "found"),
    [
        pytest.param({}, [], marks=pytest.mark.long),
        pytest.param({"rubs": 0.08}, [("input", "friction.load")], marks=pytest.mark.long),
        ({"lost_rad": 0.003}, [("belt", "transmission.backlash")]),
        ({"wave_rad": 0.002}, [("belt", "ripple.output")]),  # of the input's pulley
    ],
)
def test_a_drive_of_another_ratio_goes_from_table_to_export(run, tmp_path, hidden, found):
    (tmp_path / "drive.toml").write_text(DRIVE.replace("RATIO", "12.5"))
    (tmp_path / "tables").mkdir()
    drive_table(tmp_path / "tables" / "trials.csv", 12.5, **hidden)
    run("import tables --machine drive.toml --out runs")
    run("fit runs --machine drive.toml --out fitted.toml")
    words = "--quick --machine drive.toml --model-out model.toml --json"
    told = json.loads(run("diagnose runs", words))
    named = [f for f in told["findings"] if f["verdict"] in ("identified", "one_of")]
    assert [(f["balance"], f["family"]) for f in named] == found  # the likeliest of a set
    # the acceleration of a wave does not show in this torque, so the wave may be the encoder's
    others = {other for f in named for other in f["alternatives"]}
    assert others <= {"sensor.encoder_inl"}
    DiagnosisSchema.model_validate(told)  # the names of anyone's equations and angles
    words = "--machine drive.toml --model model.toml --speed 0 --json"
    assert "cell_torque_n_m" in run("replay runs", words)
    run("export model.toml --equation input --out input.h")
    assert "cell_torque" in (tmp_path / "input.h").read_text()


def test_a_noise_that_the_recordings_contradict_is_named(run, tmp_path):
    drive_table(tmp_path / "trials.csv", runs=3)
    text = DRIVE.replace("RATIO", "35.0").replace("noise = 0.01", "noise = 0.1")
    (tmp_path / "drive.toml").write_text(text)
    printed = run("machine check drive.toml trials.csv", code=1)
    assert "states a noise of 0.1 N m for cell_torque_n_m" in printed


@pytest.mark.long
def test_an_axis_driven_by_pwm_is_diagnosed_in_units_of_its_drive(run, diagnosed, tmp_path):
    (tmp_path / "axis.toml").write_text(AXIS)
    axis_table(tmp_path / "axis.csv", asymmetry=0.03)
    printed = run("machine check axis.toml axis.csv")
    assert "Needed: A sensor of effort (N) on one of gantry." in printed
    told = diagnosed("axis")
    (finding,) = told["findings"]
    assert finding["family"] == "friction.viscous_asymmetry"
    assert finding["parameters"]["asymmetry"]["value"] == pytest.approx(0.03, rel=0.1)
    assert any("gantry_acceleration_m_s2 is noise of its reading" in note for note in told["notes"])


def test_a_force_that_repeats_along_an_axis_has_a_period(diagnosed, tmp_path):
    (tmp_path / "axis.toml").write_text(AXIS)
    axis_table(tmp_path / "axis.csv", cogging=0.02)
    told = diagnosed("axis")
    (finding,) = told["findings"]
    assert (finding["family"], finding["depends_on"]) == ("ripple.motor", ["gantry_position"])
    period_m = 2 * math.pi / finding["parameters"]["order"]["value"]
    assert period_m == pytest.approx(0.012, rel=0.01)
    low, high = finding["parameters"]["order"]["ci95"]
    assert low <= finding["parameters"]["order"]["value"] <= high


@pytest.mark.parametrize(
    ("parameter", "value", "speed"),
    [("friction", 0.003, "velocity_sign"), ("damping", 0.015, "velocity")],
)
def test_friction_follows_a_temperature_that_the_machine_states(
    diagnosed, tmp_path, parameter, value, speed
):
    sensor = '[[sensor]]\nname = "rail_temperature_k"\nreads = "temperature"\n\n[data]\n'
    column = '[data.columns]\nrail_temperature_k = "warm:degC"\n'
    text = AXIS.replace("[data]\n", sensor, 1).replace("[data.columns]\n", column)
    # at the usual 50 Hz the acceleration of this encoder is mostly noise
    text = text.replace("[machine]\n", "[machine]\ncutoff_hz = 15\n")
    (tmp_path / "axis.toml").write_text(text)
    axis_table(tmp_path / "axis.csv", warming=parameter)
    (finding,) = diagnosed("axis", "--model-out model.toml")["findings"]
    assert finding["family"] == "friction.warmup"
    assert finding["depends_on"] == [speed, "temperature"]
    assert finding["parameters"][parameter]["value"] == pytest.approx(value, rel=0.1)
    assert "rail_temperature_k" in (tmp_path / "model.toml").read_text()


@pytest.mark.long
def test_joints_under_gravity_depend_on_their_angles_and_those_of_other_joints(diagnosed, tmp_path):
    """Slow motion under gravity fits an inertia of the wrong sign, which a cause may change."""
    (tmp_path / "arm.toml").write_text(ARM)
    arm_table(tmp_path / "arm.csv")
    found = {finding["balance"]: finding for finding in diagnosed("arm")["findings"]}
    assert found.keys() == {"shoulder", "elbow"}
    assert found["shoulder"]["family"] == "gravity.payload"
    assert found["shoulder"]["parameters"]["sine"]["value"] == pytest.approx(10.0, rel=0.05)
    assert found["elbow"]["verdict"] == "depends_on"
    assert sorted(found["elbow"]["depends_on"]) == ["elbow_angle", "shoulder_angle"]
