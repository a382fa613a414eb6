"""The limits that every board is armed with: of a motor's position loop, and of its watches."""

from dataclasses import dataclass

from drivers.teensy.protocol import TOP, WATCHDOG_US, SafeState


@dataclass(frozen=True, kw_only=True)
class MotorLimits:
    """What is watched over time of a motor with a position loop.

    Attributes:
        max_motor_step: Fastest motor, counts a tick, in three ticks on end.
        continuous_current: Current that warms the motor no further, counts.
        i2t: Heat above it that the motor can take, counts^2 s: the integral of the measured current
            squared less the continuous one squared, never below 0.
        stall_current: Current, counts, above which a motor that does not move is stalled.
        stall_motion: Motor counts within which it does not move.
    """

    max_motor_step: int = TOP
    continuous_current: int = TOP
    i2t: int = TOP
    stall_current: int = TOP
    stall_motion: int = 0


@dataclass(frozen=True, kw_only=True)
class LoopLimits(MotorLimits):
    """What a motor's position loop is believed by, too.

    Attributes:
        max_motor_jump: Farthest the motor's count may go in one tick.
        max_target_step: Farthest a setpoint may be from the one before it, counts; the first after
            arming may be `max_following` from where the shaft stands.
        max_following: Farthest the shaft may be from its target, counts.
        following_ticks: How long it may be farther.
        full_scale_current: Measured current at a command of 10000, counts, signed; 0 where current
            and command are not compared.
        current_offset: Measured current at a command of 0, counts.
        max_current_error: Largest difference between measured and commanded current, counts.
        current_ticks: Ticks over which that difference is averaged.
        frozen_current: Change of the current, counts, behind which a motor that did not move has a
            dead encoder.
        frozen_motion: Motor counts within which it did not move.
    """

    max_motor_jump: int = TOP
    max_target_step: int = TOP
    max_following: int = TOP
    following_ticks: int = TOP
    full_scale_current: int = 0
    current_offset: int = 0
    max_current_error: int = TOP
    current_ticks: int = 1
    frozen_current: int = TOP
    frozen_motion: int = 0


@dataclass(frozen=True, kw_only=True)
class Choices:
    """How long each watch lasts, and what a tripped board does.

    Attributes:
        stall_ticks: How long a motor may be stalled.
        saturated_ticks: How long a converter's count may be at the end of its range.
        stale_ticks: How long a converter's count may stay the same.
        dry_ticks: How long the last setpoint is held while none follows.
        watchdog_us: How long the host may be silent, 5 ms to 1 s.
        safe_state: `SafeState`. Held are a silent host, a stall, and a saturated or stale sensor;
            any other crossing releases whatever is asked for.
        hold_command_e4: Largest command while holding, 1e-4 of full scale.
        hold_ticks: How long it may hold; then it releases.
        seek: 1 to move without a reference, towards a stop: the controller's limit is then no
            larger than `hold_command_e4`, and the board has no reference from then on. 0 on a
            grasper, which is referenced by hand.
    """

    stall_ticks: int = TOP
    saturated_ticks: int = TOP
    stale_ticks: int = TOP
    dry_ticks: int = TOP
    watchdog_us: int = WATCHDOG_US
    safe_state: int = SafeState.RELEASE
    hold_command_e4: int = 0
    hold_ticks: int = TOP
    seek: int = 0


MOTOR_LIMIT_NAMES = tuple(MotorLimits.__annotations__)
LOOP_LIMIT_NAMES = tuple(LoopLimits.__annotations__)
CHOICE_NAMES = tuple(Choices.__annotations__)
"""Each group in the order of the wire; the choices end the limits of every board."""
