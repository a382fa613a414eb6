"""The exported header is compiled and held against the estimator it was made of."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import model_file
from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.effects import effect
from estimation.estimator import rows_of
from estimation.estimators.bank import BankEstimator, BankRecipe
from estimation.estimators.c_header import ExportError, header, refused
from estimation.estimators.c_model import NotInCError
from estimation.estimators.model import ModelEstimator
from estimation.estimators.network import NetworkEstimator
from estimation.fitting import fit
from estimation.live_channels import causal_channels
from estimation.model import Estimate, Model, Term, predict
from estimation.networks.network import Network
from estimation.plant import Sensor
from estimation.plant_models import declared
from estimation.predicted import predicted_of, with_prediction
from estimation.recording import Recording
from rig.live.estimator import LiveEstimator
from rig.live.status import ModelStatus
from rig.machines.recordings import with_positions
from tests.estimation.test_plant import SLIDE, slide

TARGET = "proximal_torque_n_m"
COMPILER = shutil.which("cc") or shutil.which("gcc")
pytestmark = [pytest.mark.integration, pytest.mark.skipif(COMPILER is None, reason="no C compiler")]

MAIN = """
#include <stdio.h>
#include "grip.h"
static grip_state state;
int main(void) {
    double measured[GRIP_MEASURED];
    grip_start(&state);
    while (fread(measured, sizeof measured, 1, stdin) == 1) {
        grip_estimate e = grip_step(&state, measured);
        float out[3] = {e.value, e.half_width, (float)e.valid};
        fwrite(out, sizeof out, 1, stdout);
    }
    return 0;
}
"""


def compiled(estimator, run: Recording, folder, channels=None) -> np.ndarray:
    """Return value, half width and validity of each sample as the compiled header gives them."""
    (folder / "grip.h").write_text(header(estimator, "grip", run.sample_rate_hz))
    (folder / "main.c").write_text(MAIN)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    command = [COMPILER, *flags, "main.c", "-o", "main", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    stepper = estimator.stepper(run.sample_rate_hz)
    samples = np.column_stack([run[name] for name in channels or stepper.channels])
    done = subprocess.run(
        [folder / "main"], input=samples.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, np.float32).reshape(-1, 3)


def checked(model: Model, run: Recording, folder) -> tuple[np.ndarray, np.ndarray]:
    """Return what a model's compiled header gives, and the estimates, which it gives as well."""
    found, wanted = compiled(ModelEstimator(model), run, folder), predict(model, run, causal=True)
    assert np.abs(found[:, 0] - wanted).max() <= 1e-4 * np.abs(wanted).max()
    return found, wanted


@pytest.fixture(scope="module")
def bank(runs) -> BankEstimator:
    return BankRecipe(TARGET, Bank("motor_current_a"), causal=True).fit(Campaign.of(runs[1:]))


@pytest.mark.parametrize("beyond_rad", [0.0, 1.0])
def test_the_compiled_state_estimator_gives_the_same(bank, runs, tmp_path, beyond_rad):
    run = runs[0].with_columns(spindle_angle_rad=runs[0]["spindle_angle_rad"] + beyond_rad)
    found, wanted = compiled(bank, run, tmp_path), bank.estimate(run, causal=True)
    assert np.abs(found[:, 0] - wanted.value).max() <= 1e-5 * np.abs(wanted.value).max()
    np.testing.assert_allclose(found[:, 1], wanted.half_width, rtol=1e-4)
    assert np.mean(found[:, 2] == wanted.inside) > 0.999  # a sample may lie on a bound


def test_a_fast_wave_is_the_same_in_c_and_live(tmp_path):
    """The filter passes the less of it the faster the carriage is."""
    (carriage,) = declared(SLIDE)
    values = {"order": 2500.0, "sine": 6.0, "cosine": 1.0}
    wave = Term(
        effect("ripple.motor"),
        channels={"motor_angle": "carriage_position_m"},
        values={name: Estimate(x) for name, x in values.items()},
    )
    model, run = replace(carriage, terms=(wave,)), slide(0)
    _, wanted = checked(model, run, tmp_path)
    stream = ModelEstimator(model).stepper(run.sample_rate_hz)
    found = stream.step(run.time_s, {c: run[c] for c in stream.channels})
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
    phase = (
        2500.0
        * causal_channels(run, ["carriage_position_m"], model.low_pass)["carriage_position_m"]
    )
    whole = 6.0 * np.sin(phase) + np.cos(phase)
    assert np.std(wanted) < 0.9 * np.std(whole)


def test_a_compiled_model_of_any_machine_gives_the_same(tmp_path):
    (carriage,) = declared(SLIDE)
    runs = [slide(k) for k in range(3)]
    fitted = fit(carriage, Campaign.of(runs), bootstrap=0)
    fitted = replace(fitted, evidence=replace(fitted.evidence, half_width=3.0))
    asymmetric = Term(
        effect("friction.viscous_asymmetry"),
        1,
        {"speed": "carriage_velocity_m_s"},
        {p.name: Estimate(30.0) for p in effect("friction.viscous_asymmetry").amplitudes},
    )
    model = replace(fitted, terms=(*fitted.terms, asymmetric))
    position = runs[0]["carriage_position_m"] * np.linspace(1.0, 1.5, len(runs[0]))
    run = runs[0].with_columns(carriage_position_m=position)  # it goes further than any run fitted
    found, wanted = checked(model, run, tmp_path)
    ((speed, slowest),) = model.signals.rest.items()
    live = causal_channels(run, [speed], model.low_pass)[speed]
    at_rest = np.isnan(found[:, 1])
    assert 0 < at_rest.sum() == np.sum(np.abs(live) < slowest)
    assert np.all(found[~at_rest, 1] == 3.0)
    shown = LiveEstimator(ModelEstimator(model), run.sample_rate_hz).push(run.columns, run.time_s)
    settled = np.isfinite(shown)  # as the live display, which has no value before
    assert 0 < np.sum(~settled) < 100
    inside = found[:, 2] == 1
    assert 0.9 < inside.mean() < 1
    low, high = model.evidence.target_range
    assert np.all(inside == settled & (wanted > low - 3.0) & (wanted < high + 3.0))
    status = ModelStatus([model])
    assert status.of({model.target: wanted[inside]}).state == "ok"
    assert status.of({model.target: wanted[wanted > high + 3.0]}).state == "suspect"


