"""`rig calibrate`: guided calibrations on the bench or on the simulated rig."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rig.output.console import JsonFlag, emit_json, remarks, results

if TYPE_CHECKING:
    from calibration.procedure import Operator, Procedure, Step
    from drivers.device import Device
    from rig.calibrate.run import Kept
    from rig.configuration.config import Config

calibrate_app = typer.Typer(
    name="calibrate",
    help="Calibrate a sensor or a part of the rig, step by step.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@calibrate_app.callback()
def calibrate() -> None:
    """Calibrate a sensor or a part of the rig, step by step.

    Nothing is kept before the last step has been measured and its data were found good. Ctrl-C
    ends a session at any time with the rig safe and nothing written.
    """


@dataclass(frozen=True, kw_only=True)
class Keeping:
    """How a session is run and kept: the options that every command has."""

    operator: Annotated[str, typer.Option(help="Name of the operator, stored in the record.")]
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="Configuration; by default the simulated rig."),
    ] = None
    store: Annotated[
        Path | None,
        typer.Option(
            "--store", help="Folder; if none, RIG_CALIBRATIONS, else ~/.config/rig/calibrations."
        ),
    ] = None
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder of the raw logs.")] = None
    raw: Annotated[
        Path | None, typer.Option("--from", help="Measure nothing: fit again from these raw logs.")
    ] = None
    force_sensor: Annotated[
        str | None, typer.Option(help="DRIVER=URL, such as ati-net=udp:192.168.1.1:49152.")
    ] = None
    days: Annotated[float, typer.Option(min=1, help="Stale after this number of days.")] = 180
    notes: Annotated[str, typer.Option(help="Notes, stored in the record.")] = ""
    use: Annotated[bool, typer.Option("--use", help="Make the result the active record.")] = False
    yes: Annotated[
        bool,
        typer.Option(
            "--yes", "-y", help="Ask no questions; on the simulated rig, simulated hands act."
        ),
    ] = False
    seed: Annotated[int | None, typer.Option(help="Seed of the simulated rig.")] = None
    json: JsonFlag = False


def session(make: "Callable[..., Procedure]") -> None:
    """Register a command that makes a procedure of its own options and carries it out."""
    own = inspect.signature(make)
    shared = inspect.signature(Keeping)

    def command(**options: Any) -> None:
        how = Keeping(**{name: options.pop(name) for name in shared.parameters})
        _conduct(make(**options), how)

    parameters = [*shared.parameters.values(), *own.parameters.values()]
    keyword = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in parameters]
    command.__signature__ = inspect.Signature(keyword)  # type: ignore[attr-defined]
    command.__doc__ = make.__doc__
    command.__name__ = make.__name__
    calibrate_app.command(make.__name__)(command)


@session
def torque(
    sensor: Annotated[str, typer.Option(help="proximal or distal.")] = "proximal",
    arm_mm: Annotated[float, typer.Option(help="From the axis to the weights, mm.")] = 100.0,
    masses_g: Annotated[str, typer.Option(help="Weights, g, rising.")] = "50,100,150,200,250",
    repeats: Annotated[int, typer.Option(min=1, help="Number of passes up and down.")] = 1,
    shunt_v_v: Annotated[
        float | None, typer.Option(help="Change by the shunt on the certificate, V/V.")
    ] = None,
    counts_per_v_v: Annotated[
        float | None, typer.Option(help="Counts per V/V of amplifier and converter.")
    ] = None,
    temperature_c: Annotated[
        float | None, typer.Option(help="Temperature of the sensor, for the notes.")
    ] = None,
) -> "Procedure":
    """Torque sensor: zero, shunt, then known weights on an arm, up and down again."""
    from calibration.sessions.torque import TorqueSession

    return TorqueSession(
        sensor=sensor,
        arm_m=arm_mm / 1e3,
        masses_kg=tuple(mass / 1e3 for mass in _numbers(masses_g, "--masses-g")),
        repeats=repeats,
        shunt_v_v=shunt_v_v,
        counts_per_v_v=counts_per_v_v,
        temperature_k=None if temperature_c is None else temperature_c + 273.15,
    )


@session
def current(
    loads_a: Annotated[str, typer.Option(help="Loads to move against, A.")] = "0.1,0.3,0.5,0.7,0.9",
    speeds_rad_s: Annotated[str, typer.Option(help="Speeds of the spindle.")] = "0.5,1.0",
    repeats: Annotated[int, typer.Option(min=1, help="Number of moves of each.")] = 1,
    motor_constant: Annotated[
        float | None,
        typer.Option(help="Torque constant of the data sheet, N m/A, for the efficiency."),
    ] = None,
    ratio: Annotated[float, typer.Option(help="Ratio of the gear.")] = 35.0,
) -> "Procedure":
    """Motor current against the spindle's torque sensor: constant, friction, driver."""
    from calibration.sessions.current import CurrentSession

    return CurrentSession(
        loads_a=tuple(_numbers(loads_a, "--loads-a")),
        speeds_rad_s=tuple(_numbers(speeds_rad_s, "--speeds-rad-s")),
        repeats=repeats,
        motor_constant_n_m_a=motor_constant,
        gear_ratio=ratio,
    )


