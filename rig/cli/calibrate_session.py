"""A guided calibration as a person carries it out: asked, measured, shown, kept, gone on with."""

import shlex
import sys
from datetime import datetime
from functools import partial
from os import W_OK, access
from pathlib import Path
from typing import Any

from calibration.linear import CalibrationSet
from calibration.procedure import AbortedError, Answer, Operator, Procedure, Step, carry_out
from calibration.sessions.current import CurrentSession, DriveCurrentSession
from calibration.store import CalibrationStore, default_folder
from drivers.registry import open_device
from estimation.files import OutputError, write_text_atomic
from rig.bench.logger import open_logger
from rig.calibrate.bench import RigBench
from rig.calibrate.raw import read_raw, require_absent, whole_folder, write_raw
from rig.calibrate.run import Kept, Signature, keep
from rig.calibrate.shown import announced, found_line, parameter_lines, reading
from rig.cli.calibrate import Keeping
from rig.cli.calibrate_store import store_of
from rig.cli.options import chosen_rig
from rig.configuration.config import Config
from rig.errors import UsageError
from rig.output.console import present, remarks, results
from rig.output.provenance import Provenance, now_utc
from rig.reports.calibration import alarms, page

QUESTION = "Enter when done, b to measure the step before again, q to stop: "


def conduct(procedure: Procedure, how: Keeping) -> None:
    """Measure a calibration, or read its raw logs; conclude, keep and show it."""
    if not how.operator.strip():
        raise UsageError("Who calibrates is not known.", fix="Give --operator NAME.")
    settings = chosen_rig(how.config, how.sim)
    _refuse_idle_force_sensor(procedure, settings, how)
    limits = settings.reference_limits  # the procedures are of its sensors and its motor
    if isinstance(procedure, CurrentSession) and not limits.load_command_a:
        procedure = DriveCurrentSession(
            speeds_rad_s=procedure.speeds_rad_s,
            repeats=procedure.repeats,
            motor_constant_n_m_a=procedure.motor_constant_n_m_a,
        )
    if how.seed is not None:
        settings = settings.changed(simulation={"seed": how.seed})
    store = store_of(how.store, settings)
    folder = how.out or _new_folder("calibrate", procedure)
    if how.raw is not None:
        kind, measurements, lines = read_raw(how.raw)
        if kind != procedure.kind:
            raise UsageError(
                f"{how.raw} holds a calibration of {kind}.", fix=f"Type `rig calibrate {kind}`."
            )
    else:
        for line in announced(procedure):
            remarks().print(line)
        lines = settings.calibration_set()
        _refuse_unkept(store, folder)
        measurements = _measure(procedure, settings, how)
    signature = Signature(
        operator=how.operator,
        days=how.days,
        instrument=settings.instrument.serial or "",
        serials=settings.serials,
        notes=how.notes,
    )
    kept = keep(procedure, measurements, lines, signature, store, folder)
    place = kept.folder / "calibration.html"
    text = page(kept.records, kept.conclusion, store.records(), Provenance.now(0))
    write_text_atomic(place, text)
    if how.use:
        for digest in kept.records:
            store.use(digest, now_utc(), how.operator)
    _show(kept, how, store, place)
    if settings.store is None or settings.store.folder != store.folder:
        name = "default" if store.folder == default_folder() else str(store.folder.resolve())
        results(how.json).print(
            f"Sessions of {settings.name} take no record from this store. To change that, write"
            f' calibration_store = "{name}" in its configuration.'
        )


def _new_folder(what: str, procedure: Procedure) -> Path:
    return Path("logs") / f"{datetime.now():%Y-%m-%d-%H%M%S}-{what}-{procedure.kind}"


def _refuse_unkept(store: CalibrationStore, folder: Path) -> None:
    """Refuse, before anything is measured, a result or raw logs that could not be written."""
    require_absent(folder)
    for place in (store.folder.absolute(), folder.absolute()):
        there = next(above for above in (place, *place.parents) if above.exists())
        if not there.is_dir() or not access(there, W_OK):
            raise OutputError(
                f"{place} cannot be written.", f"See {there}.", "Name another folder."
            )


def _refuse_idle_force_sensor(procedure: Procedure, settings: Config, how: Keeping) -> None:
    if how.force_sensor is None:
        return
    if how.raw is not None:
        why = "With --from nothing is measured."
    elif "force_sensor" not in procedure.devices:
        why = f"A calibration of {procedure.kind} reads no force sensor."
    elif settings.is_simulated:
        why = "The simulated rig has a simulated force sensor."
    else:
        return
    raise UsageError(f"--force-sensor {how.force_sensor} would not be used.", why, "Leave it out.")


