"""The machine a configuration names, and what else is installed for it."""

from rig.configuration.config import Config
from rig.configuration.machine_settings import installed
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
