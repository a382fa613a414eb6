"""What a person reads on the display, as text, wide and narrow."""

import io

import numpy as np
import pytest
from rich.console import Console

from estimation.recording import Flag
from rig.live.block import DeviceStatus, LimitStatus
from rig.live.options import ShowOptions
from rig.live.state import LiveState
from rig.live.text import plain_line
from rig.live.view import View
from tests.rig.blocks import GRIP, block

OPTIONS = ShowOptions("rig live")
DEVICES = (DeviceStatus("teensy", "armed", "SIM-0001"), DeviceStatus("load", "stale", "no reply"))
LIMITS = (LimitStatus("motor current", 0.31, 0.6, "A"), LimitStatus("torque", -0.29, 0.3, "N m"))


def stream(seconds=12.0, channel=GRIP, **changes):
    n = int(seconds * 1000)
    parts = {
        "columns": {channel: np.full(n, 0.12)},
        "estimates": {channel: np.full(n, 0.1234)},
        "devices": DEVICES,
        "limits": LIMITS,
    }
    return block(0, n, **parts | changes)


def snapshot_of(samples, channels=(GRIP,)):
    state = LiveState(channels)
    state.feed(samples)
    return state.snapshot()


def render(snapshot, width=80, height=24, color=None):
    console = Console(
        file=io.StringIO(),
        width=width,
        height=height,
        color_system=color,
        force_terminal=bool(color),
    )
    console.print(View(snapshot, OPTIONS))
    return console.file.getvalue()


@pytest.mark.parametrize("width", [80, 40])
def test_shows_what_a_person_needs(width):
    text = render(snapshot_of(stream()), width)
    for wanted in (
        "123.4 mN m",
        "10.28 N at the jaw tip (lever 12 mm)",
        "sensor 120.0 mN m",
        "error rms 3.4 mN m in 5 s",
        "1000 Hz",
        "lost 0",
        "● teensy armed",
        "▲ load stale",
        "0.310 of 0.600 A, 52 %",
        "-290.0 of 300.0 mN m, 97 % near"[: width - 8],
        "Ctrl-C",
    ):
        assert wanted in text, f"{wanted!r} is not on a display of {width} columns"


@pytest.mark.parametrize(("width", "height"), [(200, 60), (80, 24), (64, 24), (40, 24), (24, 10)])
def test_no_line_is_wider_than_the_terminal_and_the_drawing_fits(width, height):
    lines = render(snapshot_of(stream()), width, height).splitlines()
    assert all(len(line) < width for line in lines)
    if height >= 24:
        assert len(lines) < height


@pytest.mark.parametrize("width", [80, 40])
def test_flagged_samples_show_the_reason_and_no_number(width):
    flags = np.zeros(12_000, np.uint8)
    flags[-500:] = Flag.SATURATED
    text = render(snapshot_of(stream(flags=flags)), width)
    assert "no value (saturated)" in text
    assert "flagged in 10 s: saturated 500" in text
    assert "no force at the jaw tip" in text
    assert "mN m (" not in text
    assert "123.4" not in text


def test_without_an_estimator_the_sensor_is_the_main_value():
    text = render(snapshot_of(stream(estimates={})))
    assert "Grip torque, sensor  120.0 mN m" in text
    assert "no estimator" in text
    assert "10.00 N at the jaw tip" in text
    assert "estimate" not in text.replace("no estimator", "")


def test_newtons_are_only_claimed_for_the_jaw():
    spindle = "proximal_torque_n_m"
    text = render(snapshot_of(stream(channel=spindle), (spindle,)))
    assert "Spindle torque" in text
    assert " N at " not in text


def test_limits_say_in_words_when_they_are_near_or_unknown():
    limits = (LimitStatus("reached", 0.6, 0.6, "A"), LimitStatus("unknown", float("nan"), 0.6, "A"))
    text = render(snapshot_of(stream(limits=limits)))
    assert "AT LIMIT" in text
    assert "no value, limit 0.600 A" in text


def test_colour_only_repeats_the_text():
    coloured = Console(file=io.StringIO(), width=80, height=24, record=True, force_terminal=True)
    coloured.print(View(snapshot_of(stream()), OPTIONS))
    assert coloured.export_text(styles=False) == render(snapshot_of(stream()))


def test_before_the_first_sample_the_display_reports_it():
    text = render(LiveState((GRIP,)).snapshot())
    assert "no samples yet" in text
    assert "sensor  no value (no samples arriving)" in text


def test_plain_line_holds_the_same_facts():
    line = plain_line(snapshot_of(stream()), OPTIONS)
    assert "\n" not in line
    for wanted in (
        "123.4 mN m",
        "10.28 N at 12 mm",
        "1000 Hz",
        "lost 0",
        "teensy armed",
        "97 % near",
    ):
        assert wanted in line
    assert "52 %" not in line  # a limit is named from 80 % of it on