@session
def gearbox(
    loads_a: Annotated[str, typer.Option(help="Loads of both signs, A.")] = "-0.9,-0.5,0.5,0.9",
    repeats: Annotated[int, typer.Option(min=1, help="Number of moves of each.")] = 1,
    ratio: Annotated[float, typer.Option(help="Ratio of the gear.")] = 35.0,
    stiffness_only: Annotated[
        bool, typer.Option("--stiffness-only", help="Model no backlash.")
    ] = False,
) -> "Procedure":
    """Gear: torsional stiffness and backlash."""
    from calibration.sessions.gearbox import GearboxSession

    loads = tuple(_numbers(loads_a, "--loads-a"))
    return GearboxSession(
        loads_a=loads, repeats=repeats, gear_ratio=ratio, stiffness_only=stiffness_only
    )


@session
def encoder(
    which: Annotated[str, typer.Option(help="spindle or jaw.")] = "spindle",
    repeats: Annotated[int, typer.Option(min=1, help="Number of moves of each.")] = 2,
    line_only: Annotated[
        bool, typer.Option("--line-only", help="Model no periodic error.")
    ] = False,
) -> "Procedure":
    """Encoder: zero at its mark, and against the next one ratio, offset and periodic error."""
    from calibration.sessions.encoder import EncoderSession

    return EncoderSession(encoder=which, repeats=repeats, line_only=line_only)


@session
def ft(
    jaw_mm: Annotated[str, typer.Option(help="The jaw from the sensor's origin, mm.")] = "0,0,0",
    jaw_turn_deg: Annotated[
        str, typer.Option(help="Rotations of the jaw's frame about x, y, z of the sensor.")
    ] = "0,0,0",
    repeats: Annotated[int, typer.Option(min=1, help="Number of rounds through the poses.")] = 1,
) -> "Procedure":
    """Force sensor: bias, weight and centre of mass of its tool, and the lever arm to the jaw."""
    from math import radians

    from calibration.sessions.ft import FtSession

    jaw, turn = _three(jaw_mm, "--jaw-mm"), _three(jaw_turn_deg, "--jaw-turn-deg")
    return FtSession(
        repeats=repeats,
        jaw_m=(jaw[0] / 1e3, jaw[1] / 1e3, jaw[2] / 1e3),
        jaw_turn_rad=(radians(turn[0]), radians(turn[1]), radians(turn[2])),
    )


@session
def fsr(
    top_n: Annotated[float, typer.Option(help="Greatest force of a press, N.")] = 1.6,
    presses: Annotated[int, typer.Option(min=3, help="Number of presses.")] = 8,
    hold_s: Annotated[float, typer.Option(min=0, help="Hold time for creep; 0 for none.")] = 30.0,
    degree: Annotated[
        int | None,
        typer.Option(min=1, max=9, help="Degree of the polynomial; by default selected."),
    ] = None,
    force_at_zero: Annotated[
        float | None, typer.Option(help="Fixed force at 0 V; by default fitted.")
    ] = None,
    axis: Annotated[str, typer.Option(help="Channel of the force sensor.")] = "force_z_n",
    rail_v: Annotated[float, typer.Option(help="Upper end of the amplifier.")] = 3.3,
    curve_only: Annotated[
        bool, typer.Option("--curve-only", help="Model neither hysteresis nor creep.")
    ] = False,
) -> "Procedure":
    """Force-sensing resistor against the force sensor: curve, hysteresis, creep."""
    from calibration.sessions.fsr import FsrSession

    return FsrSession(
        top_n=top_n,
        presses=presses,
        hold_s=hold_s,
        degree=degree,
        force_at_zero_n=force_at_zero,
        axis=axis,
        rail_v=rail_v,
        curve_only=curve_only,
    )


def _conduct(procedure: "Procedure", how: Keeping) -> None:
    from datetime import datetime

    from calibration.store import CalibrationStore, default_folder
    from rig.calibrate.raw import read_raw
    from rig.calibrate.run import Signature, keep
    from rig.configuration.config import load_config
    from rig.errors import UsageError

    settings = load_config(how.config)
    _ = settings.reference_limits  # the procedures are of its sensors and its motor
    if how.seed is not None:
        settings = settings.changed(simulation={"seed": how.seed})
    if how.raw is not None:
        kind, measurements, lines = read_raw(how.raw)
        if kind != procedure.kind:
            raise UsageError(
                f"{how.raw} holds a calibration of {kind}.", fix=f"Type `rig calibrate {kind}`."
            )
    else:
        lines = settings.calibration_set()
        measurements = _measure(procedure, settings, how)
    store = CalibrationStore(how.store or default_folder())
    if how.store is None and settings.store is not None:
        store = settings.store
    folder = (
        how.out or Path("logs") / f"{datetime.now():%Y-%m-%d-%H%M%S}-calibrate-{procedure.kind}"
    )
    signature = Signature(
        operator=how.operator,
        days=how.days,
        instrument=settings.instrument.serial or "",
        serials=settings.serials,
        notes=how.notes,
    )
    kept = keep(procedure, measurements, lines, signature, store, folder)
    if how.use:
        for digest in kept.records:
            store.use(digest, _now(), how.operator)
    _show(kept, how)


