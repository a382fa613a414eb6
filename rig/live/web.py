"""The live stream as frames of a page in a browser."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation.channels import UnknownUnitError, unit_of
from estimation.recording import FloatArray
from rig.errors import MissingExtraError
from rig.live import text as words
from rig.live.block import LimitStatus, SampleBlock, joined
from rig.live.options import ShowOptions
from rig.live.state import LiveState, Snapshot

if TYPE_CHECKING:
    from rig.live.web_server import PageServer

HOST = "127.0.0.1"
FRAME_S = 0.08
"""Device time of a frame at least, s: less than two blocks of 50 ms."""
PIECES = 2
"""Pieces of a frame ; each trace has the least and the greatest value of each."""


def open_page(host: str, port: int) -> "PageServer":
    """Return the server of the page, bound to its address and not answering yet.

    Raises:
        UsageError: The extra is not installed, or the address cannot be listened on.
    """
    try:
        from rig.live.web_server import PageServer
    except ImportError as error:
        raise MissingExtraError(
            "The page of the live rig needs Tornado, which is not installed.",
            "The display in the terminal does not need it.",
            "web",
        ) from error
    return PageServer(host, port)


class WebView:
    """Sends a stream to the page: ten frames a second of device time.

    The page answers from the first block on, so that its stop button never does nothing.
    """

    def __init__(self, page: "PageServer", options: ShowOptions) -> None:
        self._page, self._options = page, options
        self._state = LiveState(options.channels)
        self._held: list[SampleBlock] = []

    def show(self, block: SampleBlock) -> None:
        """Take a block, and send a frame whenever there is enough for one."""
        self._page.start()
        self._state.feed(block)
        if len(block):
            self._held.append(block)
        if _span_s(self._held) >= FRAME_S:
            shown = frame(self._state.snapshot(), self._options)
            self._page.send(shown | {"traces": traces(self._held)})
            self._held = []


def frame(snapshot: Snapshot, options: ShowOptions) -> dict[str, Any]:
    """Return the content of the page, in the words of the terminal's display."""
    main = snapshot.readings[0]
    size = words.size_of(main)
    return {
        "title": options.title,
        "name": f"{words.name_of(main.channel)}, {main.source}",
        "number": words.digits(main.main, main.unit, size),
        "missing": main.main.missing,
        "unit": words.in_shown_unit(main.unit, size)[1],
        "interval": words.interval(main, options),
        "beside": [note for note in words.notes(main, options) if note],
        "main": main.channel,
        "time": "" if snapshot.time_s is None else f"{snapshot.time_s:.1f} s",
        "rate": words.rate(snapshot),
        "lost": words.lost(snapshot.lost, snapshot.samples),
        "flagged": words.flagged(snapshot.flagged),
        "devices": [
            asdict(device) | {"mark": words.STATES.get(device.state, ("◆", "warning"))}
            for device in snapshot.devices
        ],
        "limits": [_limit(limit) for limit in snapshot.limits],
    }


def traces(blocks: list[SampleBlock]) -> dict[str, Any]:
    """Return the range of every channel and estimate of valid samples, in pieces.

    `time_s` has two entries a piece; `values` maps the name of a trace to as many, in its shown
    unit, None where no sample is valid; `units` maps it to that unit.
    """
    valid = np.concatenate([block.flags for block in blocks]) == 0
    time_s = np.concatenate([block.time_s for block in blocks])
    columns = joined([block.columns for block in blocks])
    estimates = joined([block.estimates for block in blocks])
    columns |= {f"{name}, estimate": values for name, values in estimates.items()}
    units = {name: _unit(name.removesuffix(", estimate")) for name in columns}
    pieces = np.array_split(time_s, PIECES)
    return {
        "time_s": [round(float(piece[0]), 3) for piece in pieces for _ in range(2)],
        "values": {
            name: _ranges(np.where(valid, column, np.nan), units[name][0])
            for name, column in columns.items()
        },
        "units": {name: unit for name, (_, unit) in units.items()},
    }


def _span_s(blocks: list[SampleBlock]) -> float:
    if sum(len(block) for block in blocks) < PIECES:
        return 0.0
    span_s = float(blocks[-1].time_s[-1] - blocks[0].time_s[0])
    return span_s if span_s >= 0 else FRAME_S  # the device's clock restarted


def _ranges(values: FloatArray, factor: float) -> list[float | None]:
    found: list[float | None] = []
    for piece in np.array_split(values * factor, PIECES):
        known = piece[np.isfinite(piece)]
        ends = (float(known.min()), float(known.max())) if known.size else (None, None)
        found += [end if end is None else float(f"{end:.5g}") for end in ends]
    return found


def _unit(channel: str) -> tuple[float, str]:
    try:
        factor, unit, _ = words.in_shown_unit(unit_of(channel))
    except UnknownUnitError:
        return 1.0, ""
    return factor, unit


def _limit(limit: LimitStatus) -> dict[str, Any]:
    text, style = words.limit_words(limit)
    share = min(words.limit_share(limit) or 0.0, 1.0)
    return {"name": limit.name, "text": text, "share": share, "style": style}
