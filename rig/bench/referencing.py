"""Reference a board: give the encoders their counts at the place where the rig stands."""

import math
from collections.abc import Sequence

from drivers.errors import CommandRefusedError
from drivers.teensy.driver import TeensyLogger
from drivers.teensy.protocol import Identity, Result
from rig.bench.logger import held_logger, read_for
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.machines.choose import machine_of

REST_S = 0.3
"""How long the board is read first, so that it has seen whether a shaft turns."""
INDEX_SAMPLES = 60_000
"""Samples in which the index is waited for."""
READ_S = 0.2
MOST_RAD = 200 * math.pi
"""Largest angle of a mark: a hundred turns."""


def require_place(config: Config, here_rad: Sequence[float]) -> None:
    """Refuse a place that the configured rig cannot be referenced at.

    Raises:
        UsageError: The rig's encoders need no reference, the number of angles is wrong, or one is
            not an angle of a mark.
    """
    names = machine_of(config).here_channels
    if config.logger.driver == "epos4":
        raise UsageError(
            f"{config.name} has no board to reference.",
            "The drive of an EPOS4 rig counts its own encoder.",
            "Give a configuration of a rig with a logger board.",
        )
    if len(here_rad) != len(names):
        raise UsageError(
            f"{config.name} is referenced by {len(names)} angles; {len(here_rad)} were given.",
            fix=f"Give --at {len(names)} times: {', '.join(names)}.",
        )
    for name, angle_rad in zip(names, here_rad, strict=True):
        if not abs(angle_rad) <= MOST_RAD:  # nor is NaN
            raise UsageError(
                f"{name} = {angle_rad:g} is not an angle of a mark.",
                f"An angle of at most {MOST_RAD:.0f} rad, which are 100 turns, can be given.",
                "Give --at the angle in rad.",
            )


def reference_board(config: Config, here_rad: Sequence[float], at_index: bool = False) -> Identity:
    """Reference the board of a rig that stands still and disarmed; return its identity then.

    The rig stands at `here_rad`: the machine's `here_channels`, rad. With `at_index` that is where
    the index of the spindle's encoder is; it is waited for.

    Raises:
        UsageError: See `require_place`.
        CommandRefusedError: The board is armed, or a shaft turns.
        DriverError: The board cannot be reached.
    """
    require_place(config, here_rad)
    machine = machine_of(config)
    counts = machine.reference_counts(config, config.calibration_set(), here_rad)
    with held_logger(config) as logger:
        logger.identify()
        logger.start()
        read_for(logger, REST_S)
        if at_index:
            _reference_at_index(logger, counts)
        else:
            logger.reference(counts)
        logger.stop()
        return logger.identify()


def _reference_at_index(logger: TeensyLogger, counts: Sequence[int]) -> None:
    """Wait until somebody has turned the spindle through its index and let it go."""
    seen = 0
    while True:
        try:
            logger.reference(counts, at_index=True)
            return
        except CommandRefusedError as error:
            waits = error.code in (Result.NO_INDEX, Result.NOT_AT_REST)
            if not waits or seen >= INDEX_SAMPLES:
                raise
        seen += len(read_for(logger, READ_S).samples)
