"""The display from the first block to the summary, in virtual time."""

import io
import itertools
import json
import os
import re
import signal
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from rig.bench.interrupts import leaving_safely
from rig.errors import SafetyTripError
from rig.live.block import DeviceStatus
from rig.live.keys import DisplayKeys
from rig.live.options import ShowOptions
from rig.live.show import show
from tests.rig.blocks import GRIP, block

pytestmark = pytest.mark.integration


def blocks(count, ends_with=None, on_close=lambda: None):
    """Yield 50 ms blocks at 1 kHz, then raise if asked."""
    try:
        for index in range(count):
            yield block(50 * index, estimate=0.102, lost=3)
        if ends_with is not None:
            raise ends_with
    finally:
        on_close()


def people(terminal=False, **changes):
    usual = {"file": io.StringIO(), "width": 80, "height": 24, "force_terminal": terminal}
    return Console(**usual | {"_environ": {"TERM": "xterm-256color"}} | changes)


def steady_clock(step_s=0.05):
    """Return a clock that advances whenever it is read."""
    return itertools.count(step_s, step_s).__next__


def test_json_writes_ten_frames_a_second_and_a_summary(capsys):
    console = people()
    summary = show(blocks(40), ShowOptions("run", json=True), console)
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [f["kind"] for f in frames] == ["frame"] * 20 + ["summary"]
    grip = frames[-2]["channels"][GRIP]
    assert grip["unit"] == "N m"
    assert grip["estimate"] - grip["sensor"] == pytest.approx(0.002)
    assert grip["tip_force_n"] == pytest.approx(grip["estimate"] / 0.012)
    assert frames[-2]["devices"] == [{"name": "teensy", "state": "ok", "detail": ""}]
    assert frames[-1]["summary"]["samples"] == summary.samples == 2000
    assert console.file.getvalue() == "", "people read nothing when a machine does"


def test_plain_writes_two_lines_a_second_and_a_summary(capsys):
    console = people()
    show(blocks(40), ShowOptions("run"), console)
    lines = console.file.getvalue().splitlines()
    assert len([line for line in lines if "1000 Hz" in line and "mN m" in line]) == 4
    assert "Finished after 2.0 s: 2000 samples, LOST 3" in lines[-2]
    assert "rms error 2.0 mN m over 2000 samples" in lines[-1]
    assert capsys.readouterr().out == ""


def test_plain_is_chosen_by_option_and_by_the_terminal():
    for console, is_plain in (
        (people(terminal=True), True),
        (people(terminal=False), False),
        (people(terminal=True, _environ={"TERM": "dumb"}), False),
    ):
        show(blocks(20), ShowOptions("run", plain=is_plain), console)
        assert "⠀" not in console.file.getvalue()
        assert " | " in console.file.getvalue()


def test_a_terminal_gets_the_drawing_and_its_cursor_back():
    console = people(terminal=True)
    show(blocks(40), ShowOptions("rig live"), console, steady_clock())
    drawn = console.file.getvalue()
    assert re.search("[⠁-⣿]", drawn)
    assert drawn.rindex("\x1b[?25h") > drawn.rindex("\x1b[?25l"), "the cursor is shown again"
    assert "Finished after 2.0 s" in drawn


@pytest.mark.parametrize("terminal", [True, False])
def test_ctrl_c_quits_with_a_summary_and_closes_the_stream(terminal):
    closed = []
    stream = blocks(40, KeyboardInterrupt(), on_close=lambda: closed.append(True))
    console = people(terminal=terminal)
    summary = show(stream, ShowOptions("run"), console, steady_clock())
    assert summary.ended == "interrupted"
    assert summary.samples == 2000
    assert summary.lost == 3
    assert summary.error_rms == pytest.approx(0.002)
    assert closed == [True]
    assert "Stopped after 2.0 s" in console.file.getvalue()


def test_a_fault_of_the_stream_is_passed_on_with_the_terminal_given_back():
    console = people(terminal=True)
    with pytest.raises(SafetyTripError, match="over current"):
        show(blocks(10, SafetyTripError("over current")), ShowOptions("run"), console)
    drawn = console.file.getvalue()
    assert drawn.rindex("\x1b[?25h") > drawn.rindex("\x1b[?25l")


def test_silence_is_shown_in_the_clock_of_the_person(capsys):
    def silent():
        yield from blocks(1)
        for _ in range(8):
            yield block(0, 0, columns={}, devices=(DeviceStatus("teensy", "stale"),))

    show(silent(), ShowOptions("run", json=True), people(), steady_clock(0.04))
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()][:-1]
    assert len(frames) == 1 + 4
    assert frames[-1]["channels"][GRIP]["sensor"] is None
    assert frames[-1]["channels"][GRIP]["sensor_missing"] == "no samples arriving"
    assert frames[-1]["devices"][0]["state"] == "stale"


def drawn_after(presses):
    """Return the last frame of a display on which keys were pressed, one a block."""
    script = iter(presses)
    keys = DisplayKeys(lambda: next(script, ""))

    def with_current():
        for one in blocks(len(presses) + 4):
            keys()
            columns = {**one.columns, "motor_current_a": np.full(50, 0.25)}
            yield replace(one, columns=columns)

    console = people(terminal=True)
    options = ShowOptions("run", help="c: shows the next channel", keys=keys)
    summary = show(with_current(), options, console, steady_clock())
    assert summary.channel == GRIP
    return console.file.getvalue().split("\x1b[?2026h")[-1]


def test_keys_choose_the_channel_in_large_digits_and_show_the_help():
    chosen = drawn_after(["c"])
    assert "Measured current of the drive motor, sensor" in chosen
    assert "0.250 A" in chosen
    assert "Grip torque, estimate" in chosen  # in a line of its own
    assert "Measured current" not in drawn_after(["cc"])
    assert "shows the next channel" in drawn_after(["?"])
    assert "shows the next channel" not in drawn_after(["?", "?"])


def test_keys_of_the_display_do_not_reach_the_rig():
    keys = DisplayKeys(iter(["tc?m"]).__next__)
    assert keys() == "tm"
    assert (keys.chosen, keys.helps) == (1, True)


def test_a_request_that_was_lost_in_a_callback_ends_the_display():
    def swallowed():
        with leaving_safely():
            yield block(0, 1)
            with suppress(KeyboardInterrupt):  # lost once, as in a compiled callback
                os.kill(os.getpid(), signal.SIGTERM)
            yield from (block(10 * k, 1) for k in range(1, 1000))

    assert show(swallowed(), ShowOptions("x"), people()).ended == "interrupted"
