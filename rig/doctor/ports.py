"""The ports of this computer: who holds them, who may open them, what talks to them unasked."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from drivers.transport.serial_port import port_holders
from rig.doctor.finding import Finding, Level
from rig.doctor.udev import INSTALL, USB, has_rule

ROOT = Path("/")
CAN_LINK_TYPE = "280"
"""ARPHRD_CAN of Linux's if_arp.h."""


@dataclass(frozen=True, slots=True)
class Port:
    """One serial port."""

    path: str
    usb: str  # `VID:PID:SERIAL`, hexadecimal; empty where it is not on USB
    name: str  # name reported by the device


def serial_ports() -> list[Port]:
    """Return the serial ports of this computer."""
    from serial.tools import list_ports

    ports = []
    for port in sorted(list_ports.comports(), key=lambda found: str(found.device)):
        usb = ""
        if port.vid is not None and port.pid is not None:
            usb = f"{port.vid:04x}:{port.pid:04x}:{port.serial_number or ''}"
        ports.append(Port(str(port.device), usb, str(port.description or "")))
    return ports


def can_interfaces(root: Path = ROOT) -> list[str]:
    """Return the names of the CAN interfaces of this computer."""
    kinds = (root / "sys/class/net").glob("*/type")
    return sorted(k.parent.name for k in kinds if k.read_text().strip() == CAN_LINK_TYPE)


def port_findings(ports: Sequence[Port], root: Path = ROOT) -> list[Finding]:
    """Return the findings on the ports that are the rig's by their USB identity."""
    ours = [port for port in ports if port.usb[:9] in USB]
    findings = [one for port in ours for one in _port_findings(port, root)]
    if ours and _runs("ModemManager", root) and not all(has_rule(p.usb, root) for p in ours):
        what = "ModemManager runs and talks to every new serial port for some seconds."
        findings.append(Finding("this computer", "ModemManager", Level.WARNING, what, INSTALL))
    return findings


def _port_findings(port: Port, root: Path) -> list[Finding]:
    findings = []
    holders = port_holders(port.path)
    if holders:
        number = holders[0].split()[1]
        what = f"It is held by {', '.join(holders)}."
        fix = f"Let that program end, or: kill -TERM {number}"
        findings.append(Finding(port.path, "free", Level.WARNING, what, fix))
    if not os.access(port.path, os.R_OK | os.W_OK):
        what = "You may not open it."
        findings.append(Finding(port.path, "permission", Level.ERROR, what, INSTALL))
    if not has_rule(port.usb, root):
        what = "No udev rule names it."
        findings.append(Finding(port.path, "udev rule", Level.WARNING, what, INSTALL))
    findings += _latency_findings(port, root)
    if not findings:
        findings.append(Finding(port.path, "port", Level.OK, f"{port.usb} is free and yours."))
    return findings


def _latency_findings(port: Port, root: Path) -> list[Finding]:
    """An FTDI adapter waits 16 ms for more bytes by default."""
    timer = root / "sys/bus/usb-serial/devices" / Path(port.path).name / "latency_timer"
    try:
        milliseconds = int(timer.read_text())
    except (OSError, ValueError):
        return []
    if milliseconds <= 1:
        return []
    what = f"Its latency timer is {milliseconds} ms; answers are delayed."
    return [Finding(port.path, "latency", Level.WARNING, what, f"echo 1 | sudo tee {timer}")]


def _runs(name: str, root: Path) -> bool:
    for comm in (root / "proc").glob("[0-9]*/comm"):
        with suppress(OSError):  # ended meanwhile
            if comm.read_text().strip() == name:
                return True
    return False
