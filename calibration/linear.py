"""Counts to SI units: one straight line a channel, and the immutable set of them a log names.

A channel's value is `(counts - zero_counts) * slope`. The slope carries the sign that makes closing
positive. The zero comes from the sensor at rest before a run and is kept apart from the slope, so
that a log can be read again with another zero or another slope.
"""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.errors import CalibrationError
from estimation.channels import unit_of

SHIPPED = Path(__file__).parent / "shipped"


@dataclass(frozen=True, slots=True)
class LinearCalibration:
    """One channel's line."""

    channel: str  # SI channel it gives, with the unit in its name
    counts: str  # field of the raw counts it reads
    slope: float  # SI units a count; negative where the raw count falls on closing
    zero_counts: float = 0.0  # counts at zero, from the certificate or the mounting
    source: str = ""  # source of slope and zero
    tared: bool = False  # whether the zero is measured again before each run

    def __post_init__(self) -> None:
        unit_of(self.channel)
        if not (np.isfinite(self.slope) and self.slope != 0.0 and np.isfinite(self.zero_counts)):
            raise CalibrationError(
                f"{self.channel}: slope {self.slope}, zero {self.zero_counts} do not make a line.",
                "A slope is finite and not zero, a zero is finite.",
            )


@dataclass(frozen=True)
class CalibrationSet:
    """The calibrations of every channel of a rig."""

    name: str
    channels: Mapping[str, LinearCalibration]  # SI channel to its line

    @property
    def content_hash(self) -> str:
        """SHA-256 of the set's content, first 16 hexadecimal digits."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:16]

    def to_json(self) -> str:
        """Return the set as JSON, the form a log carries as an attachment."""
        lines = {name: asdict(line) for name, line in sorted(self.channels.items())}
        return json.dumps({"name": self.name, "channels": lines}, indent=1, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "CalibrationSet":
        """Read a set written by `to_json`; CalibrationError where the text is none."""
        try:
            raw = json.loads(text)
            lines = {name: LinearCalibration(**line) for name, line in raw["channels"].items()}
            return cls(str(raw["name"]), lines)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise CalibrationError("The text is not a calibration set.", str(error)) from error

    def apply(
        self, counts: NDArray[np.void], zeros: Mapping[str, float] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Convert structured raw counts, shape (n,), to SI channels.

        A zero that was measured, in counts by channel, goes before the line's own.
        """
        zeros = zeros or {}
        return {
            name: (counts[line.counts] - zeros.get(name, line.zero_counts)) * line.slope
            for name, line in self.channels.items()
        }


def load_calibration_set(path: Path) -> CalibrationSet:
    """Read a calibration set from a TOML file: `name`, then one table `[channels.NAME]` a channel.

    Raises:
        CalibrationError: The file cannot be read or is not a calibration set.
    """
    try:
        raw = tomllib.loads(path.read_text())
        lines = {
            name: LinearCalibration(channel=name, **table)
            for name, table in raw["channels"].items()
        }
        return CalibrationSet(str(raw["name"]), lines)
    except OSError as error:
        raise CalibrationError(
            f"The calibration file {path} cannot be read.", str(error), "Check the path."
        ) from error
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise CalibrationError(
            f"{path} is not a calibration set.",
            f"{type(error).__name__}: {error}.",
            "It needs `name` and a table [channels.NAME] with counts and slope for each channel.",
        ) from error


def shipped_calibration_set(name: str) -> CalibrationSet:
    """Return a calibration set shipped with the project, such as `reference`."""
    return load_calibration_set(SHIPPED / f"{name}.toml")
