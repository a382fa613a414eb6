"""`rig doctor | devices | udev | selftest | commission | firmware`: what is there, in order?"""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from rig.cli.options import ConfigOption, SimFlag, chosen_rig, group, require_new, require_yes
from rig.output.console import JsonFlag, emit_json, present, results

firmware_app = group("firmware", "Show firmware versions, build the firmware, flash it.")

BoardOption = Annotated[
    str, Option("--board", "-b", help="teensy35, teensy41 or teensy41-grasper.")
]

YesFlag = Annotated[
    bool, Option("--yes", help="The jaw is empty and the emergency stop at hand; do not ask.")
]


def doctor(
    config: ConfigOption = None,
    sim: SimFlag = False,
    bundle: Annotated[
        Path | None,
        Option(help="Write one archive (.zip) for a question to a colleague; no secrets."),
    ] = None,
    json: JsonFlag = False,
) -> int:
    """Check the rig for faults and suggest the next command.

    Exit code 1 when something must be put right, 0 when there are at most warnings. The archive of
    --bundle holds versions, findings, configuration, calibrations in use and the check of the
    newest campaign; no samples, no environment, no credentials and no name of a user.
    """
    from rig.doctor.examine import examine
    from rig.doctor.finding import Level, worst

    require_new(bundle)
    screen = results(json)
    found = []
    settings = chosen_rig(config, sim)
    for finding in examine(settings):
        found.append(finding)
        screen.print(f"{finding.level:8}{finding.subject}, {finding.check}: {finding.what}")
        if finding.fix:
            screen.print(f"{'':8}fix: {finding.fix}")
    grave = worst(found)
    if bundle is not None:
        from rig.doctor.bundle import write_bundle

        names = write_bundle(bundle, settings, found)
        screen.print(f"Wrote {bundle}: {', '.join(names)}.")
    present(json, {"level": grave, "findings": found, "bundle": bundle})
    return 1 if grave is Level.ERROR else 0


def devices(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> None:
    """List serial ports, CAN interfaces, installed drivers, and what is configured."""
    from drivers.registry import broken_drivers, drivers
    from rig.configuration.check import LOGGER
    from rig.configuration.chosen import choose_rig, default_config
    from rig.doctor.ports import can_interfaces, serial_ports

    configured: dict[str, Any] = {}
    if sim or config or default_config():
        settings = choose_rig(config, sim)
        configured = {LOGGER: settings.logger, **settings.devices}
    ports, buses = serial_ports(), can_interfaces()
    texts = {name: driver.description for name, driver in drivers().items()}
    named = {n: {"driver": s.driver, "url": s.url} for n, s in configured.items()}
    said = [
        f"port        {port.path}  {f'usb:{port.usb}' if port.usb else 'not on USB'}  {port.name}"
        for port in ports
    ]
    said += [f"CAN         {name}  can:socketcan:{name}" for name in buses]
    said = said or ["No serial port and no CAN interface is present."]
    said += [f"configured  {name}: {s.driver} at {s.url}" for name, s in configured.items()]
    width = max(map(len, texts))
    said += [f"driver      {name:{width}}  {text}" for name, text in texts.items()]
    broken = {name: error.what for name, error in broken_drivers().items()}
    said += [f"broken      {name}  {text}" for name, text in broken.items()]
    data: dict[str, Any] = {"serial_ports": ports, "can_interfaces": buses}
    data |= {"drivers": texts, "broken_drivers": broken, "configured": named}
    present(json, data, *said)


def udev(json: JsonFlag = False) -> None:
    """Print the udev rules that give you the rig's devices; the first lines say how to install."""
    from rig.doctor.udev import udev_rules

    if json:
        emit_json({"rules": udev_rules()})
    else:
        typer.echo(udev_rules(), nl=False)


def selftest(
    config: ConfigOption = None,
    sim: SimFlag = False,
    bench: Annotated[
        bool, Option("--bench", help="Also name the tests that only a person can make.")
    ] = False,
    json: JsonFlag = False,
) -> int:
    """Run the acceptance test of a bench: devices, rates, zeros, limits, watchdog, stop.

    Nothing moves. Exit code 1 when a check fails.
    """
    from rig.configuration.check import refuse_problems
    from rig.doctor import selftest as acceptance

    settings = chosen_rig(config, sim)
    refuse_problems(settings)
    screen = results(json)
    done = []
    for check in acceptance.selftest(settings):
        done.append(check)
        word = "pass" if check.passed else "FAIL"
        screen.print(f"{word}  {check.name}: {check.detail}")
    failed = [check.name for check in done if not check.passed]
    said = [f"{len(done) - len(failed)} of {len(done)} checks passed on {settings.name}."]
    by_hand = acceptance.bench_tests() if bench else []
    for number, test in enumerate(by_hand, 1):
        said += [f"by hand {number}  {test.name}: {test.do}", f"    must show: {test.shows}"]
    present(json, {"passed": not failed, "checks": done, "by_hand": by_hand}, *said)
    return 1 if failed else 0


def commission(
    config: ConfigOption = None, sim: SimFlag = False, yes: YesFlag = False, json: JsonFlag = False
) -> int:
    """Turn a newly wired rig for the first time: small pulses of current, no position loop.

    Each pulse is limited in size, time and travel. The measured current and every encoder must
    answer in the right direction, closing and opening. Exit code 1 when a check fails.
    """
    from rig.doctor.commission import commission as checks

    settings = chosen_rig(config, sim)
    require_yes(
        "The jaw is empty, the emergency stop works and is at hand?", yes or settings.is_simulated
    )
    screen = results(json)
    made = []
    for check in checks(settings):
        made.append(check)
        said = "passed" if check.passed else "FAILED"
        screen.print(f"{said:8}{check.name}: {check.detail}".rstrip(": "))
    passed = all(check.passed for check in made)
    present(json, {"passed": passed, "checks": made})
    return 0 if passed else 1


@firmware_app.command()
def version(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Hold the board's firmware against this program's and this source tree's.

    Exit code 1 when they do not go together.
    """
    from rig.bench.firmware import compare

    versions = compare(chosen_rig(config, sim))
    present(
        json,
        versions,
        f"program   {versions.program}",
        f"sources   {versions.sources}",
        f"board     {versions.board}",
        *versions.remarks,
    )
    return 0 if versions.fits else 1


@firmware_app.command()
def build(board: BoardOption = "", json: JsonFlag = False) -> None:
    """Build the firmware: for the simulated rig, or with --board for a Teensy."""
    from rig.bench.firmware import build as make
    from rig.bench.firmware import build_for

    where = build_for(board) if board else make()
    present(json, {"built": where}, f"Built {where}.")


@firmware_app.command()
def flash(
    board: BoardOption = "teensy41",
    serial: Annotated[str, Option(help="Serial number the board must have.")] = "",
    json: JsonFlag = False,
) -> None:
    """Build for a Teensy and write it to the only one that is plugged in.

    A second Teensy on this computer is refused, for the loader takes the first it finds, and so is
    an armed board or one that another program has.
    """
    from rig.bench.firmware import flash as write

    found = write(board, serial)
    text = f"Flashed {board} to the board {found.serial}. Next: rig firmware version"
    present(json, {"flashed": board, "serial": found.serial, "port": found.port}, text)
