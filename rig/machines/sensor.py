"""A device without motors where a rig has its logger: it is watched and recorded, never armed."""

from rig.machines.drive import DeviceMachine


class SensorMachine(DeviceMachine):
    """A machine without motors."""
