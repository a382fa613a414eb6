"""The simulated 3-DOF grasper: one motor an axis behind a gearhead, friction with memory, contact.

All quantities are seen at the joint, closing positive; N is the ratio of the gearhead:

    N^2 J q'' = N K i - friction - contact
    friction = f (Fc + mu |contact|) s + b q'
    s' = q' (1 - s sgn q') / delta - (s - rho sgn s) / tau    where |s| > rho
    contact = k max(q - q0, 0)

f is 1, or a table over one variable that a study hides (`Form`). s is the state of a bristle (Dahl
1968) that, held, relaxes to the share rho: plastic journal bearings let go of a part of their
friction in seconds. That is an assumption; it gives what Zhao and Nelson 2016 show in their Figures
11 to 14: a peak on loading, a slow decay, an error after two seconds that grows with the load, and
after half a minute one that does not. The motor follows the master by a position controller with
integral action, sampled at 2 kHz.
"""

from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numba
import numpy as np

from estimation.recording import FloatArray
from rig.protocols.trajectory import minimum_jerk

RATE_HZ = 2000.0
SUBSTEPS = 5


FORM_VARIABLES = ("load", "speed", "angle", "time", "acceleration")


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """A factor on the level of friction: a table over the size of one variable."""

    variable: int  # place in `FORM_VARIABLES`: N m, rad/s, rad, s, rad/s^2
    high: float  # end of the table, which begins at 0; beyond it the last value stays
    values: FloatArray  # shape (points,)


NO_FORM = Form(0, 1.0, np.ones(2))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisParameters:
    """One axis of the simulated grasper, SI units, at the joint."""

    gearhead_ratio: float = 66.0  # of the paper
    torque_constant_n_m_a: float = 14.6e-3  # of the motor; data sheet of the Faulhaber 2224U012SR
    rotor_inertia_kg_m2: float = 2.7e-7  # of the paper
    coulomb_n_m: float = 4e-3  # friction without load
    load_friction_ratio: float = 0.4  # friction a unit of contact torque
    viscous_n_m_s_rad: float = 5e-3
    presliding_rad: float = 4e-3  # travel over which friction builds up
    relaxed_ratio: float = 0.6  # share of its friction that a held bearing keeps
    relaxation_s: float = 3.0  # time constant of letting go
    contact_n_m_rad: float = 0.3  # stiffness of what is grasped, with cable and jaw
    contact_rad: float = 0.1  # angle of first contact
    arm_m: float = 0.010  # from the joint to where the force acts; assumed
    current_offset_a: float = 0.0  # of the current sensor
    current_noise_a: float = 2e-3  # standard deviation of one sample
    force_noise_n: float = 5e-3  # standard deviation of one sample of the force sensor
    form: Form = NO_FORM  # factor on the level of friction

    @property
    def compiled(self) -> Any:
        """The numbers as compiled code takes them: an `AxisTuple`, floats of the same names."""
        return AxisTuple(*(float(getattr(self, item.name)) for item in fields(self)[:-1]))


AxisTuple = namedtuple("AxisTuple", [item.name for item in fields(AxisParameters)[:-1]])  # type: ignore[misc]

HIDDEN = (
    "coulomb_n_m",
    "load_friction_ratio",
    "viscous_n_m_s_rad",
    "presliding_rad",
    "relaxed_ratio",
    "relaxation_s",
)
"""Parameters that differ from grasper to grasper and are unknown to every estimator."""


def vary(axis: AxisParameters, seed: int, spread: float) -> AxisParameters:
    """Return an axis as another grasper of the same make would have it.

    `spread` is the standard deviation of each hidden parameter's logarithm.
    """
    random = np.random.default_rng(seed)
    factors = np.exp(spread * np.clip(random.standard_normal(len(HIDDEN)), -3, 3))
    changed = {n: getattr(axis, n) * float(f) for n, f in zip(HIDDEN, factors, strict=True)}
    changed["relaxed_ratio"] = min(changed["relaxed_ratio"], 0.95)
    return replace(axis, **changed)


