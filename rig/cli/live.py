"""`rig live | replay`: grip torque, or the forces of a grasper, measured or recorded."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from rig.cli import options
from rig.errors import UsageError
from rig.output.console import JsonLinesFlag, present, remarks, results

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from estimation.recording import Recording
    from rig.live.estimator import LiveEstimator
    from rig.live.web_server import PageServer


SHORTEST_S = 0.001
"""Shortest duration: one sample of the logger board."""

GRIP, EFFORTS = "distal_torque_n_m", ("_n_m", "_n", "_a")
"""The main channel of the reference rig, and the units of what is shown where there is none."""


def live(
    config: options.ConfigOption = None,
    sim: options.SimFlag = False,
    model: options.LiveModel = None,
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
    plain: options.PlainFlag = False,
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
    json_: JsonLinesFlag = False,
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
    from rig.live.estimator import (
        channels_of,
        estimators_of,
        half_widths,
        require_channels,
        shown_channels,
        without_interval,
    )
    from rig.live.keys import OF_SESSION, display_keys, no_keys
    from rig.live.options import ShowOptions
    from rig.live.session_blocks import session_blocks
    from rig.live.show import show
    from rig.live.status import model_steps
    from rig.machines.choose import machine_of
    from rig.protocols.protocol import load_protocol

    if host and not web:
        raise UsageError("--host is an address of the page.", fix="Add --web.")
    options.require_number("--duration", duration, SHORTEST_S)
    options.require_number("--pace", pace, 0.0)
    settings = options.chosen_rig(config, sim)
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
        require_channels(channels_of(estimators), settings, model_path)
        for line in without_interval((e.model for e in estimators), model_path):
            remarks().print(line)
    wanted = ShowOptions(
        title=f"rig live: {settings.name}",
        channels=shown_channels(estimators, machine.shown),
        devices=tuple(settings.devices),
        lever_m=settings.lever_arm_m if lever_mm is None else lever_mm / 1e3,
        plain=plain,
        json=json_,
        half_widths=lambda: half_widths(estimators),
    )
    sinks: list[Sink] = []
    with display_keys() as keys, ExitStack() as stack:
        shown = wanted.with_keys(keys, OF_SESSION)
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


def replay(
    log: Annotated[Path, Argument(help="Recording: a file, folder or archive.")],
    run: Annotated[
        str | None, Option(help="Name of the run; by default the first valid one.")
    ] = None,
    model: options.ReplayModel = None,
    speed: Annotated[
        float, Option(help="Speed relative to real time; 0 is as fast as possible.")
    ] = 1.0,
    plain: options.PlainFlag = False,
    json_: JsonLinesFlag = False,
    lever_mm: Annotated[float, Option(help="Lever arm from the jaw's axis to its tip, mm.")] = 12.0,
    any_instrument: Annotated[
        bool, Option("--any-instrument", help="Allow a model of another instrument.")
    ] = False,
    machine: options.MachineOption = None,
    balance: options.EquationOption = None,
    format_: options.FormatOption = None,
    core: Annotated[
        bool, Option("--core", help="Run the firmware's core again on a simulated log; compare.")
    ] = False,
    config: Annotated[
        Path | None,
        Option("--config", "-c", help="With --core: configuration in place of the log's."),
    ] = None,
) -> int:
    """Play back a recording in the live display, with the estimate of any model.

    Draws on a terminal, writes a line every 0.5 s elsewhere. With --json, one object per line:
    a frame every 0.1 s, a summary last. Ctrl-C quits with exit code 130. In a terminal, keys:
    space pauses, + and - change the speed, f skips 5 s, c shows the next channel, ? explains the
    keys, q quits. With --core nothing is shown: exit code 1 when a sample differs in any bit.
    """
    if core:
        return _core(log, config, json_)
    from rig.live.block import through
    from rig.live.estimator import half_widths, shown_channels
    from rig.live.keys import display_keys, no_keys
    from rig.live.options import ShowOptions
    from rig.live.replay import OF_REPLAY, replay_blocks
    from rig.live.show import show
    from rig.live.status import model_steps
    from rig.machines.recordings import open_recordings

    options.require_number("--speed", speed, 0.0)
    recording = _choose(open_recordings(log, machine, format_), run, quiet=json_)
    estimators = _estimators(recording, model, balance, any_instrument, quiet=json_)
    wanted = ShowOptions(
        title=f"rig replay {recording.name}",
        channels=shown_channels(estimators, _usual(recording)),
        half_widths=lambda: half_widths(estimators),
        lever_m=lever_mm / 1e3,
        plain=plain,
        json=json_,
    )
    with display_keys() as keys:
        blocks = replay_blocks(recording, estimators, speed or None, keys or no_keys)
        blocks = through(blocks, model_steps(estimators))
        summary = show(blocks, wanted.with_keys(keys, OF_REPLAY), results(json_))
    return summary.exit_code


def _usual(recording: "Recording") -> tuple[str, ...]:
    """Return the quantities to watch: a grasper's forces, the grip torque, or the first effort."""
    from rig.live.joint_forces import JOINTS, of_joints

    if of_joints(recording.columns):
        return JOINTS
    efforts = [n for n in recording.columns if n.endswith(EFFORTS)]
    return (efforts[0],) if efforts and GRIP not in efforts else (GRIP,)


