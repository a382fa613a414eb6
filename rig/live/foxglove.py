"""The live stream on a WebSocket of this computer, for the Foxglove application.

Needs the extra `viz`. The server listens on the loopback address only, and only while asked for.
"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import MissingExtraError, UsageError
from rig.live.block import SampleBlock
from rig.output.console import plain

HOST = "127.0.0.1"
LAYOUT = Path(__file__).with_name("foxglove.layout.json")
RATE_HZ = 100.0
"""Samples a second that are sent: a display needs no more."""

SAMPLE, STATUS = "/rig/sample", "/rig/status"


class FoxgloveServer:
    """A WebSocket server that sends samples and states as JSON with a schema.

    Port 0 takes any that is free.
    """

    def __init__(self, port: int) -> None:
        try:
            import foxglove
        except ImportError as error:
            raise MissingExtraError(
                "The stream to Foxglove needs its library, which is not installed.",
                "The display in the terminal does not need it.",
                "viz",
            ) from error
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name="rig", host=HOST, port=port, context=self._context
            )
        except (RuntimeError, OSError) as error:
            raise UsageError(
                f"Port {port} of this computer cannot be listened on.",
                str(error),
                "Close the other program, or name another with --foxglove-port.",
            ) from error
        self.port = self._server.port
        self._channel = foxglove.Channel
        self._channels: dict[str, Any] = {}
        self._start_ns = time.time_ns()
        self._last_s = -np.inf

    def send(self, block: SampleBlock) -> None:
        """Send every tenth sample of a block at 1 kHz, and the states of its devices."""
        for k in range(len(block)):
            now_s = float(block.time_s[k])
            if self._last_s <= now_s < self._last_s + 1.0 / RATE_HZ - 1e-9:
                continue
            self._last_s = now_s
            sample = {"time_s": now_s} | {name: x[k] for name, x in block.columns.items()}
            sample |= {f"{name}_estimate": x[k] for name, x in block.estimates.items()}
            self._log(SAMPLE, sample, now_s)
        if len(block):
            states = {device.name: f"{device.state} {device.detail}" for device in block.devices}
            self._log(STATUS, {"lost": block.lost, "devices": states}, float(block.time_s[-1]))

    def close(self) -> None:
        """Stop listening."""
        self._server.stop()

    def _log(self, topic: str, message: Mapping[str, Any], time_s: float) -> None:
        if topic not in self._channels:
            schema = {
                "type": "object",
                "title": topic.strip("/").replace("/", "."),
                "properties": {
                    name: {"type": "object" if isinstance(value, dict) else ["number", "null"]}
                    for name, value in message.items()
                },
            }
            self._channels[topic] = self._channel(topic, schema=schema, context=self._context)
        self._channels[topic].log(plain(message), log_time=self._start_ns + round(time_s * 1e9))
