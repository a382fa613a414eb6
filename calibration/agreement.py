"""Encoders held against each other in recordings that exist: scale and offset, run by run.

    angle = a reference + c + d T + h sgn(v)

as a calibration of an encoder has it (`calibration.sessions.encoder`). The scatter of a and c over
the runs is their uncertainty. An error counts where it is larger than that, and larger than what
twist and lost motion do to the difference of the two within a run: a tare at standstill includes
the torque held by friction, so the twist at zero torque is known no better.

The motor's and the spindle's encoder are on one shaft line and share a zero. The jaw's is behind a
cable that slips, yields and is mounted at any angle: its ratio and zero in an ordinary recording do
not verify a calibration.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.chain import PAIRS, Pair
from calibration.errors import CalibrationError
from calibration.history import COVERAGE
from estimation.recording import FloatArray, Recording

VERIFIED = {"spindle": PAIRS["spindle"]}
"""Encoders that recordings verify."""

LEAST_RUNS = 3
"""Runs below which a scatter over runs has no meaning."""

MOVING = 0.1
"""Share of a run's usual speed below which the direction of motion is not taken."""


class NoPairError(CalibrationError):
    """The recordings have no two encoders that can be compared."""


@dataclass(frozen=True)
class Agreement:
    """One encoder against its reference."""

    encoder: str  # its name, a key of `VERIFIED`
    channel: str
    reference: str  # channel of the encoder it is compared with
    runs: int
    scale: float  # slope over the nominal ratio; 1 if both agree
    # expanded uncertainty of it, two standard deviations of the mean of runs
    scale_uncertainty: float
    offset_rad: float  # angle where the reference is at zero
    offset_uncertainty_rad: float  # expanded uncertainty of it
    travel_rad: float  # usual travel of a run
    # half width of the middle 95 % of their difference in a usual run, by twist, lost motion and
    # noise
    within_run_rad: float

    @property
    def scale_is_wrong(self) -> bool:
        """Whether the scale is off by more than uncertainty, twist and lost motion explain."""
        error = abs(self.scale - 1.0)
        return error > self.scale_uncertainty and error * self.travel_rad > self.within_run_rad

    @property
    def offset_is_wrong(self) -> bool:
        """Whether the offset is larger than uncertainty, twist and lost motion explain."""
        return abs(self.offset_rad) > max(self.offset_uncertainty_rad, self.within_run_rad)


def agreements(recordings: Iterable[Recording]) -> list[Agreement]:
    """Return each encoder of runs with motion of one rig against its reference.

    Raises:
        NoPairError: No two encoders are in three runs that move.
    """
    runs = list(recordings)
    found = []
    for name, pair in VERIFIED.items():
        fits = [fit for run in runs if (fit := fitted(run, pair)) is not None]
        if len(fits) >= LEAST_RUNS:
            found.append(_agreement(name, pair, np.array(fits)))
    if not found:
        pairs = "; ".join(f"{p.channel} and {p.reference}" for p in VERIFIED.values())
        raise NoPairError(
            "No two encoders can be compared in these recordings.",
            f"At least {LEAST_RUNS} runs that move are needed with one of: {pairs}.",
            "Record a protocol that moves: rig record --protocol diagnosis",
        )
    return found


def fitted(run: Recording, pair: Pair) -> Sequence[float] | None:
    """Return scale, offset, travel and spread of one run; None where it cannot be fitted."""
    if pair.channel not in run or pair.reference not in run:
        return None
    angle, reference = run[pair.channel], run[pair.reference]
    speed = np.gradient(reference, run.time_s)
    usual = float(np.percentile(np.abs(speed), 90))
    used = run.valid & (np.abs(speed) > MOVING * usual)
    columns = [reference, np.ones(len(run)), np.sign(speed)]
    if pair.torque in run:
        columns.append(run[pair.torque])
    table: FloatArray = np.column_stack(columns)[used]
    scale = np.linalg.norm(table, axis=0)
    table, scale = table[:, scale > 0], scale[scale > 0]
    if len(table) < 10 * table.shape[1] or table.shape[1] < 2 or usual == 0:
        return None
    weights, _, rank, _ = np.linalg.lstsq(table / scale, angle[used], rcond=None)
    if rank < table.shape[1]:
        return None
    difference = angle[used] - pair.nominal_ratio * reference[used]
    low, high = np.percentile(difference, [2.5, 97.5])
    slope, offset = (weights / scale)[:2]
    travel = float(np.ptp(reference[used])) * pair.nominal_ratio
    return slope / pair.nominal_ratio, offset, travel, (high - low) / 2


def _agreement(name: str, pair: Pair, fits: FloatArray) -> Agreement:
    middle = np.median(fits, axis=0)
    spread = COVERAGE * fits.std(axis=0, ddof=1) / np.sqrt(len(fits))
    return Agreement(
        encoder=name,
        channel=pair.channel,
        reference=pair.reference,
        runs=len(fits),
        scale=float(middle[0]),
        scale_uncertainty=float(spread[0]),
        offset_rad=float(middle[1]),
        offset_uncertainty_rad=float(spread[1]),
        travel_rad=float(middle[2]),
        within_run_rad=float(middle[3]),
    )
