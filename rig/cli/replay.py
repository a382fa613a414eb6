"""`rig replay LOG`: the live display on a recording, with any model."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from rig.cli.options import FormatOption, MachineOption, PlainFlag, ReplayModel, require_number
from rig.output.console import JsonFlag, present, remarks, results

if TYPE_CHECKING:
    from estimation.campaign import Campaign
    from estimation.recording import Recording
    from rig.live.estimator import ModelEstimator

GRIP, EFFORTS = "distal_torque_n_m", ("_n_m", "_n", "_a")
"""The main channel of the reference rig, and the units of what is shown where there is none."""


def replay(
    log: Annotated[Path, Argument(help="Recording: a file, folder or archive.")],
    run: Annotated[
        str | None, Option(help="Name of the run; by default the first valid one.")
    ] = None,
    model: ReplayModel = None,
    speed: Annotated[
        float, Option(help="Speed relative to real time; 0 is as fast as possible.")
    ] = 1.0,
    plain: PlainFlag = False,
    json_: JsonFlag = False,
    lever_mm: Annotated[float, Option(help="Lever arm from the jaw's axis to its tip, mm.")] = 12.0,
    any_instrument: Annotated[
        bool, Option("--any-instrument", help="Allow a model of another instrument.")
    ] = False,
    machine: MachineOption = None,
    format_: FormatOption = None,
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
    from rig.live.keys import display_keys
    from rig.live.options import ShowOptions
    from rig.live.replay import OF_REPLAY, Pace, replay_blocks
    from rig.live.show import show
    from rig.live.status import model_steps
    from rig.machines.recordings import open_recordings

    require_number("--speed", speed, 0.0)
    recording = _choose(open_recordings(log, machine, format_), run, quiet=json_)
    estimators = _estimators(recording, model, any_instrument, quiet=json_)
    options = ShowOptions(
        title=f"rig replay {recording.name}",
        channels=shown_channels(estimators, _usual(recording)),
        half_widths=lambda: half_widths(estimators),
        lever_m=lever_mm / 1e3,
        plain=plain,
        json=json_,
    )
    with display_keys() as keys:
        pace = Pace(speed or None, keys) if keys else None
        blocks = replay_blocks(recording, estimators, speed or None, pace=pace)
        blocks = through(blocks, model_steps(estimators))
        summary = show(blocks, options.with_keys(keys, OF_REPLAY), results(json_))
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
    recording: "Recording", model: Path | None, any_instrument: bool, quiet: bool
) -> "list[ModelEstimator]":
    """Begin the estimates of the named model, else of that in use, at the recording's rate."""
    from estimation.estimators.instrument import require_own
    from rig.configuration.model_in_use import model_in_use
    from rig.live.estimator import estimators_of

    path = model or model_in_use(recording.rig)
    if path is None:
        return []
    if model is None and not quiet:
        remarks().print(f"Estimate of the model in use, {path.name}.")
    estimators = estimators_of(path, recording.sample_rate_hz, recording.conditions)
    for name, level in estimators[0].other_levels.items() if not quiet else ():
        remarks().print(
            f"No interval: {path.name} was fitted at one level of {name}, and this run is at"
            f" {level:g}. `rig fit` on runs at several levels gives one."
        )
    if not any_instrument:
        require_own(estimators[0].instrument, recording)
    return estimators
