"""A rig drawn over factors: its masses, springs, friction, drive and controller.

Parameters follow from a few scales (torque of the load, its shares lost to friction, twist and
stretch under it), so that a rig that is ten times as large is still one that works.
"""

import math
from typing import NamedTuple

import numpy as np

from rig.simulation.forms import Random
from rig.simulation.plant import TICK_S

USUAL_ACCELERATION_RAD_S2 = 12.0
USUAL_SPEED_RAD_S = 1.5
MOST_SUBSTEPS = 40


class Plant(NamedTuple):
    """A rig's mechanics, SI units, closing positive; the equations are `kernel`'s."""

    ratio: float  # Motor turns a spindle turn
    constant: float  # Torque constant, N m/A
    motor_inertia: float  # At the motor, kg m^2
    motor_viscous: float  # At the motor, N m s/rad
    motor_friction: float  # At the motor, N m
    motor_width: float  # Motor speed within which friction changes sign; 0 is friction that sticks
    gear_stiffness: float  # At the spindle, N m/rad
    gear_damping: float  # At the spindle, N m s/rad
    spindle_inertia: float  # kg m^2
    spindle_viscous: float  # N m s/rad
    spindle_friction: float  # N m
    spindle_width: float  # As the motor's
    pull: float  # Jaw angle a spindle angle
    cable_stiffness: float  # At the jaw, N m/rad
    cable_damping: float  # At the jaw, N m s/rad
    finger_inertia: float  # In front of the jaw's torque sensor, kg m^2
    load_inertia: float  # Behind it, kg m^2
    jaw_zero: float  # Jaw angle at spindle angle zero, rad
    current_lag: float  # Of the drive's current, s
    load_lag: float  # Of the load's torque, s
    load_constant: float  # Torque of the load unit, N m/A
    counts_per_turn: float  # Of the controller's encoder
    substeps: float  # Steps of the physics in a tick of 1 ms
    load_scale: float  # Torque at the jaw that the rig is made for, N m


class Controller(NamedTuple):
    """Gains in amperes and spindle radians; the kinds differ by which of them are zero."""

    kp: float  # A/rad
    kd: float  # A s/rad
    ki: float  # A/(rad s), cascaded A/rad
    forward: float  # Share of the target's speed that is fed forward
    inertia_a_s2_rad: float  # Current a target acceleration
    cascaded: float  # 1 where a position loop sets the speed of an inner loop
    outer_rad_s: float  # Gain of that position loop, 1/s
    speed_limit_rad_s: float  # Limit of that speed
    speed_gain: float  # Share of a new speed that the filter takes in a tick
    limit_a: float  # Limit of the current
    from_motor: float  # 1 where the motor's encoder is fed back, else the spindle's


CONTROLLERS = ("pi_feedforward", "pd", "current_limited", "cascaded")


