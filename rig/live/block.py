"""Input of the display: a block of samples and the state at its arrival."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError

FloatArray = NDArray[np.float64]


class BlockError(DataError):
    """The parts of a block do not belong together."""


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """State of one device.

    Attributes:
        name: Name of the device.
        state: One word: `ok`, `armed`, `disarmed`, `stale`, `fault`, ...
        detail: Further information for the user; may be empty.
    """

    name: str
    state: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class LimitStatus:
    """One watched quantity and how far it may go.

    Attributes:
        name: Limited quantity.
        value: Its value now; the limit holds in both directions.
        limit: The magnitude that trips the rig, positive.
        unit: Unit of both.
    """

    name: str
    value: float
    limit: float
    unit: str


@dataclass(frozen=True, eq=False)
class SampleBlock:
    """Consecutive samples, usually 50 ms of them.

    A block without samples means that nothing arrived during its time.

    Attributes:
        time_s: Device clock, shape (n,), increasing.
        columns: Channel name to values, shape (n,) each, SI units, closing positive.
        flags: `estimation.recording.Flag` bits, shape (n,), uint8.
        estimates: Channel name to its estimate, shape (n,) each; may be empty.
        lost: Samples lost since the start.
        devices: State of each device.
        limits: Watched limits; may be empty.
        inside: Channel name to whether its estimate is within the fitted range of its
            estimator, shape (n,) each; channels of estimators without a range are missing.
    """

    time_s: FloatArray
    columns: Mapping[str, FloatArray]
    flags: NDArray[np.uint8]
    estimates: Mapping[str, FloatArray]
    lost: int
    devices: tuple[DeviceStatus, ...]
    limits: tuple[LimitStatus, ...] = ()
    inside: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that the parts have one length and time increases.

        Raises:
            BlockError: They do not.
        """
        parts: list[tuple[str, NDArray[Any]]] = [("flags", self.flags)]
        for named in (self.columns, self.estimates, self.inside):
            parts += named.items()
        for name, values in parts:
            if values.shape != self.time_s.shape:
                raise BlockError(
                    f"{name} of a block has shape {values.shape}, its time {self.time_s.shape}."
                )
        if np.any(~np.isfinite(self.time_s)) or np.any(np.diff(self.time_s) <= 0):
            raise BlockError("The time of a block does not increase at every sample.")

    def __len__(self) -> int:
        return int(self.time_s.size)
