"""`rig clear`: clear a latched fault or trip, with the rig out of force."""

from rig.cli.options import ConfigOption, SimFlag, chosen_rig
from rig.output.console import JsonFlag, present


def clear(config: ConfigOption = None, sim: SimFlag = False, json: JsonFlag = False) -> int:
    """Clear the rig's latched fault or trip; the motors stay out of force.

    Find the cause first. An EPOS4 drive is taken out of force, its communication is reset and set
    up again, and its fault is cleared. A logger board is disarmed, and the trip it reports is
    cleared by its code.
    """
    from rig.bench.clearing import clear_latch

    settings = chosen_rig(config, sim)
    latch = clear_latch(settings)
    text = "nothing is latched."
    if latch.code:
        text = f"cleared: {latch.what} (code {latch.code:#06x}) {latch.then}".rstrip()
    latched = {"what": latch.what, "code": latch.code} if latch.code else None
    data = {"state": "disarmed", "latched": latched, "cleared": True}
    present(json, data, f"{settings.name}: out of force; {text}")
    return 0
