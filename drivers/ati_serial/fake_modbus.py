"""The Modbus half of the fake sensor: pymodbus' server, taken apart from its event loop.

Frames, requests, the register store and the answers to what is refused are the library's; the
sensor's own two functions and its lock are added as the library's guide says custom messages are.
The library's server lives in real time. Its parts do not, so they are called here one message at a
time, and the fake stays exactly repeatable.
"""

from collections.abc import Coroutine
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.exceptions import ModbusIOException
from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.simulator import DataType, SimData, SimDevice
from pymodbus.simulator.simcore import SimCore

from drivers.ati_serial import protocol

REGISTERS = 0x1000
_OWN_FUNCTION_SIZE = 5
"""Slave, function, one byte, CRC."""


class ModbusServer:
    """Registers behind Modbus RTU, with the sensor's lock and its switch into the stream."""

    def __init__(self, first: int, block: bytes) -> None:
        values = [0] * REGISTERS
        words = [int.from_bytes(block[at : at + 2], "big") for at in range(0, len(block), 2)]
        values[first : first + len(words)] = words
        simdata = SimData(0, values=values, datatype=DataType.REGISTERS)
        self._store = SimCore(SimDevice(protocol.SLAVE, simdata, action=self._guard))
        decoder = DecodePDU(True)
        for message in self._own_messages():
            decoder.register(message)
        self._framer = FramerRTU(decoder)
        self.locked = True
        self.streaming = False

    def registers(self, first: int, count: int) -> tuple[int, ...]:
        """Return the values of registers."""
        return tuple(self._store.devices[protocol.SLAVE].block["x"][2][first : first + count])

    def answer(self, message: bytes) -> bytes:
        """Return the answer to one message; nothing to what is damaged or for another slave."""
        try:
            _, request = self._framer.handleFrame(message, protocol.SLAVE, 0)
        except ModbusIOException as error:
            response: ModbusPDU = ExceptionResponse(error.fcode or 0, ExcCodes.ILLEGAL_FUNCTION)
        else:
            if request is None:
                return b""
            response = _done(request.datastore_update(self._store, protocol.SLAVE))  # type: ignore[arg-type]
        response.dev_id = protocol.SLAVE
        return self._framer.buildFrame(response)

    async def _guard(self, *access: Any) -> ExcCodes | None:
        """Refuse to write while the storage is locked."""
        written = access[-1]
        return ExcCodes.ILLEGAL_ADDRESS if written and self.locked else None

    def _own_messages(self) -> tuple[type[ModbusPDU], ...]:
        server = self

        class Own(ModbusPDU):
            rtu_frame_size = _OWN_FUNCTION_SIZE
            content = b""

            def decode(self, data: bytes) -> None:
                self.content = data

            def encode(self) -> bytes:
                return self.content

        class Storage(Own):
            function_code = protocol.STORAGE

            async def datastore_update(self, context: Any, device_id: int) -> ModbusPDU:
                server.locked = self.content != protocol.UNLOCK
                self.content = b"\x01"
                return self

        class Stream(Own):
            function_code = protocol.STREAM

            async def datastore_update(self, context: Any, device_id: int) -> ModbusPDU:
                server.streaming = self.content == protocol.START_STREAM
                self.content = bytes([server.streaming])
                return self

        return Storage, Stream


def _done(work: Coroutine[Any, Any, ModbusPDU]) -> ModbusPDU:
    """Return the result of a coroutine that never waits."""
    try:
        work.send(None)
    except StopIteration as end:
        response: ModbusPDU = end.value
        return response
    work.close()
    raise RuntimeError("the server's work waits for something")