KP, KI, KD = 12.0, 5.0, 0.15
"""Gains of the position controller at the joint, N m/rad, N m/(rad s), N m s/rad."""
LIMIT_A = 0.6


ANGLE, SPEED, BRISTLE = range(3)
"""Places in an axis' state: rad, rad/s, and the bristle's share of the friction."""


@numba.njit(cache=True)
def contact_torque(p: Any, angle_rad: float) -> float:
    """Return the torque of what is grasped at a joint's angle, N m; p is an `AxisTuple`."""
    return float(p.contact_n_m_rad * max(angle_rad - p.contact_rad, 0.0))


@numba.njit(cache=True)
def step_axis(state: Any, p: Any, current_a: float, factor: float) -> None:
    """Move one axis by a tick of 0.5 ms; `state` is changed in place.

    The current and the factor on the level of friction are constant.
    """
    inertia = p.gearhead_ratio * p.gearhead_ratio * p.rotor_inertia_kg_m2
    gain = p.gearhead_ratio * p.torque_constant_n_m_a
    kept = p.relaxed_ratio
    h = 1.0 / RATE_HZ / SUBSTEPS
    q, w, s = state[ANGLE], state[SPEED], state[BRISTLE]
    for _ in range(SUBSTEPS):
        contact = contact_torque(p, q)
        level = factor * (p.coulomb_n_m + p.load_friction_ratio * contact)
        ds = w / p.presliding_rad * (1.0 - s * np.sign(w))
        if abs(s) > kept:
            ds -= (s - kept * np.sign(s)) / p.relaxation_s
        s += h * ds
        s = min(max(s, -1.0), 1.0)
        w += h / inertia * (gain * current_a - level * s - p.viscous_n_m_s_rad * w - contact)
        q += h * w
    state[ANGLE], state[SPEED], state[BRISTLE] = q, w, s


@numba.njit(cache=True)
def _factor(variable: int, high: float, table: Any, sizes: Any) -> float:
    place = min(abs(sizes[variable]) / high, 1.0) * (table.shape[0] - 1)
    at = min(int(place), table.shape[0] - 2)
    return float(table[at] + (place - at) * (table[at + 1] - table[at]))


@numba.njit(cache=True)
def _run(p: Any, variable: int, high: float, table: Any, target: Any) -> Any:
    kp, ki, kd, limit_a = KP, KI, KD, LIMIT_A
    sizes = np.zeros(5)
    n = target.shape[0]
    out = np.empty((n, 4))
    gain = p.gearhead_ratio * p.torque_constant_n_m_a
    state = np.zeros(3)
    state[ANGLE] = target[0]
    total = 0.0
    last = target[0]
    for k in range(n):
        q = state[ANGLE]
        error = target[k] - q
        command = kp * error + ki * total - kd * (q - last) * RATE_HZ
        last = q
        i = min(max(command / gain, -limit_a), limit_a)
        if abs(i) < limit_a:
            total += error / RATE_HZ
        out[k, 0] = i
        out[k, 1] = q
        out[k, 2] = contact_torque(p, q)
        out[k, 3] = state[BRISTLE]
        sizes[0], sizes[1], sizes[2], sizes[3] = out[k, 2], state[SPEED], q, k / RATE_HZ
        step_axis(state, p, i, _factor(variable, high, table, sizes))
        sizes[4] = (state[SPEED] - sizes[1]) * RATE_HZ
    return out


def play_axis(axis: AxisParameters, target_rad: FloatArray, seed: int) -> dict[str, FloatArray]:
    """Return the measurements of one axis whose motor follows the master's angle at 2 kHz, (n,).

    They are `motor_current_a`, `motor_angle_rad` (of the shaft), `joint_angle_rad` and `force_n`.
    """
    form = axis.form
    target = np.ascontiguousarray(target_rad, np.float64)
    out = _run(axis.compiled, form.variable, form.high, form.values, target)
    random = np.random.default_rng(seed)
    n = len(target_rad)
    return {
        "motor_current_a": out[:, 0]
        + axis.current_offset_a
        + axis.current_noise_a * random.standard_normal(n),
        "motor_angle_rad": out[:, 1] * axis.gearhead_ratio,
        "joint_angle_rad": out[:, 1],
        "force_n": out[:, 2] / axis.arm_m + axis.force_noise_n * random.standard_normal(n),
    }


