"""The page of the live rig: in a real browser on the simulated rig, and its server alone."""

import json
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.cli.main import main
from rig.errors import UsageError
from rig.live.block import through
from rig.live.options import ShowOptions
from rig.live.web import HOST, WebView, open_page
from tests.rig.blocks import block
from tests.rig.browser import chromium

pytestmark = pytest.mark.integration

pytest.importorskip("tornado")

PATIENCE_S = 120
"""Longest wait for anything: the machine may be busy with other tests."""


@pytest.fixture
def live(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`rig live --web` on the simulated rig, and the address it wrote."""
    command = [sys.executable, "-m", "rig", "live", "--sim", "--plain", "--web", "--web-port", "0"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        lines = iter(process.stderr.readline, "")
        yield process, next(found[0] for line in lines if (found := re.search("http://.*", line)))
        process.kill()


class Viewer:
    """A page that has its first frame."""

    def __init__(self, browser, url):
        self.page = browser.new_context().new_page()
        self.page.set_default_timeout(PATIENCE_S * 1e3)
        self.messages: list[str] = []
        self.page.on("console", lambda m: self.messages.append(m.text))
        self.page.on("pageerror", lambda e: self.messages.append(str(e)))
        self.page.goto(url)
        self.ready()

    def ready(self):
        self.page.wait_for_function("/\\d/.test(document.getElementById('number').textContent)")

    def waits_for(self, words):
        self.page.get_by_text(words).first.wait_for()


def test_a_browser_sees_the_rig_records_and_stops_it(live, tmp_path):
    process, url = live
    with chromium() as browser:
        one, two = Viewer(browser, url), Viewer(browser, url)
        one.page.click("summary")
        one.page.check("input[name=motor_current_a]")
        one.page.wait_for_selector("[data-unit=A] .scatterlayer path.js-line")
        one.page.reload()
        one.ready()
        one.page.wait_for_selector("[data-unit=A] .scatterlayer path.js-line")
        one.page.click("[data-action=record]")
        two.waits_for("recording on")
        one.page.click("[data-action=mark]")
        two.waits_for("1 marks")
        two.page.click("#stop")
        two.waits_for("Stopped: disarmed, confirmed by the board.")
        one.waits_for("logger disarmed")
        one.page.click("[data-action=record]")
        one.waits_for("recording off")
        process.send_signal(signal.SIGINT)
        one.waits_for("The session has ended.")
        assert process.wait(PATIENCE_S) == 130
        assert [m for m in one.messages + two.messages if "WebSocket" not in m] == []
    (log,) = (tmp_path / "logs").glob("live-*.mcap")
    assert main(["log", "check", str(log)]) == 0


def opened(url: str, path: str = "") -> int:
    try:
        with urllib.request.urlopen(url + path) as answer:  # noqa: S310
            return answer.status
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def viewer_of(url: str) -> socket.socket:
    """A browser's connection as far as the server sees it; it need not read."""
    host, port, query = re.fullmatch(r"http://(.*):(\d+)/(.*)", url).groups()
    link = socket.socket()
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    link.settimeout(PATIENCE_S)
    link.connect((host, int(port)))
    link.sendall(
        f"GET /stream{query} HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    return link


def test_only_the_whole_address_opens_the_page_and_the_stream():
    server = open_page(HOST, 0)
    server.start()
    bare = server.url.partition("?")[0]
    assert opened(server.url) == 200
    assert opened(bare) == opened(bare, "?token=guess") == 403
    with viewer_of(bare) as link:
        assert b"403" in link.recv(100)
    with viewer_of(server.url) as link:
        assert b"101" in link.recv(100)
    assert server.url.startswith("http://127.0.0.1:")
    server.close()
    with pytest.raises(urllib.error.URLError):
        opened(server.url)


def test_a_browser_that_reads_nothing_is_dropped_and_delays_nobody():
    server = open_page(HOST, 0)
    sinks = [WebView(server, ShowOptions("test")).show]
    stream = through((block(50 * k, estimate=0.1) for k in range(200_000)), sinks=sinks)
    next(stream)
    with viewer_of(server.url) as stalled, viewer_of(server.url) as reading:
        assert b"101" in stalled.recv(100)
        with reading.makefile("rb") as lines:
            newest = 0.0
            for given in stream:
                while newest < given.time_s[0] - 1.0:
                    newest = max([newest, *times(message_of(lines))])
                if server.viewers == 1:
                    break
            assert server.viewers == 1, "the stalled one was not dropped"
    server.close()


def message_of(lines) -> bytes:
    while True:
        first = lines.read(1)
        if first == b"\x81":
            size = lines.read(1)[0]
            size = int.from_bytes(lines.read({126: 2, 127: 8}[size])) if size > 125 else size
            return lines.read(size)


def times(message: bytes) -> list[float]:
    return [time_s for trace in json.loads(message)["traces"] for time_s in trace["time_s"]]


def test_a_taken_port_and_a_host_without_the_page_are_refused(capsys):
    with socket.create_server((HOST, 0)) as taken, pytest.raises(UsageError, match="listened on"):
        open_page(HOST, taken.getsockname()[1])
    assert main(["live", "--sim", "--host", "192.0.2.1"]) == 2
    assert "--web" in capsys.readouterr().err
