"""The whole examination: configuration, ports, every device, the firmware."""

from collections.abc import Iterator
from pathlib import Path

from rig.bench.devices import openers
from rig.configuration.check import problems
from rig.configuration.config import Config
from rig.doctor.finding import Finding, Level
from rig.doctor.ports import ROOT, port_findings, serial_ports
from rig.doctor.stream import device_findings


def examine(config: Config, root: Path = ROOT) -> Iterator[Finding]:
    """Yield findings as they are made.

    Args:
        config: The expected configuration.
        root: Root of the file system, for the files of the operating system.
    """
    wrong = problems(config)
    for problem in wrong:
        yield Finding("configuration", problem.key, Level.ERROR, problem.what, problem.fix)
    if not wrong:
        yield Finding("configuration", "sound", Level.OK, f"{config.name} is sound.")
    yield from port_findings(serial_ports(), root)
    if wrong:
        return  # it would be opened as it must not be
    for name, open_it in openers(config):
        yield from device_findings(name, open_it)
