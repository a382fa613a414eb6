"""The machine a configuration names."""

from rig.config import Config
from rig.machines.machine import Machine


def machine_of(config: Config) -> Machine:
    """Return the machine of a session with this configuration."""
    if config.logger.profile == "grasper":
        from rig.machines.grasper import GrasperMachine

        return GrasperMachine()
    from rig.machines.reference import ReferenceMachine

    return ReferenceMachine()