def test_a_machine_that_measures_a_speed_alone_is_estimated_from_the_speed(tmp_path):
    speed, position = "carriage_velocity_m_s", "carriage_position_m"
    plant = replace(SLIDE, sensors=(Sensor(speed, "carriage", "speed"),))
    whole = [slide(k) for k in range(2)]
    moved = [np.gradient(run[position], run.time_s) for run in whole]
    columns = [
        {speed: v, "drive_force_n": r["drive_force_n"]} for v, r in zip(moved, whole, strict=True)
    ]
    runs = [replace(r, columns=c) for r, c in zip(whole, columns, strict=True)]
    campaign = with_positions(Campaign.of(runs), plant)
    (carriage,) = declared(plant)
    model = model_file.parse(model_file.to_toml(fit(carriage, campaign, bootstrap=0)))
    found = compiled(ModelEstimator(model), runs[0], tmp_path, [speed])
    text = (tmp_path / "grip.h").read_text()
    assert "from carriage_velocity_m_s." in text
    assert refused(model) == ""
    assert "at rest" not in text  # the machine states no speed of standstill
    wanted = predict(model, campaign.runs[0].recording(), causal=True)
    assert np.abs(found[:, 0] - wanted).max() <= 1e-4 * np.abs(wanted).max()


def test_a_model_with_a_gear_is_written_with_its_ratio(runs, tmp_path):
    gearbox = model_file.read(Path("gearbox"))
    checked(fit(gearbox, Campaign.of(runs), bootstrap=0), runs[0], tmp_path)


def test_a_friction_under_load_reads_the_targets_prediction_in_c_and_live(runs, tmp_path):
    fitted = with_prediction(fit(model_file.read(Path("motor")), Campaign.of(runs), bootstrap=0))
    load = Term(
        effect("friction.load"),
        -1,
        {"load": predicted_of(fitted.target, fitted.target)},
        {"friction": Estimate(0.2), "width": Estimate(1.0)},
    )
    _, wanted = checked(replace(fitted, terms=(*fitted.terms, load)), runs[0], tmp_path)
    assert np.abs(wanted - predict(fitted, runs[0], causal=True)).max() > 1e-3


def test_an_effect_with_memory_is_refused_by_name():
    remembering = effect("friction.dwell")
    values = {p.name: Estimate(1.0) for p in (*remembering.amplitudes, *remembering.shape)}
    model = Model("m", "motor", "proximal_torque_n_m", (Term(remembering, values=values),))
    with pytest.raises(NotInCError, match=r"friction\.dwell remembers"):
        header(ModelEstimator(model), "grip", 1000.0)
    assert refused(model) == "friction.dwell remembers the samples before."


def test_an_unknown_interval_and_a_pose_come_through(bank, runs, tmp_path):
    posed = Bank("motor_current_a", "wrist_pitch_rad")
    draw = np.random.default_rng(0)
    estimator = BankEstimator(
        posed,
        TARGET,
        draw.normal(size=posed.size) / posed.size,
        None,
        np.array([[-1e9], [1e9]]).repeat(posed.judged, axis=1),
        np.ones(posed.size),
    )
    run = runs[0].with_columns(wrist_pitch_rad=np.full(len(runs[0]), 0.5))
    found, wanted = compiled(estimator, run, tmp_path), estimator.estimate(run, causal=True)
    assert np.abs(found[:, 0] - wanted.value).max() <= 1e-5 * np.abs(wanted.value).max()
    assert np.isnan(found[:, 1]).all()
    assert found[:, 2].all()


def test_the_compiled_network_gives_the_same(runs, tmp_path):
    draw = np.random.default_rng(1)
    highest = {
        "spindle_angle_rad": 0.7,
        "motor_acceleration_rad_s2": 2000.0,
        "motor_travel_rad": 20.0,
        "gearbox_differential_rad": 0.1,
    }
    ranges = np.outer([-1.0, 1.0], list(highest.values()))
    hidden, output = draw.normal(size=(8, 5)), draw.normal(size=(1, 9))
    network = Network(tuple(highest), (TARGET,), ranges, np.array([[0.0], [0.2]]), hidden, output)
    estimator = NetworkEstimator(network)
    found = compiled(estimator, runs[0], tmp_path)
    wanted = estimator.predict(runs[0], causal=True)
    assert np.abs(found[:, 0] - wanted).max() <= 1e-5 * np.abs(wanted).max()
    inside = network.inside(rows_of(causal_channels(runs[0], network.inputs), network.inputs))
    assert np.mean(found[:, 2] == inside) > 0.999


def test_what_cannot_be_written_is_refused(bank, runs):
    with pytest.raises(ExportError, match="cannot name things"):
        header(bank, "grip-torque", 1000.0)
    unit = np.array([[0.0], [1.0]])
    odd = Network(("spindle_turned_s",), (TARGET,), unit, unit, np.ones((2, 2)), np.ones((1, 3)))
    with pytest.raises(ExportError, match="spindle_turned_s"):
        header(NetworkEstimator(odd), "grip", 1000.0)
