"""Places in the state of the simulated rig."""

from rig.simulation import hidden_sensors

(
    MOTOR_ANGLE, MOTOR_SPEED, SPINDLE_ANGLE, SPINDLE_SPEED, JAW_ANGLE, JAW_SPEED, CURRENT,
    LOAD_CURRENT, PROXIMAL_TORQUE, DISTAL_TORQUE, BRISTLE, CREEP_STRAIN, PROXIMAL_DRIFT,
    DISTAL_DRIFT, CLOCK, HYSTERESIS, HEAT, TWO_STATE, LAG_FIRST, LAG_SECOND, CREEP_FAST, CREEP_SLOW,
    SENSOR_LAG_FIRST, SENSOR_LAG_SECOND, AGE, PROXIMAL_COLOUR, DISTAL_COLOUR, CURRENT_COLOUR, RING,
) = range(29)  # fmt: skip
STATE_SIZE = RING + hidden_sensors.RING
"""Places in the state, SI units: motion, currents, torques at the torque sensors, the drift of the
two torque zeros, the time since the start, and the states of hidden effects; the last ones are the
jaw angles that a delayed encoder remembers."""
