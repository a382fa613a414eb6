"""A simulated run made again from its log: the commands, the compiled core and the plant."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.framing import FrameStream
from drivers.teensy.core import FirmwareBoard
from drivers.teensy.profile import Profile
from drivers.teensy.protocol import TRIP_SHIFT, Trip
from rig.configuration.config import Config
from rig.errors import DataError, UsageError
from rig.log.reader import LogFile, read_log
from rig.log.run import CONFIG
from rig.log.streams import COUNTS, FLIGHT
from rig.machines.choose import machine_of
from rig.simulation.logger import open_simulated_logger

STEP_TICKS = 200
"""Ticks between two looks at the board's output, which it holds for longer than that."""


@dataclass(frozen=True)
class CoreReplay:
    """What came of a replay."""

    samples: int  # samples of the log
    same: int  # how many of them the core gave again, bit for bit
    first_difference: str  # the first that differs, in words; empty when none does
    trips: tuple[str, ...]  # what the board tripped over in the log, in order
    core: str  # firmware version and build of the log
    is_same_core: bool  # whether the core in use is that build
    commands: int  # bytes that were sent to the board

    @property
    def passed(self) -> bool:
        """Whether every sample is the same."""
        return self.same == self.samples > 0


def replay_core(path: Path, config: Config | None = None) -> CoreReplay:
    """Run the compiled core and the simulated plant again with a log's commands.

    A configuration is in place of the log's, which states no hidden effects.

    Raises:
        DataError: The log has no commands, or no configuration.
        UsageError: It is of a real rig, or the compiled core is not built.
    """
    log = read_log(path, tolerant=True)
    if FLIGHT not in log.topics or not len(log.topics[FLIGHT]):
        raise DataError(
            f"{path} has no commands.",
            "It is of another program, of an older version, or of a device without a board.",
            "Record it again.",
        )
    settings = config or _config_of(log)
    if settings.logger.url != "sim://":
        raise UsageError(
            f"{path} was recorded on {settings.logger.url}.",
            "What a real shaft did cannot be computed again.",
            "Name a log of a simulated rig (`sim://`).",
        )
    profile = machine_of(settings).profile
    board = open_simulated_logger(settings).board
    if not isinstance(board, FirmwareBoard):
        raise UsageError("The firmware's core is not built.", fix="Run: make -C firmware")
    logged = log.topics[COUNTS].rows
    commands = _commands(log.topics[FLIGHT].rows)
    again = _run(board, profile, commands, int(logged["tick_us"][-1]) if len(logged) else 0)
    details = log.run.details if log.run else {}
    build = details.get("firmware_build", "")
    same, difference = _compared(logged, again)
    codes = dict.fromkeys((logged["status"].astype(np.int64) >> TRIP_SHIFT).tolist())
    return CoreReplay(
        len(logged),
        same,
        difference,
        tuple(Trip(code).name.lower().replace("_", " ") for code in codes if code),
        f"{details.get('firmware_version', 'unknown')}, build {build or 'unknown'}",
        build == f"{board.build_hash:08x}",
        sum(len(data) for _, data in commands),
    )


def _config_of(log: LogFile) -> Config:
    carried = log.attached(CONFIG)
    if carried is None:
        raise DataError(f"{log.path} has no configuration.", fix="Name one with --config.")
    return Config.model_validate_json(carried)


def _commands(rows: NDArray[np.void]) -> list[tuple[int, bytes]]:
    names = [name for name in rows.dtype.names or () if name.startswith("word_")]
    words = np.stack([rows[name] for name in names], axis=1).astype("<u8")
    sizes = rows["size"].tolist()
    ticks = rows["tick_us"].tolist()
    return [(t, w.tobytes()[:n]) for t, w, n in zip(ticks, words, sizes, strict=True)]


def _run(
    board: FirmwareBoard, profile: Profile, commands: list[tuple[int, bytes]], last_us: int
) -> NDArray[np.void]:
    """Return every sample that the board sends."""
    stream = FrameStream(profile.sample.itemsize)
    sent = [np.empty((0, profile.sample.itemsize), np.uint8)]
    tick = 0

    def advance(until: int) -> None:
        nonlocal tick
        while tick < until:
            step = min(STEP_TICKS, until - tick)
            board.advance(step)
            tick += step
            sent.append(stream.feed(board.transmit()).payloads)

    for tick_us, data in commands:
        advance(round(tick_us / profile.tick_us))
        board.receive(data)
    # the clock of a sample wraps; the commands' does not
    behind_us = (last_us - tick * profile.tick_us) % 2**32
    if behind_us < 2**31:
        advance(tick + behind_us // profile.tick_us + 1)
    return np.concatenate(sent).view(profile.sample)[:, 0]


def _compared(logged: NDArray[np.void], again: NDArray[np.void]) -> tuple[int, str]:
    """Return how many samples are the same, and the first difference in words."""
    place = {key: row for row, key in enumerate(_keys(again))}
    rows = np.array([place.get(key, -1) for key in _keys(logged)])
    if not len(rows):
        return 0, "the log has no samples"
    if not len(again):
        return 0, "the core sent no sample"
    found = rows >= 0
    whole = again[np.where(found, rows, 0)]
    names = [n for n in logged.dtype.names or () if n in (again.dtype.names or ())]
    equal = {n: (logged[n].astype(np.int64) == whole[n].astype(np.int64)) & found for n in names}
    same = np.all(list(equal.values()), axis=0)
    if same.all():
        return len(logged), ""
    first = int(np.argmin(same))
    number = int(logged["sequence"][first])
    if not found[first]:
        return int(same.sum()), f"sample {number} is not there"
    name = next(n for n in names if not equal[n][first])
    values = f"{logged[name][first]} in the log, {whole[name][first]} now"
    return int(same.sum()), f"{name} of sample {number}: {values}"


def _keys(samples: NDArray[np.void]) -> list[tuple[int, int]]:
    return list(zip(samples["sequence"].tolist(), samples["tick_us"].tolist(), strict=True))
