"""`rig demo`: the whole way from bytes to a diagnosis, on the simulated rig.

The simulated rig contains one effect that the declared model lacks. The diagnosis is given the logs
of a campaign, which went through the board's frames, its driver and calibration, and nothing else.
"""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from rig.cli.options import OutFolder
from rig.output.console import JsonFlag, present, progress, remarks

if TYPE_CHECKING:
    from rig.configuration.config import Config
    from rig.recording.campaign import RunResult

PROTOCOL = "diagnosis"
MODEL = "motor"
"""One equation keeps the demonstration short."""

DRAW = 212
"""Draws a ripple of the motor's torque; drawn, and not named, so that no log contains it.

A real fault of drives, and one that these runs can identify. Its amplitude varies over a turn,
unlike the catalogue's: drawn a quarter stronger, a smooth function fits better than the catalogue's
sine and the answer is that it depends on the motor's angle, which is right and makes a poorer show.
The rig around it is the one the declared models describe: the measured one also sticks at reversals
and rubs in proportion to its load, which hides a small effect.
"""

FOLDS = 4

PLAIN_BOARD = (
    "The simulated board was the plain one. The compiled firmware takes its place in a checkout of"
    " the sources, after make -C firmware."
)
PLANTED = (
    "What the simulated rig contained, and its logs do not name: {name}, amplitude {mean:.3g} mN m"
    " at the spindle on average over a turn, {periods_per_turn:g} per turn of the motor angle."
)
NEXT = """
This was one equation. With all four the same test runs are used again, so the result is
marked as exploratory:
  rig diagnose {folder}/logs --ledger {ledger}
The model with the identified effect, as it runs:
  rig replay {folder}/logs --model {model}
The recordings in a browser:
  rig view {folder}/logs
To choose and record further experiments automatically, until the effect is unique:
  rig loop --sim
Open the page:
  rig campaigns --open --root {folder}"""


def demo(
    out: OutFolder = None,
    seed: Annotated[
        int | None, Option(help="Seed of noise and split; from the clock by default.")
    ] = None,
    json: JsonFlag = False,
) -> None:
    """Record the simulated rig with an unmodelled effect, identify it, and confirm it."""
    from estimation import model_file
    from estimation.cross_validation import held_out_error
    from estimation.diagnosis.split import split
    from rig.campaigns.index import DIAGNOSIS
    from rig.configuration.config import load_config
    from rig.diagnosis.ledger import Ledger
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import Subject
    from rig.diagnosis.traces import with_cost_of_causal_filters
    from rig.importers.registry import open_campaign
    from rig.reports.diagnosis import write
    from rig.reports.diagnosis_words import sentences
    from rig.reports.fit import held_out_sentence

    now = datetime.now()
    number = seed if seed is not None else int(now.timestamp()) % 1000
    folder = out or Path("logs") / f"demo-{now:%Y-%m-%d-%H%M%S}"
    remarks().print(f"rig demo, seed {number}: everything goes to {folder}")
    config = load_config().changed(
        simulation={"seed": number, "draw_hidden": DRAW, "plant": "declared"}
    )
    logs, declared = folder / "logs", model_file.read(Path(MODEL))
    # simulated runs are not evidence about a real rig: they are not in the user's own log
    ledger, model = folder / "looks.jsonl", folder / f"{MODEL}.model.toml"
    with progress() as bar:

        def say(text: str) -> None:
            bar.console.print(f"- {text}")

        say("recording a campaign through the board's frames and the driver")
        runs, firmware = _record(config, logs, bar.add_task("samples", total=None), bar.update)
        say(f"fitting the declared model {MODEL!r} on the training runs")
        campaign = open_campaign(logs)
        # the others are the diagnosis' proof; whoever looks at them first proves nothing with them
        discover = campaign.select(split(list(campaign.evidence), number).discover)
        held_out = held_out_error(declared, discover, FOLDS, number)
        say(held_out_sentence(declared, held_out))
        looks = Ledger(ledger)
        asked = Subject(campaign, [declared])
        done, look = run_diagnosis(asked, looks, seed=number, quick=True, on_stage=say)
    model_file.write_all(with_cost_of_causal_filters(done).models, model)
    kept = logs / DIAGNOSIS
    report = write(done, number, kept.with_suffix(".html"), kept)
    looks.enter(look)
    planted = _planted()
    files = {"folder": folder, "report": kept.with_suffix(".html"), "model": model}
    found = {"runs": runs, "held_out": held_out, "diagnosis": done.diagnosis.to_json()}
    present(
        json,
        {**files, "ledger": ledger, **found, "planted": planted, "firmware": firmware},
        f"{len(runs)} runs, {sum(run.samples for run in runs)} samples.",
        *([] if firmware else [PLAIN_BOARD]),
        "",
        *sentences(done.diagnosis),
        PLANTED.format(mean=1e3 * planted["amplitude_n_m"], **planted),
        "",
        report[0],
        NEXT.format(ledger=ledger, **files),
    )


def _planted() -> dict[str, Any]:
    """Return the ripple that was hidden in the simulated rig, at the spindle."""
    from rig.simulation.fitted import DECLARED_PLANT
    from rig.simulation.hidden import draw
    from rig.simulation.hidden_drive import RIPPLE_N_M

    hidden = draw(DRAW)
    amplitude_n_m = hidden.strength * RIPPLE_N_M * DECLARED_PLANT.gear_ratio
    return {
        "name": hidden.name,
        "amplitude_n_m": amplitude_n_m,
        "periods_per_turn": hidden.shape[0],
    }


def _record(
    config: "Config", folder: Path, task: Any, update: Callable[..., None]
) -> "tuple[list[RunResult], bool]":
    """Record the campaign; return its runs, and whether the compiled firmware was in the loop."""
    from rig.bench.logger import open_logger
    from rig.bench.session import Session
    from rig.protocols.protocol import load_protocol
    from rig.recording.campaign import open_campaign_folder, record_campaign

    protocol = load_protocol(PROTOCOL)
    update(task, total=sum(plan.target_angle_rad.size for plan in protocol.plans()))
    done: dict[str, int] = {}

    def count(name: str, samples: int, _: int) -> None:
        done[name] = samples
        update(task, completed=sum(done.values()), description=name)

    plans = open_campaign_folder(folder, protocol, config, resume=False)
    with Session(config, open_logger(config)) as session:
        runs = list(record_campaign(session, plans, folder, on_progress=count))
    # known only once the simulation has been imported
    from rig.simulation.logger import uses_firmware

    return runs, uses_firmware(config.simulation)
