"""The power stage of an EPOS4: the state machine of CiA 402, commanded and read back by objects."""

from typing import TYPE_CHECKING

from drivers.epos4 import protocol
from drivers.epos4.faults import fault
from drivers.epos4.node import Node
from drivers.epos4.protocol import State

if TYPE_CHECKING:
    from drivers.epos4.canopen_link import CanopenLink

GENERIC_ERROR = 0x1000
"""Code of a fault for which the drive gives none."""
_FAULTY = (State.FAULT, State.FAULT_REACTION)


class PowerStage:
    """The state machine of one drive.

    Args:
        link: The way to its objects.
        node: Its network state, served while it is waited for.
    """

    def __init__(self, link: "CanopenLink", node: Node) -> None:
        self._link = link
        self._node = node

    def enable(self) -> None:
        """Energise the motor in cyclic torque, its target torque 0.

        Raises:
            DriveFaultError: The drive has a fault.
            LinkTimeoutError: It does not reach operation in time.
        """
        code = self.fault_code()
        if code:
            raise fault(code)
        write, read = self._link.write, self._link.read
        write(0x6071, 0, 0)
        write(0x6060, 0, protocol.CYCLIC_TORQUE)
        self._node.wait("the mode", lambda: read(0x6061) == protocol.CYCLIC_TORQUE)
        write(0x6040, 0, protocol.SHUTDOWN)
        self._reach(State.READY)
        write(0x6040, 0, protocol.ENABLE_OPERATION)
        self._reach(State.OPERATION_ENABLED)

    def disable(self) -> None:
        """Take the motor out of force; returns when the drive has said that its stage is off.

        Raises:
            DriverError: It has not said so.
        """
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self._link.write(0x6071, 0, 0)
        self._node.wait("the power stage to be off", lambda: self._state() in protocol.POWERLESS)

    def reset_fault(self) -> None:
        """Reset a fault whose cause is gone; the stage stays off.

        Raises:
            LinkTimeoutError: The fault stays.
        """
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)
        self._link.write(0x6040, 0, protocol.FAULT_RESET)
        self._node.wait(
            f"the state {State.SWITCH_ON_DISABLED.value!r}",
            lambda: self._state() is State.SWITCH_ON_DISABLED,
        )
        self._link.write(0x6040, 0, protocol.DISABLE_VOLTAGE)

    def error_code(self) -> int:
        """Return the drive's newest error code, 0 when it has none."""
        return self._link.read(0x603F)

    def fault_code(self) -> int:
        """Return the code of the drive's fault, 0 when it has none."""
        return (self.error_code() or GENERIC_ERROR) if self._state() in _FAULTY else 0

    def _reach(self, wanted: State) -> None:
        def reached() -> bool:
            state = self._state()
            if state in _FAULTY:
                raise fault(self.error_code())
            return state is wanted

        self._node.wait(f"the state {wanted.value!r}", reached)

    def _state(self) -> State:
        """Return the state by request: before the first SYNC no process data contain it."""
        return protocol.state_of(self._link.read(0x6041))
