"""What was sent to the board, in a log."""

import numpy as np

from rig.bench.session import Session
from rig.log.streams import FLIGHT
from rig.log.writer import LogWriter


class FlightStream:
    """What was sent to the board since the session began, for one log.

    Args:
        session: The session.
    """

    def __init__(self, session: Session) -> None:
        self._flight = session.flight
        self._written = 0

    def write(self, log: LogWriter, log_time_ns: int) -> None:
        """Write what is not in the log yet.

        Args:
            log: The log.
            log_time_ns: Time at which the log has it; its own clock is in `tick_us`.
        """
        if self._flight is None:
            return
        rows, self._written = self._flight.rows(self._written)
        if len(rows):
            log.write(FLIGHT, rows, np.full(len(rows), log_time_ns))
