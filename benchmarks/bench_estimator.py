"""What an estimate costs: a compiled step, and the whole way from bytes to estimate, live."""

import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.bench_frames import device_stream
from benchmarks.ratio import Ratio, best_of
from drivers.framing import FrameStream
from drivers.teensy.reference import SAMPLE_DTYPE
from estimation.bank.states import Bank
from estimation.estimators.bank import BankEstimator
from estimation.estimators.c_header import header
from estimation.estimators.network import NetworkEstimator
from estimation.networks.network import Network

SAMPLES = 20_000
BLOCK = 20
"""Samples that arrive together at 50 refreshes a second of 1 kHz."""

RATE_HZ = 1000.0
STATES_LIMIT_S, NETWORK_LIMIT_S = 0.2e-6, 0.5e-6
LATENCY_LIMIT_S = 1e-3
SHARE = 0.1
"""Share of a core that decoding and estimating may take."""

COUNTS = {
    "motor_angle_rad": ("motor", 2 * np.pi / 4096),
    "spindle_angle_rad": ("spindle", -2 * np.pi / 8192),
    "motor_current_a": ("current", 1e-3),
}
"""Field of a sample and scale of each channel, as on the reference rig."""

LOOP = """
#include <stdio.h>
#include <time.h>
#include "grip.h"
static grip_state state;
int main(void) {
    static double measured[%d][GRIP_MEASURED];
    float sum = 0;
    if (fread(measured, sizeof measured, 1, stdin) != 1) return 1;
    grip_start(&state);
    struct timespec first, last;
    clock_gettime(CLOCK_MONOTONIC, &first);
    for (int i = 0; i < %d; i++) sum += grip_step(&state, measured[i]).value;
    clock_gettime(CLOCK_MONOTONIC, &last);
    double s = (double)(last.tv_sec - first.tv_sec) + 1e-9 * (double)(last.tv_nsec - first.tv_nsec);
    printf("%%.17g %%g\\n", s, sum);
    return 0;
}
"""


def measure() -> list[Ratio]:
    """Estimate the same 20 s of a sweep from rows of channels, in C, and from the board's bytes."""
    states, network = _states(), _network()
    measured = _sweep()
    bank_s = _design_s(states, measured)
    whole_s, latency_s = _live(states)
    rows = [
        Ratio(
            "0.2 us over a state estimator's compiled step",
            STATES_LIMIT_S / bank_s,
            1.0,
            detail=f"{1e9 * bank_s:.0f} ns a sample, {states.bank.size} weights",
        ),
        Ratio(
            "1 ms over the 99th percentile of processor time from bytes read to estimates",
            LATENCY_LIMIT_S / latency_s,
            1.0,
            detail=f"{1e3 * latency_s:.2f} ms a block of {BLOCK} samples, decoded and filtered",
        ),
        Ratio(
            "share of a core that decoding and estimating take at 1 kHz, %",
            100 * whole_s * RATE_HZ,
            100 * SHARE,
            higher_is_better=False,
            detail=f"{1e6 * whole_s:.1f} us a sample, blocks of {BLOCK}",
        ),
    ]
    if shutil.which("cc") is not None:
        step_s = _exported_s(network, measured)
        detail = f"{1e9 * step_s:.0f} ns a sample with its filters, 30 nodes, exported as C"
        name = "0.5 us over a network's compiled step"
        rows.insert(1, Ratio(name, NETWORK_LIMIT_S / step_s, 1.0, detail=detail))
    return rows


def _states() -> BankEstimator:
    bank = Bank("motor_current_a")
    ranges = np.array([[-1e9], [1e9]]).repeat(bank.judged, axis=1)
    weights = np.random.default_rng(0).normal(size=bank.size) / bank.size
    return BankEstimator(bank, "proximal_torque_n_m", weights, None, ranges, np.ones(bank.size))


def _network() -> NetworkEstimator:
    inputs = ("spindle_angle_rad", "spindle_velocity_rad_s", "motor_current_a")
    draw = np.random.default_rng(0)
    bounds = np.array([[-1.0, -2.0, 0.0], [0.0, 2.0, 0.4]])
    weights = draw.normal(size=(30, 4)), draw.normal(size=(1, 31))
    target = np.array([[0.0], [0.3]])
    return NetworkEstimator(Network(inputs, ("proximal_torque_n_m",), bounds, target, *weights))


def _sweep() -> dict[str, np.ndarray]:
    time_s = np.arange(SAMPLES) / RATE_HZ
    spindle = -0.5 + 0.5 * np.sin(2 * np.pi * 0.3 * time_s)
    noise = np.random.default_rng(0).normal(0, 0.003, SAMPLES)
    current = 0.2 + 0.1 * spindle + noise
    return {
        "spindle_angle_rad": spindle,
        "motor_angle_rad": 35 * spindle,
        "motor_current_a": current,
    }


def _design_s(estimator: BankEstimator, measured: dict[str, np.ndarray]) -> float:
    spindle = measured["spindle_angle_rad"]
    names = estimator.bank.channels
    rows = np.column_stack([measured.get(name, spindle) for name in names])
    weights = estimator.weights
    blocks = [block for block in np.split(rows, SAMPLES // 1000) for _ in range(5)]
    shortest = float("inf")  # of many short ones: few of them are disturbed
    for block in blocks:
        shortest = min(shortest, best_of(lambda b=block: estimator.bank.design(b) @ weights))
    return shortest / 1000


def _live(estimator: BankEstimator) -> tuple[float, float]:
    """Return the processor's time for a sample, and the 99th percentile of a block's, s.

    Time in which the machine does something else is left out.
    """
    stream = device_stream()
    frame = len(stream) // stream.count(0)
    stepper = estimator.stepper(RATE_HZ)
    decoder = FrameStream(SAMPLE_DTYPE.itemsize)
    taken = []
    for first in range(0, SAMPLES * frame, BLOCK * frame):
        data = stream[first : first + BLOCK * frame]
        begun = time.thread_time()
        samples = decoder.feed(data).payloads.view(SAMPLE_DTYPE)[:, 0]
        columns = {name: scale * samples[field] for name, (field, scale) in COUNTS.items()}
        stepper.step(1e-6 * samples["tick_us"], columns)
        taken.append(time.thread_time() - begun)
    settled = taken[50:]  # the first ones compile
    return float(np.mean(settled)) / BLOCK, float(np.percentile(settled, 99))


def _exported_s(estimator: NetworkEstimator, measured: dict[str, np.ndarray]) -> float:
    """Return the time of a step of the exported header, s."""
    order = estimator.stepper(RATE_HZ).channels
    samples = np.column_stack([measured[name] for name in order])
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "grip.h").write_text(header(estimator, "grip", RATE_HZ))
        (folder / "main.c").write_text(LOOP % (SAMPLES, SAMPLES))
        command = ["cc", "-std=gnu99", "-O2", "main.c", "-o", "main", "-lm"]
        subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - fixed arguments
        times = []
        for _ in range(5):
            done = subprocess.run(  # noqa: S603 - what was compiled above
                [folder / "main"], input=samples.tobytes(), capture_output=True, check=True
            )
            times.append(float(done.stdout.split()[0]))
    return min(times) / SAMPLES
