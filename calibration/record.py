"""The immutable record of one calibration: what was measured, by whom, with what, and the fit."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from calibration.errors import CalibrationError
from calibration.linear import LinearCalibration
from estimation.recording import FloatArray

LINE = "line"
"""Form of a fit `(input - zero) * slope`; the only one that a session's set of lines can take."""

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class RawFile:
    """A file the calibration was made from."""

    path: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> "RawFile":
        """Hash a file as it is now.

        Raises:
            CalibrationError: It cannot be read.
        """
        try:
            return cls(str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest())
        except OSError as error:
            raise CalibrationError(f"{path} cannot be read.", str(error)) from error


@dataclass(frozen=True, slots=True)
class Fit:
    """Parameters and how well they are known.

    Attributes:
        form: Meaning of the parameters, such as `line` (slope, zero) or `polynomial` (c0, c1, ...).
        parameters: Name to value, in the order of the names, which a record's file has too; SI
            units of the channel over the input's unit.
        covariance: Of the parameters in the order in which they are given, rows or an array of
            shape (p, p); kept as rows in the order of the names. Empty where nothing is known, as
            for numbers copied from a certificate.
        residual_rms: Root mean square of the residual, the channel's unit; None if not measured.
    """

    form: str
    parameters: Mapping[str, float]
    covariance: Rows | FloatArray = ()
    residual_rms: float | None = None
    points: int = 0

    def extended(
        self, values: Mapping[str, float], deviations: Sequence[float] | None = None
    ) -> "Fit":
        """Return the fit with further parameters, which its own are not correlated with.

        Their standard deviations are 0 where none are given.
        """
        variances = np.square(np.zeros(len(values)) if deviations is None else deviations)
        covariance = block_diag(self.covariance, np.diag(variances))
        whole = {**self.parameters, **values}
        return replace(self, parameters=whole, covariance=covariance)

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, dtype=float)
        size = len(self.parameters)
        if not np.isfinite(list(self.parameters.values())).all():
            raise CalibrationError(f"A parameter of {dict(self.parameters)} is not a number.")
        if covariance.size and (
            covariance.shape != (size, size) or not np.isfinite(covariance).all()
        ):
            raise CalibrationError(
                f"The covariance has shape {covariance.shape}.",
                f"{size} parameters need {size} x {size} finite numbers.",
            )
        names = list(self.parameters)
        order = sorted(range(size), key=names.__getitem__)
        ordered = {names[k]: self.parameters[names[k]] for k in order}
        rows = covariance[np.ix_(order, order)].tolist() if covariance.size else []
        object.__setattr__(self, "parameters", ordered)
        object.__setattr__(self, "covariance", tuple(map(tuple, rows)))


@dataclass(frozen=True, slots=True)
class Validity:
    """Where and how long a calibration may be used.

    Attributes:
        low: Least value of the input that was calibrated; None if not stated.
        high: Greatest value of the input that was calibrated; None if not stated.
        days: Days after which it is stale; None if it never is.
    """

    low: float | None = None
    high: float | None = None
    days: float | None = None

    def __post_init__(self) -> None:
        numbers = [x for x in (self.low, self.high, self.days) if x is not None]
        if not np.isfinite(numbers).all() or (
            self.low is not None and self.high is not None and self.low >= self.high
        ):
            raise CalibrationError(f"{self} is not a range of validity.")


@dataclass(frozen=True)
class CalibrationRecord:
    """One calibration as it was made. Its hash is its name; nothing in it ever changes.

    Attributes:
        kind: Kind of procedure: `certificate`, `torque`, `fsr`, ...
        channel: SI channel it gives.
        input: Raw counts field or channel it reads.
        made_at: When, ISO 8601 with the offset from UTC.
        instrument: Serial number of the instrument it holds for; empty if it holds for any.
        serials: Device to serial number.
        firmware_hash: CRC-32 of the sources of the firmware behind the raw log; empty if none was,
            0 where the board was not built from any.
        tared: Whether the zero is measured again before each run.
        figure_svg: Residual figure as SVG text; empty if there is none.
    """

    kind: str
    channel: str
    input: str
    made_at: str
    operator: str
    fit: Fit
    validity: Validity = Validity()
    instrument: str = ""
    serials: Mapping[str, str] = field(default_factory=dict)
    firmware_hash: str = ""
    raw: tuple[RawFile, ...] = ()
    code_version: str = ""
    tared: bool = False
    figure_svg: str = ""
    notes: str = ""

    def __post_init__(self) -> None:
        for name in ("kind", "channel"):
            value = getattr(self, name)
            if not value.replace("_", "").replace("-", "").isalnum() or not value.isascii():
                raise CalibrationError(f"{value!r} is not a {name}.", "It is part of a file name.")
        if not self.operator.strip():
            raise CalibrationError("A calibration needs the name of who made it.")
        if _time(self.made_at).tzinfo is None:
            raise CalibrationError(f"{self.made_at!r} lacks its offset from UTC.")

    @property
    def key(self) -> tuple[str, str, str]:
        """What it can be the active one of: kind, channel, instrument."""
        return self.kind, self.channel, self.instrument

    @property
    def made(self) -> datetime:
        """When it was made."""
        return _time(self.made_at)

    @property
    def content_hash(self) -> str:
        """SHA-256 of its JSON form, first 16 hexadecimal digits."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:16]

    def to_json(self) -> str:
        """Return the record as JSON, always the same text for the same content."""
        return json.dumps(asdict(self), indent=1, sort_keys=True, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str) -> "CalibrationRecord":
        """Read a record written by `to_json`.

        Raises:
            CalibrationError: The text is not such a record.
        """
        try:
            raw: dict[str, Any] = json.loads(text)
            files = tuple(RawFile(**file) for file in raw["raw"])
            own = {"fit": Fit(**raw["fit"]), "validity": Validity(**raw["validity"]), "raw": files}
            return cls(**{**raw, **own})
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise CalibrationError(
                "The text is not a calibration record.", f"{type(error).__name__}: {error}"
            ) from error

    def line(self) -> LinearCalibration:
        """Return it as the line a session applies.

        Raises:
            CalibrationError: It is not a line.
        """
        if self.fit.form != LINE:
            raise CalibrationError(
                f"{self.kind} of {self.channel} is a {self.fit.form}, not a line.",
                "Only a line turns raw counts into a session's channel.",
            )
        return LinearCalibration(
            channel=self.channel,
            counts=self.input,
            slope=self.fit.parameters["slope"],
            zero_counts=self.fit.parameters["zero"],
            source=f"record {self.content_hash}, {self.kind} of {self.made_at} by {self.operator}",
            tared=self.tared,
        )


def record_of_line(line: LinearCalibration, **rest: Any) -> CalibrationRecord:
    """Return the record of a line whose numbers come from a certificate or a datasheet.

    The rest are the other fields of the record: `kind`, `made_at`, `operator` and more.
    """
    fit = Fit(LINE, {"slope": line.slope, "zero": line.zero_counts})
    own = {"notes": line.source, "tared": line.tared, **rest}
    return CalibrationRecord(channel=line.channel, input=line.counts, fit=fit, **own)


def _time(text: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError as error:
        raise CalibrationError(f"{text!r} is not a date and time.", "ISO 8601 is.") from error