def _measure(procedure: Procedure, settings: Config, how: Keeping) -> list[Any]:
    screen = remarks()
    operator: Operator
    lines = settings.calibration_set()
    measured = _begun(procedure, how.resume)
    if settings.is_simulated and settings.logger.profile == "reference":
        from rig.calibrate.hands import SimulatedHands

        hands = SimulatedHands(settings)
        bench = RigBench(settings, procedure.devices, hands.open_logger, hands.open_force_sensor)
        operator = hands if how.yes else Asking(hands)
    else:
        force = _force_sensor(how.force_sensor, procedure.devices)
        bench = RigBench(settings, procedure.devices, lambda: open_logger(settings), force)
        operator = Unasked() if how.yes else Asking(None)

    def tell(step: Step, number: int, total: int) -> None:
        screen.print(f"{number + 1}/{total} {step.name}")

    def show(so_far: list[Any]) -> None:
        screen.print(f"  {reading(procedure, so_far, lines)}")

    try:
        return carry_out(procedure, operator, bench, tell, show, measured)
    except (KeyboardInterrupt, AbortedError):
        kept = _kept_for_later(procedure, measured, lines, how)
        screen.print(f"\nStopped; the rig is safe. {kept}")
        raise


def _begun(procedure: Procedure, folder: Path | None) -> list[Any]:
    """Return the measurements of a session that was stopped; none for a new one."""
    if folder is None:
        return []
    kind, measured, _ = read_raw(folder)
    steps = procedure.steps()[: len(measured)]
    there = [(m.recording.name, dict(m.recording.conditions)) for m in measured]
    if kind != procedure.kind or there != [(s.name, dict(s.conditions)) for s in steps]:
        raise UsageError(
            f"{folder} holds other steps than this session has.",
            "A session goes on with the options it was begun with.",
            "Type the same command as then, with --resume.",
        )
    return measured


def _kept_for_later(
    procedure: Procedure, measured: list[Any], lines: CalibrationSet, how: Keeping
) -> str:
    """Keep what a person set up before a session was stopped; return a message about it."""
    if how.yes or not measured:
        return "Nothing was kept."
    folder = _new_folder("unfinished", procedure)
    with whole_folder(folder) as part:
        write_raw(part, procedure.kind, measured, lines)
    kept = f"{len(measured)} of {len(procedure.steps())} steps are kept"
    return f"{kept}. Go on with the same command and --resume {folder}"


class Asking:
    """A person at the terminal; hands in the simulated world then do what the person confirms."""

    def __init__(self, hands: Operator | None) -> None:
        if not sys.stdin.isatty():
            raise UsageError(
                "A guided calibration asks questions, and stdin is not a terminal.",
                fix="Run it in a terminal, or on the simulated rig with --yes.",
            )
        self._hands = hands

    def prepare(self, step: Step) -> Answer:
        """Show the instruction and wait for Enter; `b` goes back a step, `q` ends the session."""
        if step.instruction:
            remarks().print(step.instruction)
            answer = self._asked()
            if answer == "q":
                raise AbortedError("The calibration was stopped.")
            if answer == "b":
                return Answer.BACK
        if self._hands is not None:
            self._hands.prepare(step)
        return Answer.DONE

    def _asked(self) -> str:
        """Return the answer to the question, asked again until it is one of its answers."""
        while True:
            remarks().print(QUESTION, end="")
            try:
                answer = input().strip().lower()
            except EOFError:
                return "q"
            if answer in ("", "b", "q"):
                return answer
            remarks().print(f"{answer!r} is none of these.")


class Unasked:
    """Nobody: right for steps the rig does alone."""

    def prepare(self, step: Step) -> None:
        """Refuse a step that needs hands."""
        if step.instruction:
            raise UsageError(
                f"The step {step.name} needs hands: {step.instruction}",
                "With --yes nobody is asked, and a real rig has no hands.",
                "Leave --yes away.",
            )


def _force_sensor(words: str | None, devices: tuple[str, ...]) -> Any:
    if "force_sensor" not in devices:
        return None
    driver, _, url = (words or "").partition("=")
    if not url:
        raise UsageError(
            "This calibration needs a force sensor.",
            fix="Name it: --force-sensor ati-net=udp:192.168.1.1:49152",
        )
    return partial(open_device, driver, url)


def _show(kept: Kept, how: Keeping, store: CalibrationStore, place: Path) -> None:
    said = []
    for digest, record in kept.records.items():
        said.append(f"{digest}  {record.channel} from {record.input}")
        said += [f"  {line}" for line in parameter_lines(record)]
    said += [f"  {found_line(name, found)}" for name, found in kept.conclusion.found.items()]
    said.append("Good: the data passed every check of this kind of calibration.")
    drifted = alarms(kept.records.values(), store.records())
    said += [f"ALARM: {line}" for line in drifted]
    said += [f"Raw logs: {kept.folder}", f"Page: {place}"]
    if not how.use:
        by = f"--by {shlex.quote(how.operator)} --store {store.folder}"
        said += [f"Use it: rig calibrate use {digest} {by}" for digest in kept.records]
    records = {
        digest: {"channel": r.channel, "input": r.input, "fit": r.fit, "validity": r.validity}
        for digest, r in kept.records.items()
    }
    whole = {"folder": kept.folder, "records": records, "found": kept.conclusion.found}
    present(how.json, {**whole, "page": place, "drifted": drifted}, *said)