def over(random: Random, low: float, high: float) -> float:
    """Return a number drawn between two, evenly on a logarithmic scale."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def draw_plant(random: Random, ratio: float | None = None) -> Plant:
    """Draw a rig, but for a gear ratio that is given."""
    drawn_ratio = over(random, 5.0, 150.0)
    n = drawn_ratio if ratio is None else ratio
    pull = over(random, 0.5, 1.8)
    load = over(random, 0.03, 0.4)
    torque = pull * load
    gear_stiffness = torque / over(random, 4e-3, 40e-3)
    cable_stiffness = load / over(random, 0.01, 0.2)
    jaw_inertia = cable_stiffness / (2.0 * np.pi * over(random, 25.0, 100.0)) ** 2
    spindle_inertia = gear_stiffness / (2.0 * np.pi * over(random, 90.0, 250.0)) ** 2
    rotor = max(
        torque * over(random, 0.03, 0.6) / USUAL_ACCELERATION_RAD_S2,
        gear_stiffness / (2.0 * np.pi * 150.0) ** 2,
    )
    finger = float(random.uniform(0.0, 0.02))
    friction = torque * over(random, 0.05, 0.5)
    rubbing = torque * over(random, 0.05, 0.35)
    current = over(random, 0.05, 5.0)
    dry = random.random(2) < 0.25
    widths = over(random, 0.005, 0.1), over(random, 0.005, 0.08)
    plant = Plant(
        ratio=n,
        constant=torque / n / current,
        motor_inertia=rotor / n**2,
        motor_viscous=torque * over(random, 0.02, 0.3) / USUAL_SPEED_RAD_S / n**2,
        motor_friction=friction / n,
        motor_width=0.0 if dry[0] else widths[0] * n,
        gear_stiffness=gear_stiffness,
        gear_damping=2.0 * random.uniform(0.05, 0.3) * math.sqrt(gear_stiffness * spindle_inertia),
        spindle_inertia=spindle_inertia,
        spindle_viscous=torque * over(random, 0.005, 0.1) / USUAL_SPEED_RAD_S,
        spindle_friction=rubbing,
        spindle_width=0.0 if dry[1] else widths[1],
        pull=pull,
        cable_stiffness=cable_stiffness,
        cable_damping=2.0 * random.uniform(0.03, 0.3) * math.sqrt(cable_stiffness * jaw_inertia),
        finger_inertia=finger * jaw_inertia,
        load_inertia=(1.0 - finger) * jaw_inertia,
        jaw_zero=float(random.uniform(-0.5, 1.5)),
        current_lag=over(random, 1e-4, 1.5e-3),
        load_lag=over(random, 5e-4, 5e-3),
        load_constant=over(random, 0.03, 0.5),
        counts_per_turn=over(random, 1e4, 3e5),
        substeps=1.0,
        load_scale=load,
    )
    return Plant(*map(float, plant._replace(substeps=substeps_of(plant))))


def substeps_of(plant: Plant) -> int:
    """Return the steps in a tick at which its fastest motion is followed."""
    n, pull = plant.ratio, plant.pull
    jaw = plant.finger_inertia + plant.load_inertia
    at_spindle = plant.gear_stiffness + pull**2 * plant.cable_stiffness
    fastest = math.sqrt(
        max(
            plant.gear_stiffness / n**2 / plant.motor_inertia
            + plant.gear_stiffness / plant.spindle_inertia,
            at_spindle / plant.spindle_inertia + plant.cable_stiffness / jaw,
        )
    )
    damped = max(
        plant.gear_damping / plant.spindle_inertia
        + plant.gear_damping / n**2 / plant.motor_inertia,
        pull**2 * plant.cable_damping / plant.spindle_inertia + plant.cable_damping / jaw,
    )
    steps = math.ceil(TICK_S * max(fastest / 0.5, damped / 0.7))
    return min(max(steps, 4), MOST_SUBSTEPS)


def draw_controller(random: Random, plant: Plant) -> tuple[str, Controller]:
    """Draw a controller for a rig: its kind, and gains for its masses and friction.

    Its stiffness is for a wanted error under the rig's load, as far as sampling allows.
    """
    kind = CONTROLLERS[int(random.integers(len(CONTROLLERS)))]
    n, torque = plant.ratio, plant.pull * plant.load_scale
    jaw = plant.finger_inertia + plant.load_inertia
    inertia = n * plant.motor_inertia + (plant.spindle_inertia + plant.pull**2 * jaw) / n
    from_motor = random.random() < 0.6
    fastest = 2.0 * np.pi * random.uniform(8.0, 20.0 if from_motor else 12.0)
    wanted = torque / n / over(random, 0.01, 0.06)
    stiffness = min(wanted, inertia * fastest**2)
    rate = math.sqrt(stiffness / inertia)
    damping = max(2.0 * random.uniform(0.6, 1.1) * rate * inertia, 0.04 * stiffness)
    damping = min(damping, 150.0 * (n * plant.motor_inertia if from_motor else inertia))
    per_amp = plant.constant
    needed = (torque * 1.6 / n + plant.motor_friction + plant.spindle_friction / n) / per_amp
    limit = needed * (over(random, 1.2, 1.8) if kind == "current_limited" else over(random, 2, 5))
    outer = stiffness / damping
    return kind, Controller(
        kp=stiffness / per_amp,
        kd=damping / per_amp,
        ki=0.0
        if kind == "pd"
        else (damping if kind == "cascaded" else stiffness) / per_amp * over(random, 0.5, 5.0),
        forward=0.0 if kind == "pd" and random.random() < 0.5 else float(random.uniform(0.6, 1.0)),
        inertia_a_s2_rad=inertia / per_amp if kind == "pi_feedforward" else 0.0,
        cascaded=float(kind == "cascaded"),
        outer_rad_s=outer,
        speed_limit_rad_s=over(random, 4.0, 12.0),
        speed_gain=1.0 - math.exp(-TICK_S * 2.0 * np.pi * random.uniform(60.0, 250.0)),
        limit_a=limit,
        from_motor=float(from_motor),
    )