def _core(log: Path, config: Path | None, json: bool) -> int:
    from rig.configuration.config import load_config
    from rig.recording.core_replay import replay_core

    found = replay_core(log, load_config(config) if config else None)
    if not found.is_same_core:
        remarks().print(f"The log is of core {found.core}; the one in use is another build.")
    said = [
        f"{found.same} of {found.samples} samples are the same, bit for bit,"
        f" from {found.commands} bytes of commands."
    ]
    said += [f"The board tripped: {', '.join(found.trips)}."] if found.trips else []
    if found.first_difference:
        said.append(f"First difference: {found.first_difference}.")
    present(json, {"passed": found.passed, **asdict(found)}, *said)
    return 0 if found.passed else 1


def _choose(campaign: "Campaign", name: str | None, quiet: bool) -> "Recording":
    """Return the named run, or the first valid one, and print which it is and objections to it."""
    from rig.cli.view import chosen_runs

    chosen = chosen_runs(campaign, [name] if name else [])
    runs = chosen.runs if name else (chosen.evidence.runs or chosen.runs)
    recording = runs[0].recording()
    said = []
    if len(campaign) > 1 and name is None:
        place = f"{campaign.names.index(recording.name) + 1} of {len(campaign)}"
        said.append(f"Run {recording.name}, {place}; --run NAME shows another.")
    if recording.excluded:
        said.append(f"Run {recording.name} is left out of evidence: {recording.excluded}")
    for line in () if quiet else said:
        remarks().print(line)
    return recording


def _estimators(
    recording: "Recording",
    model: Path | None,
    balance: str | None,
    any_instrument: bool,
    quiet: bool,
) -> "list[LiveEstimator]":
    """Begin the estimates of the named model, else of that in use, at the recording's rate."""
    from estimation.estimators.instrument import require_own
    from rig.configuration.model_in_use import model_in_use
    from rig.live.estimator import estimators_of, passed_over, without_interval

    path = model or model_in_use(recording.rig)
    if path is None:
        return []
    if model is None and not quiet:
        remarks().print(f"Estimate of the model in use, {path.name}.")
    estimators = estimators_of(path, recording.sample_rate_hz, recording.conditions, balance)
    models = [estimator.model for estimator in estimators]
    chosen = [] if balance else passed_over(models, path)
    for line in () if quiet else (*chosen, *without_interval(models, path)):
        remarks().print(line)
    for name, level in estimators[0].other_levels.items() if not quiet else ():
        remarks().print(
            f"No interval: {path.name} was fitted at one level of {name}, and this run is at"
            f" {level:g}. `rig fit` on runs at several levels gives one."
        )
    if not any_instrument:
        require_own(estimators[0].instrument, recording)
    return estimators
