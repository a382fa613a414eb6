"""`rig calibrate`: guided calibrations and the store of their records."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from rig.cli.calibrate_check import check
from rig.cli.calibrate_store import add, diagnose, diff, list_, show, use
from rig.cli.options import ConfigOption, SimFlag, SimulationSeed, group
from rig.errors import UsageError
from rig.output.console import JsonFlag

if TYPE_CHECKING:
    from calibration.procedure import Procedure

calibrate_app = group(
    "calibrate", "Calibrate a sensor or a part of the rig; store, check and choose calibrations."
)


@calibrate_app.callback()
def calibrate() -> None:
    """Calibrate a sensor or a part of the rig; store, check and choose calibrations.

    The reading is shown after each step; b measures the step before again. Nothing becomes a
    calibration before the last step has been measured and its data were found good. Ctrl-C or q
    ends a session at any time with the rig safe; what a person set up is kept for --resume.
    """


Ratio = Annotated[
    float | None, Option(help="Ratio of the gear; if none, of the reference rig's file.")
]


@dataclass(frozen=True, kw_only=True)
class Keeping:
    """How a session is run and kept: the options that every command has."""

    operator: Annotated[
        str, Option(envvar="USER", help="Name of the operator, stored in the record.")
    ] = ""
    config: ConfigOption = None
    sim: SimFlag = False
    store: Annotated[
        Path | None,
        Option(
            "--store",
            help="Folder; if none, RIG_CALIBRATIONS, else ~/.config/rig/calibrations; a simulated"
            " rig has a separate folder, NAME-simulated.",
        ),
    ] = None
    out: Annotated[Path | None, Option("--out", "-o", help="Folder of the raw logs.")] = None
    raw: Annotated[
        Path | None, Option("--from", help="Measure nothing: fit again from these raw logs.")
    ] = None
    resume: Annotated[
        Path | None, Option(help="Go on with a session that was stopped: its folder.")
    ] = None
    force_sensor: Annotated[
        str | None, Option(help="DRIVER=URL, such as ati-net=udp:192.168.1.1:49152.")
    ] = None
    days: Annotated[float, Option(min=1, help="Stale after this number of days.")] = 180
    notes: Annotated[str, Option(help="Notes, stored in the record.")] = ""
    use: Annotated[bool, Option("--use", help="Make the result the active record.")] = False
    yes: Annotated[
        bool,
        Option("--yes", "-y", help="Ask no questions; on the simulated rig, simulated hands act."),
    ] = False
    seed: SimulationSeed = None
    json: JsonFlag = False


def session(make: "Callable[..., Procedure]") -> None:
    """Register a command that makes a procedure of its own options and carries it out."""
    own = inspect.signature(make)
    shared = inspect.signature(Keeping)

    def command(**options: Any) -> None:
        from calibration.quality import BadDataError
        from rig.cli.calibrate_session import conduct

        how = Keeping(**{name: options.pop(name) for name in shared.parameters})
        try:
            procedure = make(**options)
        except BadDataError as error:  # what its options cannot be is a slip of whoever typed them
            raise UsageError(error.what, error.why, error.fix) from error
        conduct(procedure, how)

    parameters = [*shared.parameters.values(), *own.parameters.values()]
    keyword = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in parameters]
    command.__signature__ = inspect.Signature(keyword)  # type: ignore[attr-defined]
    command.__doc__ = make.__doc__
    command.__name__ = make.__name__
    calibrate_app.command(make.__name__, rich_help_panel="Step by step")(command)


@session
def torque(
    sensor: Annotated[str, Option(help="proximal or distal.")] = "proximal",
    arm_mm: Annotated[float, Option(help="From the axis to the weights, mm.")] = 100.0,
    masses_g: Annotated[str, Option(help="Weights, g, rising.")] = "50,100,150,200,250",
    repeats: Annotated[int, Option(min=1, help="Number of passes up and down.")] = 1,
    shunt_v_v: Annotated[
        float | None, Option(help="Change by the shunt on the certificate, V/V.")
    ] = None,
    counts_per_v_v: Annotated[
        float | None, Option(help="Counts per V/V of amplifier and converter.")
    ] = None,
    temperature_c: Annotated[
        float | None, Option(help="Temperature of the sensor, for the notes.")
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
    loads_a: Annotated[str, Option(help="Loads to move against, A.")] = "0.1,0.3,0.5,0.7,0.9",
    speeds_rad_s: Annotated[str, Option(help="Speeds of the spindle.")] = "0.5,1.0",
    repeats: Annotated[int, Option(min=1, help="Number of moves of each.")] = 1,
    motor_constant: Annotated[
        float | None, Option(help="Torque constant of the data sheet, N m/A, for the efficiency.")
    ] = None,
    ratio: Ratio = None,
) -> "Procedure":
    """Motor current against the spindle's torque sensor: constant, friction, driver."""
    from calibration.chain import GEAR
    from calibration.sessions.current import CurrentSession

    return CurrentSession(
        loads_a=tuple(_numbers(loads_a, "--loads-a")),
        speeds_rad_s=tuple(_numbers(speeds_rad_s, "--speeds-rad-s")),
        repeats=repeats,
        motor_constant_n_m_a=motor_constant,
        gear_ratio=ratio or GEAR.ratio,
    )


