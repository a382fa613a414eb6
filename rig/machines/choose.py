"""The machine a configuration names, and what else is installed for it."""

from importlib.metadata import EntryPoint, entry_points
from typing import Any

from rig.configuration.config import Config
from rig.errors import UsageError
from rig.machines.machine import Machine

MACHINES = "rig.machines"
"""Entry point group: `[logger] profile` to a class that implements `Machine`."""
SIMULATED_BOARDS = "rig.simulated_boards"
"""Entry point group: `[logger] profile` to a function that makes its simulated board."""


def machine_of(config: Config) -> Machine:
    """Return the machine of a session with this configuration.

    Raises:
        UsageError: No machine is installed for the profile of its logger.
    """
    machine: Machine = installed(MACHINES, config.logger.profile).of(config)
    return machine


def installed(group: str, profile: str) -> Any:
    """Return the object in an entry point group for a profile.

    Raises:
        UsageError: None is installed, or it cannot be loaded.
    """
    found = entry_points(group=group, name=profile)
    if not found:
        known = ", ".join(sorted(entry.name for entry in entry_points(group=group)))
        raise UsageError(
            f"Nothing is installed for [logger] profile = {profile!r}.",
            f"The entry point group {group} has: {known or 'none'}.",
            "Install the project again (`pip install -e .`), or name another profile.",
        )
    return _load(next(iter(found)))


def _load(entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"{entry.value} cannot be loaded: {error}.",
            f"It is installed for [logger] profile = {entry.name!r}.",
            "Install its package again, or remove it.",
        ) from error
