"""What the Foxglove server sends, read byte by byte by a client of our own."""

import base64
import json
import os
import select
import socket
import struct
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rig.errors import UsageError
from rig.live import foxglove as served
from rig.live.block import DeviceStatus, SampleBlock
from rig.log.reader import read_log

pytestmark = pytest.mark.integration

pytest.importorskip("foxglove")


def block(start_s, n=50):
    time_s = start_s + np.arange(n) * 1e-3
    columns = {"distal_torque_n_m": np.full(n, 0.05), "motor_current_a": np.full(n, np.nan)}
    estimates = {"distal_torque_n_m": np.full(n, 0.04)}
    devices = (DeviceStatus("logger", "armed"),)
    return SampleBlock(time_s, columns, np.zeros(n, np.uint8), estimates, 3, devices)


class Client:
    """As much of RFC 6455 as the test needs."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        self.stream = self.socket.makefile("rb")
        assert b"101" in self.stream.readline()
        while self.stream.readline().strip():
            pass

    def message(self):
        """The next text message as JSON, or a binary one as bytes."""
        first, second = self.stream.read(2)
        size = second & 0x7F
        if size > 125:
            size = struct.unpack(">H" if size == 126 else ">Q", self.stream.read(2 if size == 126 else 8))[0]  # fmt: skip  # noqa: E501
        data = self.stream.read(size)
        return json.loads(data) if first & 0x0F == 1 else data

    def say(self, message):
        data, mask = json.dumps(message).encode(), b"\0\0\0\0"
        assert len(data) < 126
        self.socket.sendall(bytes([0x81, 0x80 | len(data)]) + mask + data)

    def until(self, wanted):
        for _ in range(50):
            found = self.message()
            if wanted(found):
                return found
        raise AssertionError("it did not come")

    def close(self):
        self.stream.close()
        self.socket.close()


def stops_listening(port):
    """Whether the port refuses within some tries; the server closes in its own time."""
    for _ in range(100):
        try:
            socket.create_connection(("127.0.0.1", port), timeout=5).close()
        except ConnectionRefusedError:
            return True
        select.select([], [], [], 0.05)
    return False


def is_op(name):
    return lambda message: isinstance(message, dict) and message.get("op") == name


def test_a_client_gets_samples_with_estimates_and_nothing_listens_afterwards():
    server = served.FoxgloveServer(0)
    client = Client(server.port)
    server.send(block(0.0))
    channels = client.until(is_op("advertise"))["channels"]
    (channel,) = [c for c in channels if c["topic"] == "/rig/sample"]
    client.say({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel["id"]}]})
    data = b""
    for k in range(1, 200):  # the server takes the subscription in its own time
        server.send(block(0.05 * k))
        if select.select([client.socket], [], [], 0.05)[0]:
            message = client.message()
            if isinstance(message, bytes):
                data = message
                break
    sample = json.loads(data[13:])
    assert sample["distal_torque_n_m"] == 0.05
    assert sample["distal_torque_n_m_estimate"] == 0.04
    assert sample["motor_current_a"] is None
    client.close()
    server.close()
    assert stops_listening(server.port)


def test_only_the_loopback_address_is_listened_on(monkeypatch):
    import foxglove

    asked = {}
    start = foxglove.start_server
    monkeypatch.setattr(foxglove, "start_server", lambda **k: asked.update(k) or start(**k))
    served.FoxgloveServer(0).close()
    assert asked["host"] == "127.0.0.1"


def test_the_stream_passes_through_and_a_taken_port_is_said():
    blocks = [block(0.0), block(0.05)]
    assert list(served.published(iter(blocks), 0)) == blocks
    server = served.FoxgloveServer(0)
    with pytest.raises(UsageError, match="cannot be listened on"):
        served.FoxgloveServer(server.port)
    server.close()


def test_the_layout_shows_channels_that_are_sent():
    path = Path(served.__file__).with_name("foxglove.layout.json")
    layout = json.loads(path.read_text())
    paths = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", [])]
    assert "/rig/sample.distal_torque_n_m_estimate" in paths
    assert all(value.startswith(f"{served.SAMPLE}.") for value in paths)


def test_the_layouts_channels_are_those_of_a_recorded_log():
    """A recording opens in the same layout; only estimates are missing from it."""
    example = next((Path(__file__).parents[2] / "logs" / "example").glob("*.mcap"))
    recorded = set(read_log(example).topics[served.SAMPLE].columns)
    text = Path(served.__file__).with_name("foxglove.layout.json").read_text()
    panels = json.loads(text)["configById"].values()
    shown = {p["value"].rpartition(".")[2] for panel in panels for p in panel.get("paths", [])}
    of_reference = {"distal_torque_n_m", "proximal_torque_n_m", "motor_current_a"} & shown
    assert of_reference
    assert of_reference <= recorded


def test_every_curve_of_the_plotjuggler_layout_is_a_field_of_a_recorded_log():
    """PlotJuggler calls a field of a ROS 2 message TOPIC/FIELD."""
    log = read_log(next((Path(__file__).parents[2] / "logs" / "example").glob("*.mcap")))
    fields = {f"{t}/{f}" for t, topic in log.topics.items() for f in topic.rows.dtype.names}
    file = Path(served.__file__).with_name("plotjuggler.layout.xml")
    layout = ElementTree.parse(file)  # noqa: S314  a file of this project
    curves = [curve.get("name") for curve in layout.iter("curve")]
    assert curves
    assert set(curves) <= fields
