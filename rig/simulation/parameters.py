"""Parameters of the simulated rig: the plant, its sensors and the gains of its controller.

Each parameter says where its value is from:

- *measured*: found on the 49 good runs of `Tool_4_Maryland_L_4` of the public data set
  MRDLab/mis-tool-characterization (run 07 left out), every channel low-passed at 50 Hz (Butterworth
  order 3, zero phase), closing positive; "moving" means faster than 0.25 rad/s at the spindle,
  "mid-stroke" within 0.2 rad of the centre. v is the spindle's velocity, i the measured current;
- *datasheet*: from a public data sheet or a public parameter file of the same motor;
- *assumed*: chosen so that the simulation is well behaved. Nothing was measured.
"""

import math
from collections import namedtuple
from dataclasses import astuple, dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np


def _fixed(value: float) -> Any:
    """Return a field that `vary` does not change: geometry, scales, known limits."""
    return field(default=value, metadata={"varies": False})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantParameters:
    """The mechanics and the drive, SI units. Torques at the jaw and angles are closing-positive."""

    # Steps of the physics in one tick of 1 ms; 20 is 20 kHz. Assumed.
    substeps_ratio: float = _fixed(20.0)
    # Current of a full-scale command; falls on closing, so a positive command opens. Measured: i =
    # -2.064 command - 0.0194, least squares, all samples.
    command_full_scale_a: float = _fixed(2.06)
    # Limit of the drive. Measured: i is clipped at 0.56 A in the runaway of run 07.
    current_limit_a: float = _fixed(0.56)
    current_lag_s: float = 0.25e-3  # Time constant of the current loop. Assumed.
    # Of the motor, gear efficiency included. Measured: 0.897 N m/A at the spindle from proximal
    # torque = Kt i - F sgn(v) - b v + c while moving, over 35. The data sheet of the DCX 19 S has
    # 0.0356 for its 48 V winding, so 72 % arrives.
    torque_constant_n_m_a: float = 0.897 / 35.0
    rotor_inertia_kg_m2: float = 2.72e-7  # Datasheet (a course script, weak).
    # Coulomb friction of motor and gear at the motor shaft. Measured: 0.0294 N m at the spindle
    # from the regression of the torque constant, over 35.
    motor_friction_n_m: float = 0.0294 / 35.0
    # Datasheet (a course script, weak); too small to measure
    motor_viscous_n_m_s_rad: float = 0.7e-6
    gear_ratio: float = _fixed(35.0)  # Datasheet.
    # Of the gearhead's twist, seen at the spindle. Measured: slope of proximal torque over (motor
    # angle / 35 - spindle angle), each less its mean of the run: 5.4 over all loads (3.5 at load
    # 0.1, 7.4 at 1.0), leaving 5.8 mrad rms. It is a secant through some lost motion: above 60 mN m
    # alone the slope is 29.
    gear_stiffness_n_m_rad: float = 5.4
    gear_damping_n_m_s_rad: float = 4e-3  # Assumed.
    spindle_inertia_kg_m2: float = 4e-6  # Spindle, coupling and sensor. Assumed.
    # Coulomb friction of cable and instrument at the spindle's end, no load. Measured: proximal
    # torque = r distal + F0 sgn(v) + mu distal sgn(v) + c at mid-stroke has F0 = 0.0407, minus the
    # jaw end's part.
    spindle_friction_n_m: float = 0.0273
    spindle_viscous_n_m_s_rad: float = 5e-4  # Assumed; too small to be distinguished from zero.
    # Friction at the spindle per unit of cable torque (wrap of the cable). Measured: mu of the
    # regression above.
    cable_load_friction_ratio: float = 0.387
    # Jaw angle a spindle angle. Measured: jaw angle = r spindle - distal / k + c while moving.
    cable_ratio: float = _fixed(0.913)
    # Of the stretch, seen at the jaw. Measured: k of the same regression, 0.751.
    cable_stiffness_n_m_rad: float = 0.751
    # Measured roughly: the 59 Hz ring after a load step halves in about 50 ms
    cable_damping_n_m_s_rad: float = 1.5e-4
    # Jaw and load motor. Measured: the 59 Hz ring after a load step with the cable's stiffness.
    jaw_inertia_kg_m2: float = 5.5e-6
    # Coulomb friction of the instrument at the jaw. Measured: jaw angle lags by 19.6 mrad either
    # way at mid-stroke, times k.
    jaw_friction_n_m: float = 0.0147
    jaw_viscous_n_m_s_rad: float = 2e-4  # Assumed.
    # Jaw angle at spindle angle zero with a slack cable. Measured: c of the regression of the
    # ratio.
    jaw_zero_rad: float = _fixed(1.272)
    # Opposing torque a load current. Measured: distal torque = kL load + F sgn(v) + c at
    # mid-stroke.
    load_torque_n_m_a: float = 0.1163
    load_lag_s: float = 1e-3  # Time constant of the load motor's current loop. Assumed.
    # Coulomb friction of the load unit. Measured: F of that regression.
    load_friction_n_m: float = 0.0033
    stop_open_rad: float = _fixed(-0.05)  # Jaw angle of the open stop. Assumed.
    stop_closed_rad: float = _fixed(1.45)  # Jaw angle of the closed stop. Assumed.
    stop_stiffness_n_m_rad: float = 40.0  # Assumed.
    stop_damping_n_m_s_rad: float = 5e-3  # Assumed.
    # Speed of the motor over which its dry friction changes sign; 0 is friction that sticks. No dry
    # friction does that: it makes a rig of which a smooth change of sign is the whole truth.
    motor_creep_speed_rad_s: float = _fixed(0.0)
    spindle_creep_speed_rad_s: float = _fixed(0.0)  # The same of spindle and jaw.
    # Pitch of the wrist about which it swings by itself. Assumed.
    wrist_middle_rad: float = _fixed(0.0)
    wrist_swing_rad: float = _fixed(0.0)  # Amplitude of that; 0 holds the wrist. Assumed.
    wrist_period_s: float = _fixed(1.0)  # Period of that. Assumed.


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorParameters:
    """What stands between a physical quantity and a count, SI units unless a count is named."""

    # Encoders: counts a turn of motor, spindle and jaw. Datasheet.
    motor_count_per_turn: float = _fixed(4096.0)
    spindle_count_per_turn: float = _fixed(8192.0)
    jaw_count_per_turn: float = _fixed(4000.0)
    # Both torque channels. Stated in the data set's description.
    torque_n_m_per_count: float = _fixed(0.000039811)
    torque_quantum_count: float = _fixed(2.0)  # Torque counts come in multiples of this. Measured.
    # Largest torque count; the smallest is one beyond its negative. Assumed: 16 bit.
    torque_limit_count: float = _fixed(32767.0)
    # White noise, standard deviation. Measured: 0.277 mN m above 50 Hz of 500 Hz, over 0.95.
    proximal_noise_n_m: float = 0.29e-3
    distal_noise_n_m: float = 0.22e-3  # The same, 0.207 mN m above 50 Hz.
    # Zero offset at power-up. Measured: c of the regression of
    # `PlantParameters.spindle_friction_n_m` with r held at the cable ratio.
    proximal_offset_n_m: float = -7e-3
    distal_offset_n_m: float = 2e-3  # Zero offset at power-up. Assumed.
    proximal_ramp_n_m_s: float = 2e-6  # Steady drift of the zero. Assumed.
    distal_ramp_n_m_s: float = -1e-6  # Steady drift of the zero. Assumed.
    # Random walk of both zeros: standard deviation after 1 s, grows with the square root of time.
    # Assumed.
    torque_walk_n_m_s: float = 2e-5
    current_a_per_count: float = _fixed(1e-3)  # Measured: the quantum is 1 mA.
    current_noise_a: float = 5e-3  # White noise. Measured: 4.75 mA above 50 Hz, over 0.95.
    # Measured: see `PlantParameters.command_full_scale_a`; assumed to be the converter's, so that
    # it is there with the motor off too
    current_offset_a: float = -0.019
    # Largest current count; the smallest is one beyond its negative. Assumed: 16 bit, so that the
    # drive's limit comes first.
    current_limit_count: float = _fixed(32767.0)
    # Grip force a count: 20 N at full scale. Assumed.
    fsr_n_per_count: float = _fixed(20.0 / 4095.0)
    fsr_offset_count: float = 40.0  # Output of the amplifier with no force. Assumed.
    fsr_noise_count: float = 4.0  # White noise. Assumed.
    fsr_limit_count: float = _fixed(4095.0)  # Largest count, 12 bit; the smallest is 0. Datasheet.
    # From the jaw's axis to the force-sensing resistor. Stated in the paper, 12 mm.
    lever_arm_m: float = _fixed(0.012)
    # Coloured noise of both torque channels in addition to white noise, standard deviation. None
    # was measured.
    torque_colour_n_m: float = _fixed(0.0)
    current_colour_a: float = _fixed(0.0)  # The same of the current. None was measured.
    colour_time_s: float = _fixed(0.05)  # Time within which coloured noise forgets. Assumed.


