"""Control of a grip torque by the estimate from motor current alone; the sensor is a check.

The load motor represents the gripped object. The jaw moves to and fro a little: at standstill
friction hides as much torque as a grip may have, and in motion the estimate includes it. Once per
period the load is corrected by a fraction of the control error.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.reference import REFERENCE
from estimation.rest import CLOSING_RAD_S
from rig.bench.session import Session
from rig.errors import SafetyTripError, UsageError
from rig.live.estimator import LiveEstimator, within_range
from rig.machines.reading import Reading
from rig.protocols import trajectory

AMPLITUDE_RAD = 0.15
FREQUENCY_HZ = 0.5
GAIN_A_N_M = 3.0
"""Change of load a period for an error, A/(N m); below one over the motor's constant it settles
whatever that constant is."""
SLEW_A_S = 0.4
SHARE = 0.8
"""Share of a limit that may be asked for."""


@dataclass(frozen=True, slots=True)
class Held:
    """One period: its end in the session, means in motion, and the load that was asked for."""

    time_s: float
    estimate_n_m: float
    sensor_n_m: float
    load_a: float


class Grip:
    """The controller: yields setpoints about a centre, and corrects a load of at most `most_a`."""

    def __init__(
        self, torque_n_m: float, centre_rad: float, most_a: float, duration_s: float
    ) -> None:
        self._torque_n_m = torque_n_m
        self._centre_rad = centre_rad
        self._most_a = most_a
        self._duration_s = duration_s
        self._load_a = 0.0
        self._asked_a = 0.0

    def setpoints(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Yield pieces of spindle angle and load until the time is over and the load is off."""
        pieces = round(self._duration_s * trajectory.SAMPLE_RATE_HZ / REFERENCE.max_setpoints)
        for piece in itertools.count():
            is_over = piece >= pieces
            if is_over and self._load_a <= 0.0:
                return
            yield self._angles(piece), self._loads(0.0 if is_over else self._asked_a)

    def correct(self, estimate_n_m: float) -> float:
        """Move the load by what the estimate of a period lacks; returns the load, A."""
        change = GAIN_A_N_M * (self._torque_n_m - estimate_n_m)
        self._asked_a = float(np.clip(self._asked_a + change, 0.0, self._most_a))
        return self._asked_a

    def _angles(self, piece: int) -> NDArray[np.float64]:
        number = piece * REFERENCE.max_setpoints + np.arange(REFERENCE.max_setpoints)
        phase = 2 * np.pi * FREQUENCY_HZ * number / trajectory.SAMPLE_RATE_HZ
        return np.asarray(self._centre_rad + AMPLITUDE_RAD * (1.0 - np.cos(phase)))

    def _loads(self, asked_a: float) -> NDArray[np.float64]:
        most = SLEW_A_S * REFERENCE.max_setpoints / trajectory.SAMPLE_RATE_HZ
        end = self._load_a + float(np.clip(asked_a - self._load_a, -most, most))
        loads = np.linspace(self._load_a, end, REFERENCE.max_setpoints)
        self._load_a = end
        return loads


def hold_grip(
    session: Session, estimator: LiveEstimator, torque_n_m: float, duration_s: float
) -> Iterator[Held]:
    """Hold a grip torque, closing positive, in an open session; yield each period as it ends.

    The estimator has seen nothing yet.

    Raises:
        UsageError: The torque is not within the limits, or not what is estimated.
        SafetyTripError: A limit was crossed, by a sensor or by the estimate; the rig is disarmed.
    """
    limits = session.config.reference_limits
    most = SHARE * limits.distal_torque_n_m
    if not 0 < torque_n_m <= most:
        raise UsageError(
            f"A grip of {torque_n_m:g} N m cannot be held.",
            f"It is to be above 0 and at most {SHARE:.0%} of the jaw's limit, {most:g} N m.",
        )
    if estimator.target_channel != "distal_torque_n_m":
        raise UsageError(
            f"The model estimates {estimator.target_channel}, not the jaw's torque.",
            fix="Name a model of the grasp with --model.",
        )
    for _ in session.rest(0.5):
        pass
    session.settle()
    session.take_zeros(0.5)
    most_a = SHARE * limits.load_command_a
    controller = Grip(torque_n_m, session.here[0], most_a, duration_s)
    period = _Period()
    for reading in session.follow(controller.setpoints()):
        estimate = within_range(estimator, estimator.push(reading.columns, reading.time_s))
        most_n_m = float(np.max(np.abs(estimate), where=np.isfinite(estimate), initial=0.0))
        if most_n_m > limits.distal_torque_n_m:
            session.safe()
            raise SafetyTripError(
                f"The estimate reached {most_n_m:.3g} N m at the jaw.",
                f"The limit is {limits.distal_torque_n_m:g}; the rig has been disarmed.",
            )
        ended = period.add(reading, estimate)
        is_holding = reading.setpoint.max() <= duration_s * trajectory.SAMPLE_RATE_HZ
        if ended is not None and is_holding:
            estimated, sensed = ended
            load_a = controller.correct(estimated)
            yield Held(float(reading.time_s[-1]), estimated, sensed, load_a)


class _Period:
    """Collects samples in motion until a period of the setpoints has been played."""

    def __init__(self) -> None:
        self._samples = round(trajectory.SAMPLE_RATE_HZ / FREQUENCY_HZ)
        self._number = 0
        self._estimates: list[NDArray[np.float64]] = []
        self._sensed: list[NDArray[np.float64]] = []

    def add(self, reading: Reading, estimate: NDArray[np.float64]) -> tuple[float, float] | None:
        """Return the means of estimate and sensor when a period is over."""
        phase = (reading.setpoint % self._samples) / self._samples
        speed = AMPLITUDE_RAD * 2 * np.pi * FREQUENCY_HZ * np.abs(np.sin(2 * np.pi * phase))
        kept = (reading.setpoint >= 0) & (speed > CLOSING_RAD_S) & (reading.flags == 0)
        kept &= np.isfinite(estimate)
        self._estimates.append(estimate[kept])
        self._sensed.append(reading.columns["distal_torque_n_m"][kept])
        number = int(reading.setpoint.max()) // self._samples
        if number <= self._number:
            return None
        self._number = number
        estimates, sensed = np.concatenate(self._estimates), np.concatenate(self._sensed)
        self._estimates, self._sensed = [], []
        if estimates.size < 100:
            return None
        return float(estimates.mean()), float(sensed.mean())
