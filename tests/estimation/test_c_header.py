"""The exported header is compiled and held against the estimator it was made of."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from estimation.bank.states import Bank
from estimation.campaign import Campaign
from estimation.estimators.bank import BankEstimator, BankRecipe
from estimation.estimators.c_header import ExportError, header
from estimation.estimators.network import NetworkEstimator
from estimation.networks.network import Network
from estimation.recording import Recording
from tests.estimation.synthetic import campaign

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


def compiled(estimator, run: Recording, folder) -> np.ndarray:
    """Return value, half width and validity of each sample as the compiled header gives them."""
    (folder / "grip.h").write_text(header(estimator, "grip", run.sample_rate_hz))
    (folder / "main.c").write_text(MAIN)
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffp-contract=off"]
    command = [COMPILER, *flags, "main.c", "-o", "main", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    stepper = estimator.stepper(run.sample_rate_hz)
    samples = np.column_stack([run[name] for name in stepper.channels])
    done = subprocess.run(
        [folder / "main"], input=samples.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, np.float32).reshape(-1, 3)


@pytest.fixture(scope="module")
def runs() -> list[Recording]:
    return list(campaign())


@pytest.fixture(scope="module")
def bank(runs) -> BankEstimator:
    return BankRecipe(TARGET, Bank("motor_current_a"), causal=True).fit(Campaign.of(runs[1:]))


def test_the_compiled_state_estimator_gives_the_same(bank, runs, tmp_path):
    found, wanted = compiled(bank, runs[0], tmp_path), bank.estimate(runs[0], causal=True)
    assert np.abs(found[:, 0] - wanted.value).max() <= 1e-5 * np.abs(wanted.value).max()
    np.testing.assert_allclose(found[:, 1], wanted.half_width, rtol=1e-4)
    assert np.mean(found[:, 2] == wanted.inside) > 0.999  # a sample may lie on a bound


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
    inputs = (
        "spindle_angle_rad",
        "motor_acceleration_rad_s2",
        "motor_travel_rad",
        "gearbox_differential_rad",
    )
    ranges = np.array([[-0.7, -2000.0, 0.0, -0.1], [0.7, 2000.0, 20.0, 0.1]])
    network = Network(
        inputs, (TARGET,), ranges, np.array([[0.0], [0.2]]), draw.normal(size=(8, 5)),
        draw.normal(size=(1, 9)),
    )  # fmt: skip
    estimator = NetworkEstimator(network)
    found = compiled(estimator, runs[0], tmp_path)
    wanted = estimator.predict(runs[0], causal=True)
    assert np.abs(found[:, 0] - wanted).max() <= 1e-5 * np.abs(wanted).max()
    assert np.mean(found[:, 2] == estimator.inside(runs[0], causal=True)) > 0.999


def test_what_cannot_be_written_is_refused(bank, runs):
    with pytest.raises(ExportError, match="cannot name things"):
        header(bank, "grip-torque", 1000.0)
    odd = replace(
        NetworkEstimator(
            Network(
                ("motor_load_n_m",), (TARGET,), np.array([[0.0], [1.0]]), np.array([[0.0], [1.0]]),
                np.ones((2, 2)), np.ones((1, 3)),
            )
        )
    )  # fmt: skip
    with pytest.raises(ExportError, match="motor_load_n_m"):
        header(odd, "grip", 1000.0)
