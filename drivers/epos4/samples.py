"""What an EPOS4 measures: its channels, and its process data as values of them."""

import numpy as np

from drivers.device import Channel, SampleFlag
from drivers.epos4 import protocol
from drivers.epos4.protocol import Feedback, Ratings, State


def channels_of(ratings: Ratings | None, rate_hz: float) -> tuple[Channel, ...]:
    """Return position, torque and current of the motor, and the torque commanded.

    Args:
        ratings: The drive's motor data; None where unknown; the range is then infinite.
        rate_hz: How often SYNC is sent.
    """
    torque = current = np.inf
    if ratings is not None:
        torque, current = ratings.torque_n_m(2**15), ratings.current_a(2**15)
    return (
        Channel("position_count", "count", rate_hz, -(2.0**31), 2.0**31 - 1, "motor encoder"),
        Channel("motor_torque_n_m", "N m", rate_hz, -torque, torque, "averaged motor torque"),
        Channel("motor_current_a", "A", rate_hz, -current, current, "by the torque constant"),
        Channel("command_torque_n_m", "N m", rate_hz, -torque, torque, "torque commanded"),
    )


def values_of(ratings: Ratings, answer: Feedback, target_per_mille: int) -> tuple[float, ...]:
    """Return the value of each channel.

    Args:
        ratings: The drive's motor data.
        answer: The answer to a SYNC.
        target_per_mille: Torque commanded, thousandths of the rated torque.
    """
    return (
        float(answer.position_count),
        ratings.torque_n_m(answer.torque_per_mille),
        ratings.current_a(answer.torque_per_mille),
        ratings.torque_n_m(target_per_mille),
    )


def flags_of(answer: Feedback) -> int:
    """Return the `SampleFlag` bits of an answer."""
    faulty = protocol.state_of(answer.statusword) in (State.FAULT, State.FAULT_REACTION)
    return SampleFlag.SUSPECT if faulty else 0