PlantTuple = namedtuple("PlantTuple", [item.name for item in fields(PlantParameters)])  # type: ignore[misc]
SensorTuple = namedtuple("SensorTuple", [item.name for item in fields(SensorParameters)])  # type: ignore[misc]


def compiled(parameters: PlantParameters | SensorParameters) -> Any:
    """Return parameters as compiled code takes them: a named tuple of floats, same names."""
    kind = PlantTuple if isinstance(parameters, PlantParameters) else SensorTuple
    return kind(*map(float, astuple(parameters)))


REFERENCE_GAINS = (20.0, 0.2, 4.0, 0.3, 2700.0)
"""Gains of `drivers.teensy.control` in its order and units (kp, ki, kd, velocity filter, limit).

On the default plant they follow the reference sinusoid of 30 degrees amplitude at 0.1 to 0.5 Hz
against loads 0.1 to 1.0 with 0.1 to 0.6 degrees rms (the reference rig: 0.7 to 3.0). Twice kp, ki
and kd, a spread of 25 % in every parameter and each hidden effect at strength 1.5 stay stable. The
limit is the drive's: 2700 ticks are 0.556 A."""


Parameters = TypeVar("Parameters", PlantParameters, SensorParameters)


def vary(parameters: Parameters, seed: int, spread: float = 0.1) -> Parameters:
    """Return a copy as another rig of the same make would have it.

    Every parameter that is not fixed by construction (ratios, scales, limits) is multiplied by a
    log-normal factor; the spread is the standard deviation of its logarithm, 0.1 about 10 %. The
    same seed gives the same rig.
    """
    generator = np.random.default_rng(seed)
    changed = {}
    for item in fields(parameters):
        if item.metadata.get("varies", True):
            factor = math.exp(spread * float(np.clip(generator.standard_normal(), -3.0, 3.0)))
            changed[item.name] = getattr(parameters, item.name) * factor
    return replace(parameters, **changed)
