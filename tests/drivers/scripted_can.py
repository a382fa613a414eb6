"""A bus that holds a conversation to its script: what is sent, and what is answered."""

from collections import deque
from types import TracebackType
from typing import Self

from drivers.errors import LinkLostError
from drivers.transport.can_bus import CanCounters, CanFrame

Exchange = tuple[CanFrame, list[CanFrame]]
"""A frame the driver must send, and the frames that answer it."""


class ScriptedCanBus:
    """Fails on a frame that is not the script's next; on leaving, on frames unsent or unread."""

    url = "script://"

    def __init__(self, script: list[Exchange]) -> None:
        self.counters = CanCounters()
        self.now_s = 0.0
        self._script = deque(script)
        self._unread: deque[CanFrame] = deque()
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            assert not self._script, f"never sent: {list(self._script)}"
            assert not self._unread, f"never read: {list(self._unread)}"

    def send(self, frame: CanFrame) -> None:
        assert self._script, f"sent after the end of the script: {frame}"
        expected, answer = self._script.popleft()
        assert frame == expected
        self._unread += answer

    def read(self, timeout_s: float) -> CanFrame | None:
        if self._closed:
            raise LinkLostError("closed")
        if self._unread:
            return self._unread.popleft()
        self.now_s += timeout_s
        return None

    def close(self) -> None:
        self._closed = True
