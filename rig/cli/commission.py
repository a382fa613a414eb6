"""`rig commission`: from a wired bench to its first motion."""

from typing import Annotated

import typer

from rig.cli.options import ConfigOption, SimFlag, chosen_rig
from rig.output.console import JsonFlag, emit_json, results

YesFlag = Annotated[
    bool, typer.Option("--yes", help="The jaw is empty and the emergency stop at hand; do not ask.")
]


def commission(
    config: ConfigOption = None, sim: SimFlag = False, yes: YesFlag = False, json: JsonFlag = False
) -> int:
    """Turn a newly wired rig for the first time: small pulses of current, no position loop.

    Each pulse is limited in size, time and travel. The measured current and every encoder must
    answer in the right direction, closing and opening. Exit code 1 when a check fails.
    """
    from rig.doctor.commission import commission as checks

    settings = chosen_rig(config, sim)
    if not (yes or settings.is_simulated):
        typer.confirm(
            "The jaw is empty, the emergency stop works and is at hand?", abort=True, err=True
        )
    screen = results(json)
    made = []
    for check in checks(settings):
        made.append(check)
        said = "passed" if check.passed else "FAILED"
        screen.print(f"{said:8}{check.name}: {check.detail}".rstrip(": "))
    passed = all(check.passed for check in made)
    if json:
        emit_json({"passed": passed, "checks": made})
    return 0 if passed else 1
