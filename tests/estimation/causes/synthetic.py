"""Recordings of one torque equation, with or without an effect that it does not declare."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy import signal

from estimation import model_file, plant_file
from estimation.model import Model
from estimation.plant_models import declared
from estimation.recording import FloatArray, Recording

RATE_HZ, SECONDS = 250.0, 8.0
Effect = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Motor angle, motor speed and load to the torque that is lost."""


def motor() -> Model:
    return model_file.read(Path("motor"))


def recordings(
    lost: Effect | None = None, runs: int = 12, seed: int = 0, *, spring: bool = False
) -> list[Recording]:
    """Return runs of several speeds against several loads, or against a spring.

    A spring's load follows the angle alone; the current has slow noise then.
    """
    random = np.random.default_rng(seed)
    return [_run(k, lost, random, spring) for k in range(runs)]


def _run(k: int, lost: Effect | None, random: np.random.Generator, spring: bool) -> Recording:
    time = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
    waves = [(0.2 + 0.13 * (k % 4) + 0.21 * m, random.uniform(0, 2 * np.pi)) for m in range(3)]
    angle = 10.0 * sum(np.sin(2 * np.pi * f * time + p) / (m + 1) for m, (f, p) in enumerate(waves))
    speed = np.gradient(angle, time)
    acceleration = np.gradient(speed, time)
    load = 0.03 * (1 + k % 3) * (1 + 0.5 * np.sin(2 * np.pi * 0.31 * time + k))
    if spring:
        load = 0.06 + 0.002 * angle
    friction = 2e-5 * acceleration + 1e-4 * speed + 0.02 * np.tanh(speed / 2.0)
    if lost is not None:
        friction = friction + lost(angle, speed, load)
    current = (load + friction) / 1.2 + random.normal(0, 2e-3, len(time))
    if spring:
        slow = random.normal(0, 0.03, len(time) + int(RATE_HZ) - 1)
        current += np.convolve(slow, np.ones(int(RATE_HZ)) / RATE_HZ, "valid")
    return Recording(
        f"{k:02d}",
        time,
        {
            "motor_current_a": current,
            "proximal_torque_n_m": load + random.normal(0, 4e-4, len(time)),
            "motor_angle_rad": angle,
        },
        conditions={"load_command_a": 0.1 * (1 + k % 3)},
        started_at_ns=int(1e9 * 20 * k) + 1,
    )


def resisting(seed: int) -> list[Recording]:
    """Return runs whose load resists like friction; the current and the losses are drawn.

    Fitted without bounds, the friction is that of the load with the opposite sign.
    """
    random = np.random.default_rng(seed)
    of_sign, of_speed = random.uniform(0.0, 0.03), random.uniform(-1e-3, 1e-3)
    drag, noise = random.uniform(0.0, 2e-3), 10.0 ** random.uniform(-3.0, -1.5)
    out = []
    for one in recordings(lambda angle, speed, load: drag * speed, seed=seed):
        speed = np.gradient(one["motor_angle_rad"], one.time_s)
        lost = 1.2 * one["motor_current_a"] - one["proximal_torque_n_m"]
        load = of_sign * np.tanh(speed / 2.0) + of_speed * speed
        current = (load + lost) / 1.2 + random.normal(0, noise, len(load))
        torque = load + random.normal(0, 1e-5, len(load))
        out.append(one.with_columns(motor_current_a=current, proximal_torque_n_m=torque))
    return out


def gearbox() -> Model:
    return model_file.read(Path("gearbox"))


