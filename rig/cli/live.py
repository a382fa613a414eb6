"""`rig live`: grip torque, or the forces of a grasper, in the terminal."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from rig.cli.options import (
    ConfigOption,
    LiveModel,
    PlainFlag,
    SimFlag,
    chosen_rig,
    require_number,
)
from rig.errors import UsageError
from rig.output.console import JsonFlag, remarks, results

if TYPE_CHECKING:
    from rig.live.web_server import PageServer


SHORTEST_S = 0.001
"""Shortest duration: one sample of the logger board."""


def live(
    config: ConfigOption = None,
    sim: SimFlag = False,
    model: LiveModel = None,
    protocol: Annotated[
        str | None,
        Option("--protocol", "-p", help="Play this protocol; without it the rig does not move."),
    ] = None,
    duration: Annotated[float | None, Option(help="Quit after this device time, s.")] = None,
    pace: Annotated[
        float, Option(help="Simulated seconds per second; 0 is as fast as possible.")
    ] = 1.0,
    lever_mm: Annotated[
        float | None, Option(help="Lever arm from the jaw's axis to its tip, mm.")
    ] = None,
    plain: PlainFlag = False,
    out: Annotated[
        Path, Option("--out", "-o", help="Folder of recordings started by a key.")
    ] = Path("logs"),
    foxglove: Annotated[
        bool, Option("--foxglove", help="Also serve the data to Foxglove, on this computer only.")
    ] = False,
    foxglove_port: Annotated[
        int, Option(min=1, max=65535, help="Port of the Foxglove server.")
    ] = 8765,
    web: Annotated[
        bool, Option("--web", help="Also serve a page for a browser on this computer.")
    ] = False,
    host: Annotated[
        str | None, Option(help="With --web: this computer's address in a network, for a tablet.")
    ] = None,
    web_port: Annotated[
        int, Option(min=0, max=65535, help="Port of the page; 0 takes a free one.")
    ] = 8766,
    json_: JsonFlag = False,
) -> int:
    """Show grip torque, or a grasper's forces, estimate against sensor, as the rig measures it.

    A simulated rig plays a default protocol; a real rig is never moved without
    --protocol. Ctrl-C quits, with the rig in its safe state and exit code 130. With --json, one
    object per line. In a terminal, keys: t tares a rig at rest, r starts and stops a recording, m
    marks it, s stops the rig, c shows the next channel, ? explains the keys, q quits.
    """
    from contextlib import ExitStack, closing

    from rig.bench.logger import open_logger
    from rig.configuration.check import refuse_problems
    from rig.live.block import Sink, through
    from rig.live.estimator import estimators_of, half_widths, shown_channels
    from rig.live.keys import OF_SESSION, display_keys, no_keys
    from rig.live.options import ShowOptions
    from rig.live.session_blocks import session_blocks
    from rig.live.show import show
    from rig.live.status import model_steps
    from rig.live.suits import require_channels
    from rig.machines.choose import machine_of
    from rig.protocols.protocol import load_protocol

    if host and not web:
        raise UsageError("--host is an address of the page.", fix="Add --web.")
    require_number("--duration", duration, SHORTEST_S)
    require_number("--pace", pace, 0.0)
    settings = chosen_rig(config, sim)
    refuse_problems(settings)
    remarks().print(f"{settings.name}: starting ...")
    machine = machine_of(settings)
    if protocol is None and settings.is_simulated:
        protocol = machine.first_look(settings)
    plans = load_protocol(protocol).any_plans() if protocol else []
    machine.require_within_limits(settings, plans)
    model_path = model or settings.model_path
    estimators = estimators_of(model_path, machine.profile.rate_hz) if model_path else []
    if model_path:
        require_channels(estimators, settings, model_path)
    options = ShowOptions(
        title=f"rig live: {settings.name}",
        channels=shown_channels(estimators, machine.shown),
        devices=tuple(settings.devices),
        lever_m=lever_mm / 1e3 if lever_mm else settings.lever_arm_m,
        plain=plain,
        json=json_,
        half_widths=lambda: half_widths(estimators),
    )
    sinks: list[Sink] = []
    with display_keys() as keys, ExitStack() as stack:
        shown = options.with_keys(keys, OF_SESSION)
        pressed = [keys or no_keys]
        if foxglove:
            from rig.live.foxglove import LAYOUT, FoxgloveServer

            sinks.append(stack.enter_context(closing(FoxgloveServer(foxglove_port))).send)
            remarks().print(f"Foxglove: ws://localhost:{foxglove_port}, layout {LAYOUT}")
        if web:
            from rig.live.web import WebView

            page = stack.enter_context(closing(_page(host, web_port)))
            sinks.append(WebView(page, shown).show)
            pressed.append(page.pressed)
        blocks = session_blocks(
            settings,
            lambda: open_logger(settings, pace=pace or None),
            plans,
            estimators,
            lambda: "".join(read() for read in pressed),
            out,
        )
        blocks = through(blocks, model_steps(estimators), sinks, duration)
        summary = show(blocks, shown, results(json_))
    return summary.exit_code


def _page(host: str | None, port: int) -> "PageServer":
    """Return the server of the page; its address is written for the user."""
    from rig.live.web import HOST, open_page

    page = open_page(host or HOST, port)
    remarks().print(f"Page: {page.url}")
    if host:
        remarks().print(
            "Whoever has this address can stop the rig, tare and record. It is not encrypted."
        )
    return page
