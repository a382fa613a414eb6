"""Questions and answers on a Dynamixel's line: each is asked again when its answer is bad."""

from drivers.counters import DeviceCounters, silent
from drivers.dynamixel import protocol
from drivers.dynamixel.protocol import Register
from drivers.errors import CodedError, FrameError
from drivers.transport.transport import Transport

REPLY_TIMEOUT_S = 0.02
"""Time for an answer: 500 us at most in the device, and what a USB adapter takes."""


class InstructionRefusedError(CodedError):
    """The device has refused an instruction; `code` is its reason, a key of `protocol.ERRORS`."""


class Line:
    """One device on a half-duplex line.

    Args:
        transport: The way to it.
        device_id: Its identifier.
        counters: Where retries, time-outs and damaged answers are counted.
    """

    def __init__(self, transport: Transport, device_id: int, counters: DeviceCounters) -> None:
        self._transport = transport
        self._id = device_id
        self._counters = counters
        self.alert = False
        """Whether the newest answer says that the device has a hardware error."""

    def read(self, register: Register) -> bytes:
        """Return the value of a register.

        Raises:
            LinkTimeoutError: Nobody answers.
            InstructionRefusedError: The device refuses.
        """
        return self.ask(protocol.READ, protocol.read_question(register))

    def read_number(self, register: Register) -> int:
        """Return the number, 0 or above, that a register holds; raises as `read`."""
        return int.from_bytes(self.read(register), "little")

    def write(self, register: Register, value: int) -> None:
        """Write a number to a register; raises as `read`."""
        self.ask(protocol.WRITE, protocol.write_question(register, value))

    def ask(self, instruction: int, parameters: bytes = b"") -> bytes:
        """Return the parameters of the answer to an instruction; raises as `read`."""
        request = protocol.encode(self._id, instruction, parameters)
        for _ in self._counters.attempts():
            self.discard()
            self._transport.write(request)
            answer = self._receive()
            if answer is not None:
                return self._checked(answer, instruction)
        where = f"{self._transport.url}, identifier {self._id}"
        check = "Check its supply, the identifier and the bit rate (57600 from the factory)."
        raise silent("Dynamixel", where, REPLY_TIMEOUT_S, check)

    def discard(self, wait_s: float = 0.0) -> None:
        """Drop what comes unasked in a time: it is late."""
        self._counters.discarded_bytes += len(self._transport.read(wait_s))

    def _receive(self) -> bytes | None:
        """Return error and parameters of the next status packet, None when none comes in time."""
        give_up_s = self._transport.now_s + REPLY_TIMEOUT_S
        came = b""
        while True:
            found = protocol.find(came)
            if found is not None:
                packet, came = found
                try:
                    device_id, instruction, body = protocol.decode(packet)
                except FrameError:
                    self._counters.crc_errors += 1
                    self._counters.discarded_bytes += len(packet)
                    return None
                if device_id == self._id and instruction == protocol.STATUS and body:
                    self._counters.discarded_bytes += len(came)
                    return body
                continue  # an adapter's echo, or another device's
            remaining_s = give_up_s - self._transport.now_s
            if remaining_s <= 0:
                if came:
                    self._counters.crc_errors += 1  # bytes of it are missing
                    self._counters.discarded_bytes += len(came)
                return None
            came += self._transport.read(remaining_s)

    def _checked(self, body: bytes, instruction: int) -> bytes:
        self.alert = bool(body[0] & protocol.ALERT)
        number = body[0] & ~protocol.ALERT
        if number:
            raise InstructionRefusedError(
                f"The Dynamixel {self._id} has refused instruction {instruction:#04x}.",
                f"Its reason: {protocol.ERRORS.get(number, f'number {number}')}.",
                "Check its operating mode and limits, and whether its bus watchdog has tripped.",
                number,
            )
        return body[1:]
