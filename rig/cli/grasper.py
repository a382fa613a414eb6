"""`rig grasper`: the 3-DOF grasper: its designs, its master, and recordings of a simulated one."""

from pathlib import Path
from typing import Annotated

from typer import Option

from rig.cli.options import ConfigOption, SeedOption, SimFlag, chosen_rig, group, require_number
from rig.output.console import JsonFlag, counted, present, progress, remarks
from rig.output.table import TextTable

grasper_app = group(
    "grasper", "The 3-DOF grasper: possible designs, its master, recordings of the simulated one."
)


@grasper_app.command()
def designs(json: JsonFlag = False) -> None:
    """List every combination of Table 1 of Zhao and Nelson 2016, the most compact one marked."""
    from rig.grasper.wrist import designs as every
    from rig.grasper.wrist import most_compact

    found = every()
    best = most_compact(found)
    rows = []
    for design in found:
        gears = [f"1:{design.planetary.gear_ratio:g}", f"{design.planetary.sun_over_carrier:g}"]
        sizes = [f"{design.pulley_ratio:.3g}", f"{design.area:.3g}", str(design.extra_stages)]
        remark = "most compact" if design is best else design.obstacle
        rows.append([*gears, design.drive, *sizes, remark])
    columns = ["gears", "sun/carrier", "driven", "d2/d1", "area", "extra stages", "remark"]
    table = TextTable("Designs of the planetary wrist", columns, rows)
    present(json, {"designs": found, "most_compact": best}, table)


@grasper_app.command()
def record(
    out: Annotated[Path, Option("--out", "-o", help="Folder of the recordings.")],
    pulley_ratio: Annotated[
        float, Option(min=0.5, max=2.0, help="d2/d1 as built; 1 decouples the jaws.")
    ] = 1.0,
    runs: Annotated[int, Option(min=3, help="Number of runs.")] = 12,
    seed: SeedOption = 0,
    json: JsonFlag = False,
) -> None:
    """Record the simulated wrist with the coupling of its pulleys, one log per run.

    All joints move at once. For the kinematics only; `rig record -c grasper` records the forces of
    the simulated grasper, with its board in the loop.
    """
    from rig.grasper.wrist_plant import Wrist, wrist_campaign
    from rig.log.convert import write_recording

    out.mkdir(parents=True, exist_ok=True)
    logs = []
    with progress() as bar:
        task = bar.add_task("runs", total=runs)
        for recording in wrist_campaign(Wrist(pulley_ratio), seed, runs):
            logs.append(write_recording(out / f"{recording.name}.mcap", recording))
            bar.update(task, advance=1, description=recording.name)
    data = {"folder": out, "logs": logs}
    present(json, data, f"{len(logs)} runs in {out}. Next: rig diagnose {out}")


@grasper_app.command()
def follow(
    config: ConfigOption = None,
    sim: SimFlag = False,
    master: Annotated[
        str | None, Option(help="URL, such as usb:16c0:0483; by default the configured one.")
    ] = None,
    duration: Annotated[float, Option(min=0.5, help="Duration, s.")] = 10.0,
    scale: Annotated[
        float, Option(min=0.01, max=2, help="Joint angle per angle of the master.")
    ] = 0.3,
    out: Annotated[Path, Option("--out", "-o", help="Folder of the log.")] = Path("logs"),
    json: JsonFlag = False,
) -> None:
    """Make the three motors follow the master, within the limits of the configuration.

    The grasper moves. It starts at its present position, for any position of the master. Ctrl-C
    quits and disarms the motors.
    """
    from rig.configuration.check import refuse_problems
    from rig.grasper.follow import follow_master

    require_number("--duration", duration, 0.5)
    require_number("--scale", scale, 0.01)
    # the simulated rig of this command is the simulated grasper
    settings = chosen_rig(Path("grasper") if sim and config is None else config, sim=False)
    refuse_problems(settings)
    with counted("following") as count:
        try:
            axes, log = follow_master(
                settings, master, duration, scale, out, lambda time_s: count(time_s, duration)
            )
        except KeyboardInterrupt:
            remarks().print("Stopped; the grasper is safe.")
            raise
    said = [
        f"{moved.axis:5}  from {moved.lowest_rad:+.3f} to {moved.highest_rad:+.3f} rad, "
        f"{moved.largest_error_rad:.4f} rad off at most, force up to {moved.largest_force_n:.2f} N"
        for moved in axes
    ]
    data = {"config": settings.name, "duration_s": duration, "axes": axes, "log": log}
    present(json, data, *said, f"Log: {log}")