@session
def gearbox(
    loads_a: Annotated[str, Option(help="Loads of both signs, A.")] = "-0.9,-0.5,0.5,0.9",
    repeats: Annotated[int, Option(min=1, help="Number of moves of each.")] = 1,
    ratio: Ratio = None,
    stiffness_only: Annotated[bool, Option("--stiffness-only", help="Model no backlash.")] = False,
) -> "Procedure":
    """Gear: torsional stiffness and backlash."""
    from calibration.chain import GEAR
    from calibration.sessions.gearbox import GearboxSession

    return GearboxSession(
        loads_a=tuple(_numbers(loads_a, "--loads-a")),
        repeats=repeats,
        gear_ratio=ratio or GEAR.ratio,
        stiffness_only=stiffness_only,
    )


@session
def encoder(
    which: Annotated[str, Option(help="spindle or jaw.")] = "spindle",
    repeats: Annotated[int, Option(min=1, help="Number of moves of each.")] = 2,
    line_only: Annotated[bool, Option("--line-only", help="Model no periodic error.")] = False,
) -> "Procedure":
    """Encoder: zero at its mark, and against the next one ratio, offset and periodic error."""
    from calibration.sessions.encoder import EncoderSession

    return EncoderSession(encoder=which, repeats=repeats, line_only=line_only)


@session
def ft(
    jaw_mm: Annotated[str, Option(help="The jaw from the sensor's origin, mm.")] = "0,0,0",
    jaw_turn_deg: Annotated[
        str, Option(help="Rotations of the jaw's frame about x, y, z of the sensor.")
    ] = "0,0,0",
    repeats: Annotated[int, Option(min=1, help="Number of rounds through the poses.")] = 1,
) -> "Procedure":
    """Force sensor: bias, weight and centre of mass of its tool, and the lever arm to the jaw."""
    from calibration.sessions.ft import FtSession

    x, y, z = _numbers(jaw_mm, "--jaw-mm", are_three=True)
    turns_deg = _numbers(jaw_turn_deg, "--jaw-turn-deg", are_three=True)
    about_x, about_y, about_z = map(radians, turns_deg)
    return FtSession(
        repeats=repeats, jaw_m=(x / 1e3, y / 1e3, z / 1e3), jaw_turn_rad=(about_x, about_y, about_z)
    )


@session
def fsr(
    top_n: Annotated[float, Option(help="Greatest force of a press, N.")] = 1.6,
    presses: Annotated[int, Option(min=3, help="Number of presses.")] = 8,
    hold_s: Annotated[float, Option(min=0, help="Hold time for creep; 0 for none.")] = 30.0,
    degree: Annotated[
        int | None, Option(min=1, max=9, help="Degree of the polynomial; by default selected.")
    ] = None,
    force_at_zero: Annotated[
        float | None, Option(help="Fixed force at 0 V; by default fitted.")
    ] = None,
    axis: Annotated[str, Option(help="Channel of the force sensor.")] = "force_z_n",
    rail_v: Annotated[float, Option(help="Upper end of the amplifier.")] = 3.3,
    curve_only: Annotated[
        bool, Option("--curve-only", help="Model neither hysteresis nor creep.")
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


for function in (check, add, list_, show, diff, use, diagnose):
    calibrate_app.command(function.__name__.rstrip("_"), rich_help_panel="Records")(function)


def _numbers(words: str, option: str, are_three: bool = False) -> list[float]:
    try:
        values = [float(word) for word in words.split(",")]
    except ValueError:
        values = []
    if not values or (are_three and len(values) != 3):
        raise UsageError(
            f"{option} takes {'three ' if are_three else ''}numbers with commas between.",
            f"Given: {words}.",
            f"Give them as in {option} 10,20,30.",
        )
    return values
