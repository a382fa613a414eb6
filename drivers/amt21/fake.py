"""An AMT21 that answers with the bytes a real one would, its shaft turning steadily.

Not modelled: the microseconds of the answer, and the line's turn-around.
"""

from drivers.amt21 import protocol
from drivers.amt21.driver import Amt21
from drivers.device import Device
from drivers.transport.faulty import Faults, FaultyTransport
from drivers.transport.simulated import Outbox, SimulatedTransport


class Amt21Fake(Outbox):
    """An encoder, with the interface of `drivers.transport.simulated.Board`."""

    def __init__(
        self,
        address: int = protocol.DEFAULT_ADDRESS,
        counts_a_tick: int = 7,
        multi_turn: bool = False,
        echo: bool = False,
    ) -> None:
        super().__init__()
        self._position = protocol.request(address)[0]
        self._turns = protocol.request(address, turns=True)[0]
        self._counts_a_tick = counts_a_tick
        self._multi_turn = multi_turn
        self._echo = echo
        self.count = 0
        """Where the shaft stands, counts over all turns."""

    def receive(self, data: bytes) -> None:
        """Answer each byte that asks this encoder."""
        for byte in data:
            if self._echo:
                self._out += bytes([byte])
            if byte == self._position:
                self._out += protocol.encode_reply(self.count % protocol.FULL_TURN)
            elif byte == self._turns and self._multi_turn:
                self._out += protocol.encode_reply(self.count // protocol.FULL_TURN)

    def advance(self, ticks: int) -> None:
        """Turn the shaft for `ticks` milliseconds."""
        self.count += ticks * self._counts_a_tick


def open_fake(faults: Faults) -> Device:
    """Open the driver on a fake encoder behind a cable with faults."""
    line = SimulatedTransport(Amt21Fake(multi_turn=True), "sim://amt21")
    return Amt21(FaultyTransport(line, faults), multi_turn=True)