def _measure(procedure: "Procedure", settings: "Config", how: Keeping) -> list[Any]:
    from calibration.procedure import carry_out
    from rig.bench.logger import open_logger
    from rig.calibrate.bench import RigBench

    screen = remarks()
    operator: Operator
    if settings.is_simulated:
        from rig.calibrate.hands import SimulatedHands

        hands = SimulatedHands(settings)
        bench = RigBench(settings, procedure.devices, hands.open_logger, hands.open_force_sensor)
        operator = hands if how.yes else Asking(hands)
    else:
        force = _force_sensor(how.force_sensor, procedure.devices)
        bench = RigBench(settings, procedure.devices, lambda: open_logger(settings), force)
        operator = Unasked() if how.yes else Asking(None)

    def tell(step: "Step", number: int, total: int) -> None:
        screen.print(f"{number + 1}/{total} {step.name}", markup=False)

    try:
        return carry_out(procedure, operator, bench, tell)
    except KeyboardInterrupt:
        screen.print("\nStopped; the rig is safe and nothing was kept.")
        raise


class Asking:
    """A person at the terminal; hands in the simulated world then do what the person confirms."""

    def __init__(self, hands: "Operator | None") -> None:
        from sys import stdin

        from rig.errors import UsageError

        if not stdin.isatty():
            raise UsageError(
                "A guided calibration asks questions, and stdin is not a terminal.",
                fix="Run it in a terminal, or on the simulated rig with --yes.",
            )
        self._hands = hands

    def prepare(self, step: "Step") -> None:
        """Show the instruction and wait for Enter; `q` ends the session."""
        from calibration.procedure import AbortedError

        if step.instruction:
            screen = remarks()
            screen.print(step.instruction, markup=False)
            screen.print("Enter when done, q to stop: ", end="")
            try:
                answer = input()
            except EOFError:
                answer = "q"
            if answer.strip().lower().startswith("q"):
                raise AbortedError("The calibration was stopped; nothing was kept.")
        if self._hands is not None:
            self._hands.prepare(step)


class Unasked:
    """Nobody: right for steps the rig does alone."""

    def prepare(self, step: "Step") -> None:
        """Refuse a step that needs hands."""
        from rig.errors import UsageError

        if step.instruction:
            raise UsageError(
                f"The step {step.name} needs a person: {step.instruction}",
                "With --yes no questions are asked, and a real rig cannot carry out the step.",
                "Run it without --yes.",
            )


def _force_sensor(words: str | None, devices: tuple[str, ...]) -> Any:
    from drivers.registry import open_device
    from rig.errors import UsageError

    if "force_sensor" not in devices:
        return None
    driver, _, url = (words or "").partition("=")
    if not url:
        raise UsageError(
            "This calibration needs a force sensor.",
            fix="Name it: --force-sensor ati-net=udp:192.168.1.1:49152",
        )

    def opened() -> "Device":
        return open_device(driver, url)

    return opened


def _numbers(words: str, option: str) -> list[float]:
    from rig.errors import UsageError

    try:
        return [float(word) for word in words.split(",")]
    except ValueError:
        raise UsageError(
            f"{option} takes numbers with commas between.", f"Given: {words}."
        ) from None


def _three(words: str, option: str) -> list[float]:
    from rig.errors import UsageError

    values = _numbers(words, option)
    if len(values) != 3:
        raise UsageError(f"{option} takes three numbers with commas between.", f"Given: {words}.")
    return values


def _now() -> str:
    from datetime import UTC, datetime

    return datetime.now(UTC).isoformat(timespec="seconds")


def _show(kept: "Kept", how: Keeping) -> None:
    screen = results(how.json)
    for digest, record in kept.records.items():
        screen.print(f"{digest}  {record.channel} from {record.input}", markup=False)
        deviations = [row[k] ** 0.5 for k, row in enumerate(record.fit.covariance)]
        for k, (name, value) in enumerate(record.fit.parameters.items()):
            spread = f" +- {deviations[k]:.2g}" if deviations else ""
            screen.print(f"  {name} {value:.6g}{spread}", markup=False)
        if record.fit.residual_rms is not None:
            screen.print(f"  residual rms {record.fit.residual_rms:.3g}", markup=False)
    for name, found in kept.conclusion.found.items():
        shown = f"{found:.4g}" if isinstance(found, float) else found
        screen.print(f"  {name} {shown}", markup=False)
    screen.print(f"Raw logs: {kept.folder}", markup=False)
    if not how.use:
        first = next(iter(kept.records))
        screen.print(f"Use it: rig cal use {first} --by {how.operator}", markup=False)
    if how.json:
        records = {
            digest: {"channel": r.channel, "input": r.input, "fit": r.fit, "validity": r.validity}
            for digest, r in kept.records.items()
        }
        emit_json({"folder": kept.folder, "records": records, "found": kept.conclusion.found})
