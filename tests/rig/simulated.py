"""Small protocols and sessions on the simulated rig that several tests share."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.teensy.driver import TeensyLogger
from drivers.teensy.profile import Profile
from drivers.teensy.protocol import STATUS_ARMED
from drivers.teensy.reference import REFERENCE
from drivers.transport.faulty import FaultyTransport
from drivers.transport.simulated import Board, SimulatedTransport
from rig.bench.session import Session
from rig.configuration.config import Config, load_config
from rig.protocols.protocol import Protocol, protocol_toml
from rig.simulation.logger import open_simulated_logger


def short_protocol(runs: int = 3, duration_s: float = 1.0) -> Protocol:
    """A protocol of a few short runs, one load each."""
    loads = [round(0.1 * (k + 1), 1) for k in range(runs)]
    table = {"kind": "sine", "frequencies_hz": [1.0], "loads_a": loads, "duration_s": duration_s}
    return Protocol.model_validate({"name": "short", "runs": [table]})


def simulated(**simulation: object) -> Config:
    """The simulated rig's configuration, by default on the plain board."""
    return load_config().changed(simulation={"firmware": False, **simulation})


def transport(config: Config) -> SimulatedTransport:
    return open_simulated_logger(config)


def session(config: Config | None = None) -> Session:
    """A session on the simulated rig, by default on the plain board."""
    config = config or simulated()
    return Session(config, transport(config))


def protocol_file(folder: Path, *, runs: int = 1, duration_s: float = 1.0) -> Path:
    """Write a protocol of a few short runs; return its path."""
    path = folder / "short.toml"
    path.write_text(protocol_toml(short_protocol(runs, duration_s)))
    return path


def behind(link: SimulatedTransport, change: Callable[[bytes], bytes]) -> FaultyTransport:
    """A link whose incoming bytes go through a function: for losing and damaging them."""
    cable = FaultyTransport(link)
    cable.incoming = change
    return cable


def status_of(board: Board, profile: Profile = REFERENCE) -> NDArray[np.uint16]:
    """Ask a board, by a fresh link, for the status of its next samples."""
    logger = TeensyLogger(SimulatedTransport(board), profile)
    logger.identify()
    logger.start()
    status: NDArray[np.uint16] = logger.read(0.1).samples["status"]
    return status


def is_armed(board: Board, profile: Profile = REFERENCE) -> bool:
    """Whether a board's motors are in force now."""
    return bool((status_of(board, profile)[-1] & STATUS_ARMED) != 0)
