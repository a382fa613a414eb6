"""CANopen to one node over a bus that the caller reads himself: no thread runs.

The `canopen` library does the service data protocol; its waiting for an answer is replaced by
reading the bus, which also serves whoever subscribed to a frame that comes meanwhile.
"""

import logging
from collections.abc import Callable
from typing import TypeVar

import canopen
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.counters import TRIES, DeviceCounters
from drivers.epos4.dictionary import object_dictionary
from drivers.errors import CodedError, DriverError, LinkTimeoutError
from drivers.transport.can_bus import CanBus, CanFrame
from drivers.transport.transport import time_left

T = TypeVar("T")
REPLY_TIMEOUT_S = 0.1

logging.getLogger("canopen").addHandler(logging.NullHandler())  # its complaints are our errors


class ObjectRefusedError(CodedError):
    """The drive refused to read or write one of its objects; `code` is the abort code."""


class CanopenLink:
    """One node's objects and frames."""

    def __init__(self, bus: CanBus, node_id: int, counters: DeviceCounters) -> None:
        self.bus = bus
        self.node_id = node_id
        self._counters = counters
        self._network = _InlineNetwork(bus)
        self._sdo = _InlineSdo(  # type: ignore[no-untyped-call]
            0x600 + node_id, 0x580 + node_id, object_dictionary()
        )
        self._sdo.network = self._network
        self._sdo.bus = bus
        self._sdo.pump = self.pump
        self._network.subscribe(0x580 + node_id, self._sdo.on_response)

    def subscribe(self, can_id: int, take: Callable[[bytes], None]) -> None:
        """Give the data of frames with `can_id` to `take`, whenever the bus is read."""
        self._network.subscribe(can_id, lambda _id, data, _time: take(bytes(data)))

    def pump(self, timeout_s: float) -> bool:
        """Serve the next frame, waiting at most `timeout_s` for it; return whether one came."""
        frame = self.bus.read(timeout_s)
        if frame is None:
            return False
        if not frame.extended:
            self._network.notify(frame.can_id, bytearray(frame.data), self.bus.now_s)
        return True

    def send(self, can_id: int, data: bytes = b"") -> None:
        """Send a frame."""
        self.bus.send(CanFrame(can_id, data))

    def read(self, index: int, subindex: int = 0) -> int:
        """Return the number an object holds.

        Raises:
            ObjectRefusedError: The drive has no such object, or does not let it be read.
        """
        variable = self._variable(index, subindex)
        data = self._transfer("read", index, subindex, lambda: self._sdo.upload(index, subindex))
        value = variable.decode_raw(data)
        if not isinstance(value, int):
            raise DriverError(f"Object {index:#06x}:{subindex} holds no number.")
        return value

    def write(self, index: int, subindex: int, value: int) -> None:
        """Write a number to an object; errors as `read`."""
        data = self._variable(index, subindex).encode_raw(value)
        self._transfer(
            f"write {value} to",
            index,
            subindex,
            lambda: self._sdo.download(index, subindex, data),
        )

    def _variable(self, index: int, subindex: int) -> canopen.objectdictionary.ODVariable:
        variable = self._sdo.od.get_variable(index, subindex)
        if variable is None:
            raise DriverError(f"Object {index:#06x}:{subindex} is not in the dictionary.")
        return variable

    def _transfer(self, verb: str, index: int, subindex: int, attempt: Callable[[], T]) -> T:
        for _ in self._counters.attempts():
            try:
                return attempt()
            except SdoAbortedError as error:
                raise ObjectRefusedError(
                    f"Node {self.node_id} refuses to {verb} {index:#06x}:{subindex}.",
                    f"{error}.",
                    "Check the drive's firmware version and network state.",
                    error.code,
                ) from error
            except SdoCommunicationError:
                continue
        raise LinkTimeoutError(
            f"Node {self.node_id} on {self.bus.url} does not answer.",
            f"{TRIES} requests to {verb} {index:#06x}:{subindex} had {REPLY_TIMEOUT_S:g} s each.",
            "Check its supply, node number, the bit rate and the terminators.",
        )


class _InlineNetwork(canopen.Network):
    """Sends over our bus; received frames are handed to `notify`."""

    def __init__(self, bus: CanBus) -> None:
        super().__init__()
        self._can_bus = bus

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        if remote:
            raise DriverError("Remote frames are not sent.")
        self._can_bus.send(CanFrame(can_id, bytes(data)))


class _InlineSdo(SdoClient):
    """Waits for an answer by reading the bus."""

    MAX_RETRIES = 1  # retries are counted one level up
    bus: CanBus
    pump: Callable[[float], bool]

    def read_response(self) -> bytes:
        for remaining_s in time_left(self.bus, REPLY_TIMEOUT_S):
            if not self.responses.empty():
                break
            self.pump(remaining_s)
        if self.responses.empty():
            raise SdoCommunicationError("No SDO response received")
        self.RESPONSE_TIMEOUT = 0.001  # it is there
        answer: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return answer
