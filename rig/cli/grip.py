"""`rig grip`: hold a grip torque by the estimate from motor current."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from typer import Option

from rig.cli.options import ConfigOption, LiveModel, SimFlag, chosen_rig, require_number
from rig.errors import UsageError
from rig.output.console import JsonFlag, present, results

if TYPE_CHECKING:
    from rig.live.grip import Held

REACHED_RATIO = 0.1
"""The mean estimate of the second half is this near to the torque, as a share of it."""


def grip(
    torque: Annotated[float, Option(help="Torque to hold at the jaw, N m.")],
    duration: Annotated[float, Option(min=8, help="Duration, s.")] = 40.0,
    config: ConfigOption = None,
    sim: SimFlag = False,
    model: LiveModel = None,
    json: JsonFlag = False,
) -> int:
    """Control a grip torque by the estimate from motor current alone; the sensor is for comparison.

    The rig moves: the jaw goes to and fro a little against its load motor. Exit code 1 when the
    sensor, which nothing is controlled by, is further from the torque than the estimate's interval,
    or the torque was not reached: the load motor cannot give it, or the time was too short.
    """
    from rig.bench.logger import open_logger
    from rig.bench.session import Session
    from rig.live.estimator import channels_of, estimators_of, require_channels
    from rig.live.grip import SHARE, hold_grip
    from rig.protocols.trajectory import SAMPLE_RATE_HZ

    require_number("--duration", duration, 8.0)
    settings = chosen_rig(config, sim)
    most_a = SHARE * settings.reference_limits.load_command_a
    path = model or settings.model_path
    if path is None:
        raise UsageError("No model estimates the torque.", fix="Name one with --model FILE.")
    estimator = estimators_of(path, SAMPLE_RATE_HZ)[0]
    require_channels(channels_of([estimator]), settings, path)
    screen = results(json)
    held = []
    with Session(settings, open_logger(settings)) as session:
        for period in hold_grip(session, estimator, torque, duration):
            held.append(period)
            screen.print(
                f"{period.time_s:6.1f} s  estimate {period.estimate_n_m * 1e3:6.1f} mN m  "
                f"sensor {period.sensor_n_m * 1e3:6.1f} mN m  load {period.load_a:.3f} A"
            )
    return _judge(held, torque, estimator.usual_half_width, most_a, json)


def _judge(
    held: Sequence["Held"], torque: float, allowed: float | None, most_a: float, json: bool
) -> int:
    """Print whether a torque was held and the sensor agrees; return the exit code."""
    import numpy as np

    if not held:
        text = "The estimate was never within what it was fitted on: no load was asked for."
        present(json, {"torque_n_m": torque, "is_reached": False, "periods": []}, text)
        return 1
    late = held[len(held) // 2 :]
    estimate_n_m = float(np.mean([period.estimate_n_m for period in late]))
    sensor_n_m = float(np.mean([period.sensor_n_m for period in late]))
    has_load = late[-1].load_a < most_a
    is_reached = has_load and abs(estimate_n_m - torque) <= REACHED_RATIO * torque
    agrees = allowed is None or abs(sensor_n_m - torque) <= allowed
    shown = "unknown" if allowed is None else f"{allowed * 1e3:.1f} mN m"
    said = [
        f"Second half: estimate {estimate_n_m * 1e3:.1f} mN m, sensor {sensor_n_m * 1e3:.1f} mN m "
        f"for {torque * 1e3:.1f} mN m asked; interval of the estimate {shown}."
    ]
    if not has_load:
        said.insert(0, f"The load is at its most, {most_a:g} A: the torque was not reached.")
    elif not is_reached:
        said.insert(0, "The torque was not reached; give it a longer --duration.")
    data = {
        "torque_n_m": torque,
        "estimate_n_m": estimate_n_m,
        "sensor_n_m": sensor_n_m,
        "half_width95_n_m": allowed,
        "sensor_agrees": agrees,
        "is_reached": is_reached,
        "periods": held,
    }
    present(json, data, *said)
    return 0 if agrees and is_reached else 1