def geared(
    slow: float = 0.0, bend: float = 0.0, creep: float = 0.0, wave: float = 0.0
) -> list[Recording]:
    """Return runs of motor and gearbox against a load of both signs that moves in steps.

    Args:
        slow: Compliance that acts late, by .6 s, over the gear's own.
        bend: Gain of the torque's reading that grows with its size, at the largest load.
        creep: Share of the torque's reading that comes slowly, over .5 s.
        wave: Error of the motor's encoder, two waves a turn, rad.
    """
    random = np.random.default_rng(0)
    out = []
    for one in recordings():
        levels = random.uniform(-0.12, 0.12, 8)
        steps = np.repeat(levels, len(one.time_s) // 8)
        load, lag = _lagging(steps, 0.05), _lagging(_lagging(steps, 0.05), 0.6)
        motor_angle = one["motor_angle_rad"]
        speed = np.gradient(motor_angle, one.time_s)
        lost = 2e-5 * np.gradient(speed, one.time_s) + 1e-4 * speed + 0.02 * np.tanh(speed / 2.0)
        twist = (load + slow * (lag - load)) / 50.0
        reading = load + bend * load * np.abs(load) / 0.12 + random.normal(0, 1e-4, len(load))
        reading = reading + creep * (_lagging(load, 0.5) - load)
        columns = {
            "motor_current_a": (load + lost) / 1.2 + random.normal(0, 2e-3, len(load)),
            "proximal_torque_n_m": reading,
            "spindle_angle_rad": motor_angle / 35.0 - twist + random.normal(0, 1e-5, len(load)),
            "motor_angle_rad": motor_angle + wave * np.sin(2.0 * motor_angle + 0.4),
        }
        out.append(one.with_columns(**columns))
    return out


def cable() -> list[Model]:
    """Return the shipped equations of the cable: its torque, and what it stretches."""
    return [model_file.read(Path(name)) for name in ("cable", "stretch")]


RATIO = 1.2
"""Jaw angle per spindle angle of `cabled`."""


def cabled(wave: float = 0.0, *, held: bool = False) -> list[Recording]:
    """Return runs of a cable between spindle and jaw.

    Args:
        wave: Change of the pulley's lever arm over its turn, seven times a turn.
        held: Whether the load hardly changes within each run.
    """
    random = np.random.default_rng(0)
    out = []
    for k in range(12):
        time = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
        waves = [(0.2 + 0.1 * (k % 4) + 0.2 * m, random.uniform(0, 2 * np.pi)) for m in range(3)]
        spindle = 0.6 * sum(
            np.sin(2 * np.pi * f * time + p) / (m + 1) for m, (f, p) in enumerate(waves)
        )
        speed = np.gradient(spindle, time)
        load = (
            0.04 * (1 + k % 3) * (1 + (0.01 if held else 0.5) * np.sin(2 * np.pi * 0.31 * time + k))
        )
        phase = 7.0 * spindle + 0.4
        lever = RATIO + wave * (np.cos(phase) + 0.4 * np.cos(2 * phase))
        travel = RATIO * spindle + wave / 7.0 * (np.sin(phase) + 0.2 * np.sin(2 * phase))
        lost = 1e-4 * np.gradient(speed, time) + 1e-4 * speed + 0.004 * np.tanh(speed / 0.06)
        columns = {
            "motor_angle_rad": 35.0 * spindle,
            "spindle_angle_rad": spindle,
            "jaw_angle_rad": 1.3 + travel - load / 20.0 + random.normal(0, 1e-4, len(time)),
            "proximal_torque_n_m": lever * load + lost + random.normal(0, 2e-4, len(time)),
            "distal_torque_n_m": load + random.normal(0, 2e-4, len(time)),
        }
        conditions = {"load_command_a": 0.1 * (1 + k % 3)}
        start = int(1e9 * 20 * k) + 1
        out.append(Recording(f"{k:02d}", time, columns, conditions=conditions, started_at_ns=start))
    return out


def sprung(noise_n_m: float) -> list[Recording]:
    """Return runs of a cable against a spring and a damper; the jaw's torque has slow noise."""
    random, keep = np.random.default_rng(0), np.exp(-1.0 / (RATE_HZ * 0.05))
    out = []
    for one in cabled():
        spindle, count = one["spindle_angle_rad"], len(one.time_s)
        speed = np.gradient(spindle, one.time_s)
        load = 0.02 * spindle + 0.002 * speed
        lost = 1e-4 * np.gradient(speed, one.time_s) + 1e-4 * speed + 0.004 * np.tanh(speed / 0.06)
        fresh = random.normal(0, noise_n_m * np.sqrt(1.0 - keep**2), count + 1000)
        slow = signal.lfilter([1.0], [1.0, -keep], fresh)[1000:]
        columns = {
            "jaw_angle_rad": 1.3 + RATIO * spindle - load / 0.5 + random.normal(0, 5e-5, count),
            "proximal_torque_n_m": RATIO * load + lost + random.normal(0, 2e-4, count),
            "distal_torque_n_m": load + slow + random.normal(0, 2e-4, count),
        }
        out.append(one.with_columns(**columns))
    return out


def _lagging(values: FloatArray, time_s: float) -> FloatArray:
    """Return what follows values with a time constant, settled at the start."""
    share = 1.0 - np.exp(-1.0 / (RATE_HZ * time_s))
    start = signal.lfiltic([share], [1.0, share - 1.0], [values[0]])
    return np.asarray(signal.lfilter([share], [1.0, share - 1.0], values, zi=start)[0])


AXIS = """
schema = "rig.machine/1"
machine = { name = "linkage", run_offsets = false }
[[axis]]
name = "crank"
unit = "rad"
[[actuator]]
name = "DRIVE"
axis = "crank"
[[sensor]]
name = "crank_angle_rad"
axis = "crank"
reads = "position"
"""
"""A machine of one axis; `DRIVE` stands for the channel of what drives it."""


def axis(drive: str = "crank_torque_n_m") -> Model:
    (model,) = declared(plant_file.parse(AXIS.replace("DRIVE", drive)))
    return model


def turning(
    torque: Effect = lambda angle, *_: 0.0 * angle, *, always_ahead: bool = False, size: float = 1.0
) -> list[Recording]:
    """Return runs of one axis with inertia and friction; angle, speed and acceleration add torque.

    The motion has a size in rad; one that is always ahead has no negative speed.
    """
    random = np.random.default_rng(0)
    time = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
    out = []
    for k in range(10):
        waves = zip(random.uniform(0.1, 0.7, 4), random.uniform(0, 2 * np.pi, 4), strict=True)
        angle = size * sum(np.sin(2 * np.pi * f * time + p) for f, p in waves) / 2
        if always_ahead:
            angle = np.cumsum(np.abs(angle) + 0.1 * size) / RATE_HZ
        speed = np.gradient(angle, time)
        acceleration = np.gradient(speed, time)
        lost = 0.02 * acceleration + 0.05 * speed + 0.15 * size * np.tanh(speed / (0.02 * size))
        lost = lost + torque(angle, speed, acceleration)
        lost += random.normal(0, 0.01 * np.std(lost), len(time))
        columns = {"crank_torque_n_m": lost, "crank_angle_rad": angle}
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(1e10 * k) + 1))
    return out


