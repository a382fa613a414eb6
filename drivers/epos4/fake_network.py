"""The network of the fake: `canopen`'s server in virtual time, its frames kept to be fetched."""

import canopen

from drivers.transport.can_bus import CanFrame


class FrameNetwork(canopen.Network):
    """Keeps the frames to be sent; what is periodic comes by ticks."""

    def __init__(self) -> None:
        super().__init__()
        self.out: list[CanFrame] = []
        self._tasks: list[Periodic] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Keep a frame."""
        self.out.append(CanFrame(can_id, bytes(data)))

    def send_periodic(  # type: ignore[override]
        self, can_id: int, data: bytes, period: float, remote: bool = False
    ) -> "Periodic":
        """Send a frame every `period` seconds from now on."""
        task = Periodic(self, can_id, data, round(period * 1000))
        self._tasks.append(task)
        return task

    def drop(self, task: "Periodic") -> None:
        """End a periodic frame."""
        self._tasks.remove(task)

    def advance(self) -> None:
        """Let 1 ms pass."""
        for task in self._tasks:
            task.advance()


class Periodic:
    """A frame that is sent again and again."""

    def __init__(self, network: FrameNetwork, can_id: int, data: bytes, period_ms: int) -> None:
        self._network = network
        self._can_id = can_id
        self._data = data
        self._period_ms = period_ms
        self._elapsed_ms = 0

    def advance(self) -> None:
        """Let 1 ms pass."""
        self._elapsed_ms += 1
        if self._elapsed_ms >= self._period_ms:
            self._elapsed_ms = 0
            self._network.send_message(self._can_id, self._data)

    def update(self, data: bytes) -> None:
        """Change what is sent."""
        self._data = data

    def stop(self) -> None:
        """Send it no more."""
        self._network.drop(self)
