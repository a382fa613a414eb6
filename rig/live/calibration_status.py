"""Status of the calibrations in the live display: their age, and values beyond their range."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from calibration.record import CalibrationRecord
from calibration.rules import judge_range
from calibration.store import active_lines
from rig.configuration.config import Config
from rig.live.block import DeviceStatus
from rig.machines.reading import Reading
from rig.output.table import counted

NAME = "calibration"


class CalibrationStatus:
    """Holds a session's active records against today and against what is measured.

    Args:
        config: The configuration; without a store only the set is named.
        set_name: Name of the set in use.
        now: Time of the session.
    """

    def __init__(self, config: Config, set_name: str, now: datetime | None = None) -> None:
        self._set_name = set_name
        self._now = now or datetime.now(UTC)
        self._records: Sequence[CalibrationRecord] = ()
        if config.store is not None:
            self._records = tuple(active_lines(config.store, config.instrument.serial).values())
        self._remarks = [f"{v.channel} {v.message}" for v in config.calibration_verdicts()]

    def of(self, reading: Reading) -> DeviceStatus:
        """Return the status with a reading: `suspect` outside a range, `stale` past its days."""
        names = reading.counts.dtype.names or ()
        outside = [
            verdict.channel
            for record in self._records
            if record.input in names
            for verdict in judge_range(record, reading.counts[record.input])
        ]
        if outside:
            return DeviceStatus(NAME, "suspect", f"outside its range: {', '.join(outside)}")
        if self._remarks:
            return DeviceStatus(NAME, "stale", "; ".join(self._remarks))
        return DeviceStatus(NAME, "ok", self._age())

    def _age(self) -> str:
        if not self._records:
            return f"{self._set_name}, no records of this rig"
        oldest = max(self._records, key=lambda record: self._now - record.made)
        days = (self._now - oldest.made) / timedelta(days=1)
        count, age = len(self._records), counted(round(days), "day")
        return f"{self._set_name}, {counted(count, 'record')}, oldest {age} ({oldest.channel})"