@dataclass(frozen=True, slots=True)
class Prototype:
    """A simulated grasper: the axes whose mean current gives each degree of freedom's force.

    They are both jaws for grasp, the touching jaw for pitch.
    """

    name: str
    axes: Mapping[str, tuple[AxisParameters, ...]]


def _prototype(
    name: str, jaw_1: AxisParameters, jaw_2: AxisParameters, yaw: AxisParameters
) -> Prototype:
    return Prototype(name, {"grasp": (jaw_1, jaw_2), "pitch": (jaw_1,), "yaw": (yaw,)})


def _axis(
    coulomb: float, load: float, kept: float, viscous: float, time_s: float, offset_a: float = 0.0
) -> AxisParameters:
    return AxisParameters(
        coulomb_n_m=coulomb,
        load_friction_ratio=load,
        relaxed_ratio=kept,
        viscous_n_m_s_rad=viscous,
        relaxation_s=time_s,
        current_offset_a=offset_a,
    )


THIRD = _prototype(
    "third prototype",
    _axis(3.44e-3, 0.579, 0.532, 40.7e-3, 3.26),
    _axis(6.56e-3, 0.389, 0.656, 5.2e-3, 4.62),
    _axis(0.70e-3, 0.721, 0.763, 29.2e-3, 5.82, -1.08e-3),
)
"""Journal bearings in the tool tip, steel tube. The numbers were chosen so that the paper's method
gives the paper's Tables 2 to 4 on it; nothing was measured."""

BALL = _prototype(
    "ball bearings",
    _axis(3.4e-3, 0.05, 0.8, 20e-3, 3.0),
    _axis(4.0e-3, 0.05, 0.8, 5e-3, 3.0),
    _axis(1.0e-3, 0.05, 0.8, 15e-3, 3.0),
)
"""The first prototype: very little load-dependent friction. Assumed."""

JOURNAL = _prototype(
    "journal bearings",
    _axis(4.5e-3, 0.5, 0.6, 40e-3, 3.5),
    _axis(6.0e-3, 0.45, 0.65, 10e-3, 4.5),
    _axis(1.0e-3, 0.7, 0.75, 30e-3, 5.5),
)
"""The second prototype, small and on a wooden platform. Assumed."""

PROTOTYPES = {"third": THIRD, "journal": JOURNAL, "ball": BALL}

LEAD_S = 0.5
"""What a master asks for, at 2 kHz: rest before a motion, and length of the motion itself."""


def hold(axis: AxisParameters, force_n: float, hold_s: float, rise_s: float = LEAD_S) -> FloatArray:
    """Return a grasp up to a force, held, and let go again, rad, shape (n,)."""
    top = _depth(axis, force_n)
    rest = np.zeros(round(LEAD_S * RATE_HZ))
    held = np.full(round(hold_s * RATE_HZ), top)
    return np.concatenate([rest, _rise(0.0, top, rise_s), held, _rise(top, 0.0), rest])


def end_of_hold(hold_s: float) -> tuple[float, float]:
    """Return the last tenth of a second of a hold, as times in the run, s."""
    last = 2 * LEAD_S + hold_s - 0.05
    return last - 0.1, last


def periodic(axis: AxisParameters, force_n: float) -> FloatArray:
    """Return eight squeezes at 2 Hz from first contact up to a force, rad, shape (n,)."""
    time_s = np.arange(round(4 * RATE_HZ)) / RATE_HZ
    squeeze = 0.5 - 0.5 * np.cos(2 * np.pi * 2 * time_s)
    first = axis.contact_rad
    return np.concatenate([_rise(0.0, first), first + (_depth(axis, force_n) - first) * squeeze])


def _depth(axis: AxisParameters, force_n: float) -> float:
    return axis.contact_rad + force_n * axis.arm_m / axis.contact_n_m_rad


def _rise(start: float, stop: float, duration_s: float = LEAD_S) -> FloatArray:
    return minimum_jerk(start, stop, duration_s, RATE_HZ)
