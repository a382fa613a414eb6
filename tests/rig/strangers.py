"""Machines that nobody has: a linear axis driven by PWM, and a drive of two masses."""

from pathlib import Path

import numpy as np

from estimation.recording import FloatArray

AXIS = """
schema = "rig.machine/1"
axis = [{ name = "gantry", unit = "m" }]
actuator = [{ name = "pwm_ratio", axis = "gantry" }]

[machine]
name = "plotter"
run_offsets = false

[[sensor]]
name = "gantry_position_m"
axis = "gantry"
reads = "position"
counts = 20000

[data]
runs = { lap_s = 4.0 }
[data.columns]
time_s = "t:ms"
pwm_ratio = "pwm:1/255"
gantry_position_m = "x:mm"
"""

DRIVE = """
schema = "rig.machine/1"
machine = { name = "bench drive" }
axis = [{ name = "input", unit = "rad" }, { name = "output", unit = "rad" }]
actuator = [{ name = "drive_current_a", axis = "input" }]
sensor = [
  { name = "input_angle_rad", axis = "input", reads = "position", counts = 1304 },
  { name = "output_angle_rad", axis = "output", reads = "position", counts = 2608 },
  { name = "cell_torque_n_m", axis = "output", reads = "effort", noise = 0.01 },
]

[[transmission]]
name = "belt"
input = "input"
output = "output"
ratio = RATIO
compliant = true

[data]
files = "*.csv"
runs = { changes = ["trial"] }
[data.columns]
time_s = "t"
input_angle_rad = "q_in:deg"
output_angle_rad = "q_out:deg"
drive_current_a = "i:mA"
cell_torque_n_m = "cell:N m"
"""
"""`RATIO` stands for the ratio."""


ARM = """
schema = "rig.machine/1"
machine = { name = "two link arm", run_offsets = false, cutoff_hz = 10.0 }
axis = [{ name = "shoulder", unit = "rad" }, { name = "elbow", unit = "rad" }]
actuator = [
  { name = "shoulder_torque_n_m", axis = "shoulder" },
  { name = "elbow_torque_n_m", axis = "elbow" },
]
sensor = [
  { name = "shoulder_angle_rad", axis = "shoulder", reads = "position" },
  { name = "elbow_angle_rad", axis = "elbow", reads = "position" },
]

[data]
runs = { changes = ["run"] }
[data.columns]
time_s = "t"
shoulder_torque_n_m = "tau1"
elbow_torque_n_m = "tau2"
shoulder_angle_rad = "q1"
elbow_angle_rad = "q2"
"""


