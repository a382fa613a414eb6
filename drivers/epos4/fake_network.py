"""The network of the fake: `canopen`'s server in virtual time, its frames kept to be fetched."""

from dataclasses import dataclass

import canopen

from drivers.transport.can_bus import CanFrame


class FrameNetwork(canopen.Network):
    """Keeps the frames to be sent; what is periodic comes by ticks."""

    def __init__(self) -> None:
        super().__init__()
        self.out: list[CanFrame] = []
        self.tasks: list[Periodic] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Keep a frame."""
        self.out.append(CanFrame(can_id, bytes(data)))

    def send_periodic(  # type: ignore[override]
        self, can_id: int, data: bytes, period: float, remote: bool = False
    ) -> "Periodic":
        """Send a frame every `period` seconds from now on."""
        task = Periodic(self, can_id, data, round(period * 1000))
        self.tasks.append(task)
        return task

    def advance(self) -> None:
        """Let 1 ms pass."""
        for task in self.tasks:
            task.advance()


@dataclass(eq=False)
class Periodic:
    """A frame that is sent again and again."""

    network: FrameNetwork
    can_id: int
    data: bytes
    period_ms: int
    elapsed_ms: int = 0

    def advance(self) -> None:
        """Let 1 ms pass."""
        self.elapsed_ms += 1
        if self.elapsed_ms >= self.period_ms:
            self.elapsed_ms = 0
            self.network.send_message(self.can_id, self.data)

    def update(self, data: bytes) -> None:
        """Change what is sent."""
        self.data = data

    def stop(self) -> None:
        """Send it no more."""
        self.network.tasks.remove(self)
