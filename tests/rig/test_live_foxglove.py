"""What the Foxglove server sends, read by a client of another maker's."""

import asyncio
import json
import socket
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from tornado.websocket import websocket_connect

from rig.errors import UsageError
from rig.live import foxglove as served
from rig.log.reader import read_log
from tests.rig.blocks import GRIP, block

pytestmark = pytest.mark.integration

pytest.importorskip("foxglove")


def sample_block(number):
    current = {"motor_current_a": np.full(50, np.nan)}
    columns = {GRIP: np.full(50, 0.05), **current}
    return block(50 * number, estimate=0.04, columns=columns)


async def first_sample(server):
    """Return the first sample that a client gets once it has subscribed to the samples."""
    messages, is_subscribed = [], False
    link = await websocket_connect(
        f"ws://127.0.0.1:{server.port}",
        on_message_callback=messages.append,
        subprotocols=["foxglove.sdk.v1"],
    )
    for k in range(2000):  # the server takes the subscription in its own time
        server.send(sample_block(k))
        await asyncio.sleep(0.01)
        for message in list(messages):
            if isinstance(message, bytes):
                link.close()
                while messages[-1] is not None:  # the connection is closed in its own time
                    await asyncio.sleep(0.01)
                return json.loads(message[13:])
            for channel in json.loads(message).get("channels", ()):
                if channel["topic"] == "/rig/sample" and not is_subscribed:
                    wanted = [{"id": 1, "channelId": channel["id"]}]
                    link.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                    is_subscribed = True
    raise AssertionError("no sample came")


def test_a_client_gets_samples_with_estimates_and_nothing_listens_afterwards():
    server = served.FoxgloveServer(0)
    sample = asyncio.run(first_sample(server))
    assert sample["distal_torque_n_m"] == 0.05
    assert sample["distal_torque_n_m_estimate"] == 0.04
    assert sample["motor_current_a"] is None
    server.close()
    for _ in range(100):  # it closes in its own time
        try:
            socket.create_connection(("127.0.0.1", server.port), timeout=5).close()
        except ConnectionRefusedError:
            return
        except ConnectionResetError:  # taken from the queue of a socket that is being closed
            pass
        time.sleep(0.05)
    raise AssertionError("it still listens")


def test_only_the_loopback_address_is_listened_on_and_a_taken_port_is_reported(monkeypatch):
    import foxglove

    asked = {}
    start = foxglove.start_server
    monkeypatch.setattr(foxglove, "start_server", lambda **k: asked.update(k) or start(**k))
    server = served.FoxgloveServer(0)
    assert asked["host"] == "127.0.0.1"
    with pytest.raises(UsageError, match="cannot be listened on"):
        served.FoxgloveServer(server.port)
    server.close()


def test_the_layout_shows_channels_that_are_sent():
    path = Path(served.__file__).with_name("foxglove.layout.json")
    layout = json.loads(path.read_text())
    paths = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", [])]
    assert "/rig/sample.distal_torque_n_m_estimate" in paths
    assert all(value.startswith(f"{served.SAMPLE}.") for value in paths)


def test_every_curve_of_the_plotjuggler_layout_is_a_field_of_a_recorded_log():
    """PlotJuggler calls a field of a ROS 2 message TOPIC/FIELD."""
    log = read_log(next((Path(__file__).parents[2] / "logs" / "example").glob("*.mcap")))
    fields = {f"{t}/{f}" for t, topic in log.topics.items() for f in topic.rows.dtype.names}
    file = Path(served.__file__).with_name("plotjuggler.layout.xml")
    layout = ElementTree.parse(file)  # noqa: S314  a file of this project
    curves = [curve.get("name") for curve in layout.iter("curve")]
    assert curves
    assert set(curves) <= fields