def axis_table(file, runs=10, asymmetry=0.0, cogging=0.0, warming="", seed=1):
    """Write a table of an axis.

    Args:
        file: The table.
        runs: Laps.
        asymmetry: Difference of its viscous friction between the directions, N s/m as share.
        cogging: Amplitude of a force that repeats every 12 mm, as share.
        warming: The parameter of friction that falls with a temperature, in the last column, °C.
        seed: Seed of the noise.
    """
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 4.0 * runs, 2e-3)
    position = 0.15 * np.sin(2 * np.pi * time_s / 4.0) + 0.03 * np.sin(2.7 * time_s)
    speed = np.gradient(position, time_s)
    pwm = 0.01 * np.gradient(speed, time_s) + 0.2 * speed + 0.05 * np.tanh(speed / 2e-3)
    warmth = 6.0 * random.permutation(runs)[(time_s // 4.0).astype(int)] / runs
    falls = {"damping": 0.015 * speed, "friction": 0.003 * np.tanh(speed / 2e-3)}
    pwm -= warmth * falls.get(warming, 0.0)
    pwm += asymmetry * np.abs(speed) + random.normal(0.0, 1e-3, time_s.size)
    pwm += cogging * np.sin(2 * np.pi * position / 0.012 + 0.3)
    read = np.round(position * 20000) / 20000
    warmth = 25.0 + warmth + random.normal(0.0, 0.05, time_s.size)
    rows = np.column_stack([1e3 * time_s, 255 * pwm, 1e3 * read, warmth][: 4 if warming else 3])
    head = "t,pwm,x,warm" if warming else "t,pwm,x"
    np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.9g")


def drive_table(file, ratio=35.0, runs=9, rubs=0.0, lost_rad=0.0, wave_rad=0.0, seed=1):
    """Write a table of a belt drive with a torque cell.

    Args:
        file: The table.
        ratio: Turns of the input per turn of the output.
        runs: Trials.
        rubs: Share of the torque that friction takes at the input.
        lost_rad: Half of the belt's free travel, at the output.
        wave_rad: Error of the belt's travel, once a turn of the input, at the output.
        seed: Seed of the noise.
    """
    random = np.random.default_rng(seed)
    parts = [_trial(k, ratio, rubs, (lost_rad, wave_rad), random) for k in range(runs)]
    rows = np.concatenate(parts)
    head = "trial,t,q_in,q_out,i,cell"
    np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.9g")


def _trial(
    k: int, ratio: float, rubs: float, travel: tuple[float, float], random: np.random.Generator
) -> FloatArray:
    time_s = np.arange(0.0, 8.0, 1e-3)
    turn = 2 * np.pi * time_s
    output = 0.8 * np.sin((0.2 + 0.05 * (k % 3)) * turn + k) + 0.2 * np.sin(0.61 * turn)
    torque = (0.5 + 0.5 * (k // 3)) * np.sin(0.33 * turn + 2 * k) + 0.3 * output
    lost_rad, wave_rad = travel
    bend = 0.02 * torque + lost_rad * np.tanh(torque / 0.02)
    bend += wave_rad * np.sin(ratio * (output + bend) + 0.4)
    angle = ratio * (output + bend)
    speed = np.gradient(angle, time_s)
    loss = 1e-5 * np.gradient(speed, time_s) + 2e-4 * speed + 4e-3 * np.tanh(speed / 0.5)
    loss += rubs * np.abs(torque) / ratio * np.tanh(speed / 0.5)
    current = (torque / ratio + loss) / 0.05
    counts = [np.round(a * c / (2 * np.pi)) * 360 / c for a, c in ((angle, 8192), (output, 16384))]
    read = [
        1e3 * (current + random.normal(0, 2e-3, len(turn))),
        torque + random.normal(0, 0.01, len(turn)),
    ]
    return np.column_stack([np.full(len(turn), k), time_s, *counts, *read])


def arm_table(file: Path, runs: int = 10, seed: int = 1) -> None:
    """Write a table of two joints under gravity, 50 Hz; the second one's depends on both angles."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, 10.0, 0.02)
    parts = []
    for k in range(runs):
        phases, rates = random.uniform(0, 6, (2, 4)), random.uniform(0.1, 0.5, (2, 4))
        q1, q2 = (
            np.sum(
                [np.sin(2 * np.pi * f * time_s + p) / 2 for f, p in zip(*own, strict=True)], axis=0
            )
            for own in zip(rates, phases, strict=True)
        )
        torques = []
        for q, inertia, viscous in ((q1, 0.6, 1.5), (q2, 0.05, 0.8)):
            speed = np.gradient(q, 0.02)
            torque = inertia * np.gradient(speed, 0.02) + viscous * speed + np.tanh(speed / 0.05)
            torques.append(torque + random.normal(0.0, 0.05, time_s.size))
        torques[0] = torques[0] + 10.0 * np.sin(q1)
        torques[1] = torques[1] + 2.2 * np.cos(q1 + q2)
        parts.append(np.column_stack([np.full(time_s.size, k), time_s, q1, q2, *torques]))
    rows = np.concatenate(parts)
    np.savetxt(file, rows, delimiter=",", header="run,t,q1,q2,tau1,tau2", comments="", fmt="%.9g")
