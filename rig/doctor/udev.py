"""The udev rules that give the user the rig's USB devices and keep ModemManager off them."""

from contextlib import suppress
from pathlib import Path

RULES_FILE = "70-rig.rules"
"""Before 73-seat-late.rules, which acts on the tag `uaccess`."""

USB = {
    "16c0:0483": "Teensy, USB serial",
    "0403:6001": "FTDI FT232: FUTEK USB520, RS-485 adapters",
    "0403:6014": "FTDI FT232H: RS-485 adapters",
    "1d50:606f": "candleLight CAN adapter",
}
"""USB identities of the rig's devices."""

INSTALL = (
    f"rig udev | sudo tee /etc/udev/rules.d/{RULES_FILE} && sudo udevadm control --reload"
    " && sudo udevadm trigger"
)
_FOLDERS = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")


def udev_rules() -> str:
    """Return the text of the rules."""
    lines = [
        "# Devices of the rig: for whoever sits at the computer, and not for ModemManager, which",
        "# talks to every new serial port. Install:",
        f"#   {INSTALL}",
    ]
    for identity, name in USB.items():
        vendor, product = identity.split(":")
        lines += [
            f"# {name}",
            f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", TAG+="uaccess",'
            ' ENV{ID_MM_DEVICE_IGNORE}="1", ENV{ID_MM_PORT_IGNORE}="1"',
        ]
    return "\n".join(lines) + "\n"


def has_rule(identity: str, root: Path) -> bool:
    """Whether any installed rule names a USB identity `VID:PID` and keeps ModemManager off."""
    vendor = identity.split(":")[0].lower()
    for path in (path for folder in _FOLDERS for path in (root / folder).glob("*.rules")):
        with suppress(OSError):
            text = path.read_text(errors="replace").lower()
            if vendor in text and "id_mm_device_ignore" in text:
                return True
    return False
