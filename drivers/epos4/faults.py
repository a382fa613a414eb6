"""An EPOS4's error codes in plain words: what happened, why, what to do.

Source: the error list of maxon's EPOS4 firmware, as found in two public drivers that agree and in
the transcription of the 2026 firmware specification in the public library `Imcab/EposLib`; where
they differ (0x738A to 0x738D), the specification.
"""

from drivers.errors import CodedError

_MAKER = "Switch the drive off and on; if it comes again, ask the maker."
_LOAD = "Take the load off, let it cool, then command less torque or for a shorter time."
_WIRING = "Check the motor's wiring and that the motor data fit the motor."
_SUPPLY = "Check the power supply's voltage and current, and its wiring."
_SENSOR = "Check the encoder's cable and supply, and the sensor's configuration."
_BUS = "Check CAN wiring, terminators, bit rate and the load of the bus."
_SETTINGS = "Restore the parameters, set up the drive again and store."
_LIMITS = "Check limits and targets."

ERRORS: dict[int, tuple[str, str, str]] = {
    0x0000: ("No error.", "", ""),
    0x1000: ("The drive has an error without a name.", "", _MAKER),
    **dict.fromkeys(range(0x1080, 0x1089), ("The drive did not start properly.", "", _MAKER)),
    0x1090: ("The firmware does not fit the hardware.", "", "Load the firmware of this drive."),
    0x2310: ("The motor current was too high.", "A short, or controller gains too high.", _WIRING),
    0x2320: ("The power stage protected itself.", "A short or overload of its output.", _WIRING),
    0x3210: ("The supply voltage is too high.", "Braking feeds energy back.", _SUPPLY),
    0x3220: ("The supply voltage is too low.", "The supply gives in under load.", _SUPPLY),
    0x4210: ("The power stage is too hot.", "", _LOAD),
    0x4380: ("The motor is too hot.", "Its I2t model has reached the limit.", _LOAD),
    0x5113: ("The logic supply is too low.", "", _SUPPLY),
    0x5280: ("The drive's hardware failed.", "", _MAKER),
    0x5281: ("The hardware's parts do not fit one another.", "", _MAKER),
    0x5282: ("The STO card was not recognised.", "It is not fully in.", "Push the card in fully."),
    **dict.fromkeys(range(0x5480, 0x5484), ("The drive's hardware failed.", "", _MAKER)),
    0x6080: ("The sign of life is missing.", "", _BUS),
    0x6081: ("The external watchdog ran out.", "", _BUS),
    **dict.fromkeys(range(0x6180, 0x61F1), ("The drive's firmware failed.", "", _MAKER)),
    0x6320: ("A parameter is out of range.", "", _SETTINGS),
    0x6380: ("The stored parameters are damaged.", "", _SETTINGS),
    0x7320: ("The position sensor failed.", "", _SENSOR),
    0x7380: ("The position sensor's signals broke off.", "A wire is broken or loose.", _SENSOR),
    0x7381: ("The encoder's resolution does not fit.", "", _SENSOR),
    0x7382: ("The encoder's index is wrong.", "", _SENSOR),
    0x7388: ("The Hall sensors' pattern is wrong.", "", _SENSOR),
    0x7389: ("The Hall sensors' sequence is wrong.", "", _SENSOR),
    0x738A: (
        "Encoder and Hall sensors disagree on the angle.",
        "A wire is wrong, a sensor is defective, or resolution or pole pairs do not fit.",
        _SENSOR,
    ),
    0x738C: ("The SSI sensor could not be read.", "", _SENSOR),
    0x738D: ("The SSI sensor's frames are wrong.", "Their start or stop bits do not fit.", _SENSOR),
    **dict.fromkeys(range(0x7390, 0x7393), ("A position sensor failed.", "", _SENSOR)),
    0x8110: ("The drive lost CAN frames.", "Its receive buffer overran.", _BUS),
    0x8111: ("The drive lost CAN frames.", "A receive buffer overran.", _BUS),
    0x8120: ("The drive's CAN is error passive.", "Many frames are damaged.", _BUS),
    0x8130: (
        "The drive heard no heartbeat of the host.",
        "The program stopped or was late, or the cable is out.",
        "Check that the program reads without pauses, and the cable.",
    ),
    0x8150: ("A PDO's identifier is used twice.", "", "Give every PDO its own identifier."),
    **dict.fromkeys(range(0x8180, 0x8184), ("The drive's EtherCAT failed.", "", _BUS)),
    0x81FD: ("The drive's CAN is bus-off.", "It could not get its frames through.", _BUS),
    0x81FE: ("The drive's CAN receive queue overran.", "", _BUS),
    0x81FF: ("The drive's CAN transmit queue overran.", "", _BUS),
    0x8210: ("A PDO had the wrong length.", "The mapping does not fit.", "Start the driver again."),
    0x8250: ("An RPDO did not come in time.", "The program stopped or was late.", _BUS),
    0x8611: ("The following error is too large.", "", _LIMITS),
    0x8A80: ("The negative limit switch is hit.", "", _LIMITS),
    0x8A81: ("The positive limit switch is hit.", "", _LIMITS),
    0x8A82: ("A software position limit is passed.", "", _LIMITS),
    0x8A88: ("Safe torque off is active.", "", "Release the emergency stop, check the STO inputs."),
    0xFF01: ("The drive's processor is overloaded.", "", _MAKER),
    0xFF02: ("The drive's watchdog ran out.", "", _MAKER),
    0xFF0B: ("The peak load was too high.", "", _LOAD),
    0xFF10: ("A controller gain is out of range.", "", _SETTINGS),
    **dict.fromkeys(
        range(0xFF11, 0xFF25),
        ("Auto-tuning failed.", "", "Tune again with the axis free to move."),
    ),
}
"""What, why and what to do, by error code."""


class DriveFaultError(CodedError):
    """The drive has a fault, or has left operation by itself; `code` is its error code."""


def explain(code: int) -> tuple[str, str, str]:
    """Return the meaning of an error code: what, why, what to do."""
    return ERRORS.get(
        code, ("The drive has an unknown error.", "", "Look it up in the drive's manual.")
    )


def fault(code: int) -> DriveFaultError:
    """Return the error of an error code."""
    what, why, fix = explain(code)
    then = "Then clear the fault (rig clear) and arm again."
    return DriveFaultError(f"{what} (error {code:#06x})", why, f"{fix} {then}".strip(), code)
