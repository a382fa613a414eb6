"""Recordings as a page: every channel and the estimate over its sensor, in a browser."""

import json
import re

import numpy as np
import pytest

from estimation.recording import Flag, Mark, Recording
from rig.log.convert import write_recording
from tests.rig.browser import Opened, chromium
from tests.rig.test_reports import Page

pytestmark = pytest.mark.integration

GRIP = "distal_torque_n_m"


def recorded(name, bias=0.0):
    time_s = np.arange(2000) / 1000
    torque = 0.05 * np.sin(6 * time_s)
    columns = {
        "jaw_angle_rad": np.cos(3 * time_s),
        GRIP: torque,
        f"estimated_{GRIP}": torque + bias,
    }
    flags = np.zeros(2000, np.uint8)
    flags[500:520] = Flag.STALE
    return Recording(name, time_s, columns, flags, {"load_a": 0.2}, marks=(Mark(1.0, "bang"),))


@pytest.fixture
def folder(tmp_path):
    for name in ("000-a", "001-b"):
        write_recording(tmp_path / f"{name}.mcap", recorded(name, bias=0.01))
    return tmp_path


@pytest.fixture
def written(folder, said):
    def write(*words):
        said("view --no-open", folder, "--out", folder / "page.html", *words)
        return folder / "page.html"

    return write


def test_each_run_has_all_channels_the_estimate_on_its_sensor_and_the_residual(written):
    text = written().read_text()
    found = Page(text)
    assert (found.open, found.references) == ([], ["#evidence"])
    (chart,) = json.loads(re.search(r'id="charts">(.*?)</script>', text, re.DOTALL)[1])
    lines = {line["name"]: line for line in chart["choices"]["001-b"]}
    axis = {name: line.get("yaxis", "y") for name, line in lines.items()}
    assert axis["distal torque"] == axis["estimated distal torque"] != axis["jaw angle"]
    residual = lines["distal torque, measured - estimated"]
    assert residual["y"][0] == pytest.approx(-10.0)  # mN m
    assert max(lines["flags"]["y"]) == Flag.STALE
    assert "load_a = 0.2" in text
    assert "bang at 1 s" in text


def test_one_run_alone(written):
    text = written("--run 000-a").read_text()
    assert "000-a" in text
    assert "001-b" not in text


def test_the_page_is_named_and_opened_unless_unwanted(folder, said, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    page = folder / "page.html"
    assert str(page) in said("view", folder, "--out", page).out
    assert opened == [page.as_uri()]
    said("view --run 002", folder, code=2)


def test_the_page_draws_and_changes_run_in_a_browser(written):
    with chromium() as browser:
        opened = Opened(browser, written())
        assert opened.messages == []
        assert [r for r in opened.requests if not r.startswith(("file:", "data:", "blob:"))] == []
        panels = opened.page.locator("#chart-time-recordings .ylines-above").count()
        assert panels == 4  # angle, torque, residual, flags
        opened.page.select_option("select", "001-b")
        assert opened.page.locator("#chart-time-recordings .scatterlayer .trace").count() == 5
        opened.close()


def test_a_run_that_cannot_be_read_may_be_skipped(folder, said):
    damaged = bytearray(write_recording(folder / "002-c.mcap", recorded("002-c")).read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    (folder / "002-c.mcap").write_bytes(damaged)
    words = ("view --no-open", folder, "-o", folder / "p.html")
    said(*words, code=5)
    assert "002-c" in said(*words, "--skip-bad").err
    assert "001-b" in (folder / "p.html").read_text()
