"""What an EPOS4 measures: its channels, and its process data as a batch of at most one sample."""

import numpy as np

from drivers.device import Batch, Channel, SampleFlag
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


def batch_of(
    ratings: Ratings,
    feedback: Feedback | None,
    target_per_mille: int,
    now_s: float,
    number: int,
    lost: int,
) -> Batch:
    """Return a batch with the answer to one SYNC, an empty one where there is none.

    Args:
        ratings: The drive's motor data.
        feedback: The answer.
        target_per_mille: Torque commanded, thousandths of the rated torque.
        now_s: When the answer had come, host clock.
        number: The SYNC's number.
        lost: SYNCs without an answer so far.
    """
    count = 0 if feedback is None else 1
    answer = feedback or Feedback(0, 0, 0)
    values = {
        "position_count": float(answer.position_count),
        "motor_torque_n_m": ratings.torque_n_m(answer.torque_per_mille),
        "motor_current_a": ratings.current_a(answer.torque_per_mille),
        "command_torque_n_m": ratings.torque_n_m(target_per_mille),
    }
    state = protocol.state_of(answer.statusword)
    faulty = count and state in (State.FAULT, State.FAULT_REACTION)
    return Batch(
        {name: np.full(count, value) for name, value in values.items()},
        np.full(count, now_s),
        "host",
        np.full(count, number, np.int64),
        np.full(count, SampleFlag.SUSPECT if faulty else 0, np.uint8),
        lost,
    )
