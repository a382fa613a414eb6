"""A calibration against the earlier ones of the same sensor: changes, and whether it drifted."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import hypot, inf

from calibration.record import LINE, CalibrationRecord

COVERAGE = 2.0
"""Standard deviations of an expanded uncertainty, about 95 %."""

MOST = 5
"""Earlier calibrations that one is compared with."""


@dataclass(frozen=True)
class Change:
    """One parameter in two calibrations."""

    parameter: str
    earlier: float
    now: float
    # expanded uncertainty of the difference, or None where a record states none
    uncertainty: float | None

    @property
    def normalised_error(self) -> float | None:
        """Difference over its expanded uncertainty, E_n of ISO/IEC 17043; above 1 they disagree."""
        if self.uncertainty is None:
            return None
        difference = abs(self.now - self.earlier)
        return difference / self.uncertainty if self.uncertainty else (inf if difference else 0.0)

    @property
    def drifted(self) -> bool:
        """Whether the two disagree beyond their uncertainties."""
        error = self.normalised_error
        return error is not None and error > 1.0


def earlier_ones(
    record: CalibrationRecord, records: Iterable[CalibrationRecord]
) -> list[CalibrationRecord]:
    """Return the latest calibrations of the same sensor before a record, the newest first."""
    same = [
        one
        for one in records
        if one.key == record.key
        and one.input == record.input
        and one.fit.form == record.fit.form
        and one.content_hash != record.content_hash
        and one.made <= record.made
    ]
    return sorted(same, key=lambda one: one.made, reverse=True)[:MOST]


def changes(earlier: CalibrationRecord, now: CalibrationRecord) -> list[Change]:
    """Return the parameters of two calibrations, those that both have.

    The zero of a line that is measured again before each run is left out.
    """
    found = []
    for name, value in now.fit.parameters.items():
        if name not in earlier.fit.parameters or (
            name == "zero" and now.tared and now.fit.form == LINE
        ):
            continue
        spreads = [deviation(one, name) for one in (earlier, now)]
        known = [spread for spread in spreads if spread is not None]
        uncertainty = COVERAGE * hypot(*known) if len(known) == len(spreads) else None
        found.append(Change(name, earlier.fit.parameters[name], value, uncertainty))
    return found


def deviation(record: CalibrationRecord, name: str) -> float | None:
    """Return the standard deviation of a record's parameter, None where it states none."""
    if not record.fit.covariance:
        return None
    place = list(record.fit.parameters).index(name)
    return float(record.fit.covariance[place][place] ** 0.5)
