"""How far the rig's encoders and its measured current may contradict one another before it trips.

The firmware core holds these limits. The board in Python, which is for simulation without a
compiler, does not.
"""

from typing import Annotated

from pydantic import Field

from rig.configuration.sections import Number, Section

Window = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Ratio = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]


class PlausibilitySection(Section):
    """What is believed of the drive train; defaults are those of the reference rig.

    Each window is wider than what the shipped protocols need on simulated rigs whose parameters
    vary by 15 % and that have one hidden effect (docs/decisions/0281). Stiffness and torque
    constant are believed to a half: the board adds half of the twist, the stretch and the motor's
    torque they give to each window.

    Attributes:
        following_rad: Farthest the followed encoder may be from its target.
        following_s: How long it may be farther.
        command_full_scale_a: Motor current of a full command.
        command_offset_a: Motor current at a command of 0.
        current_window_a: Largest difference of measured and commanded current, averaged over
            `current_s`. The controller's limit must lie below the motor controller's own.
        current_s: Time of that average.
        frozen_current_a: Change of the current behind which a motor that did not move has a dead
            encoder; half of the current limit if unset.
        frozen_motor_rad: Motor shaft angle within which it did not move.
        torque_constant_n_m_a: Torque at the spindle a motor current, at rest.
        still_torque_n_m: Largest torque of a motor at rest that the torque sensor does not find:
            its friction. Beyond it the encoders are dead.
        still_change_n_m: Farthest the proximal torque may change while no encoder counts; more
            where the gearhead is so stiff that it turns the spindle by less than two counts.
        still_rise_n_m: Farthest the motor's torque may rise, while no encoder counts, above the
            friction it overcame in its last motion.
        beyond_rad: Farthest beyond its travel limit the spindle may be as the jaw's encoder shows.
        probe_rad: Distance to the end of the travel that the spindle is to turn towards, within
            which the encoders may not count for 30 ms, or 0.3 s at the target. Then the board pulls
            away from that end by twice `still_torque_n_m` until they count; after 10 ms without a
            count they are dead.
        probe_s_rad: How much longer they may not count, for each radian farther from that end.
        gear_ratio: Motor turns a turn of the spindle; 0 for no comparison.
        gear_stiffness_n_m_rad: Stiffness of the gearhead's twist, at the spindle.
        twist_window_rad: Largest span of what motor and spindle differ by besides that twist, at
            the spindle: backlash, friction, and a stiffness that is not quite right.
        jaw_ratio: Jaw angle a spindle angle; 0 for no comparison.
        jaw_zero_rad: Jaw angle at spindle angle zero.
        cable_stiffness_n_m_rad: Stiffness of the cable's stretch, at the jaw.
        stretch_window_rad: Largest span of what jaw and spindle differ by besides that stretch, at
            the jaw.
        spindle_jump_rad: Farthest the spindle may turn in one sample.
        jaw_jump_rad: Farthest the jaw may turn in one sample.
    """

    following_rad: Window = 0.5
    following_s: Annotated[float, Field(gt=0, le=60)] = 0.2
    command_full_scale_a: Window = 2.06
    command_offset_a: Number = -0.019
    current_window_a: Window = 0.05
    current_s: Annotated[float, Field(gt=0, le=1)] = 0.02
    frozen_current_a: Window | None = None
    frozen_motor_rad: Window = 0.008
    torque_constant_n_m_a: Window = 0.897
    still_torque_n_m: Window = 0.085
    still_change_n_m: Window = 0.02
    still_rise_n_m: Window = 0.032
    beyond_rad: Window = 0.06
    probe_rad: Window = 0.75
    probe_s_rad: Window = 2.0
    gear_ratio: Ratio = 35.0
    gear_stiffness_n_m_rad: Window = 5.4
    twist_window_rad: Window = 0.03
    jaw_ratio: Ratio = 0.913
    jaw_zero_rad: Number = 1.272
    cable_stiffness_n_m_rad: Window = 0.751
    stretch_window_rad: Window = 0.105
    spindle_jump_rad: Window = 0.1
    jaw_jump_rad: Window = 0.1