HOIST = """
schema = "rig.machine/1"
machine = { name = "hoist", cutoff_hz = 10.0, run_offsets = false }
[[axis]]
name = "drum"
unit = "rad"
[[axis]]
name = "rope"
unit = "m"
[[transmission]]
name = "drum_rope"
input = "drum"
output = "rope"
ratio = 20.0
[[actuator]]
name = "drive_command_v"
axis = "drum"
[[sensor]]
name = "drum_angle_rad"
axis = "drum"
reads = "position"
[[sensor]]
name = "rope_force_n"
axis = "rope"
reads = "effort"
"""
"""A drum that is driven by a voltage, 60 N/V at the rope, and lifts a mass."""


def hoist(cutoff_hz: float = 10.0) -> Model:
    """Return its equation: that of the force, with noise of an acceleration below a cutoff."""
    text = HOIST.replace("cutoff_hz = 10.0", f"cutoff_hz = {cutoff_hz}")
    (model,) = declared(plant_file.parse(text))
    return model


def hoisted(masses_kg: Sequence[float] = (20.0, 40.0, 60.0, 80.0)) -> list[Recording]:
    """Return runs of a hoist that lifts masses in turn; every fourth run is slow."""
    random = np.random.default_rng(0)
    time, out = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ, []
    for k in range(12):
        mass, size = masses_kg[k % len(masses_kg)], 0.2 if k % 4 == 1 else 3.0
        waves = zip(random.uniform(0.1, 0.4, 3), random.uniform(0, 2 * np.pi, 3), strict=True)
        angle = size * sum(np.sin(2 * np.pi * f * time + p) for f, p in waves) / 2
        speed = np.gradient(angle, time)
        acceleration = np.gradient(speed, time)
        torque = (0.6 + mass * 0.05**2) * acceleration + 8.0 * speed + 4.0 * np.tanh(speed / 0.01)
        volts = (torque + mass * 9.81 * 0.05) / 3.0
        columns = {
            "drive_command_v": volts + random.normal(0, 0.02, len(time)),
            "drum_angle_rad": angle + random.normal(0, 2e-4, len(time)),
            "rope_force_n": mass * (9.81 + 0.05 * acceleration) + random.normal(0, 1.5, len(time)),
        }
        out.append(Recording(f"{k:02d}", time, columns, started_at_ns=int(1e10 * k) + 1))
    return out
