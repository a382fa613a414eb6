"""What is diagnosed: the recordings at a path, and the models that are declared of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from estimation import model_file, plant_file
from estimation.arm.balances import balances_of
from estimation.campaign import Campaign
from estimation.derived import measured_channels
from estimation.model import Model
from estimation.plant import Plant
from estimation.plant_models import declared as declared_of
from rig.calibrate.declared import Declared, declared_by_folder, is_raw
from rig.importers.registry import open_campaign
from rig.machines.recordings import formulas_of, open_recordings, with_motion
from rig.machines.shipped import equations_of, of_equation, read_machine


@dataclass(frozen=True)
class Subject:
    """What is diagnosed: recordings, and the models that are declared of them, one an equation."""

    campaign: Campaign
    models: Sequence[Model]
    plant: Plant | None = None
    """The machine, where its file is given."""
    of_machine: bool = False
    """Whether the models are those of a machine file, which its owner can change."""
    formulas: Mapping[str, str] = field(default_factory=dict)
    """Channels that no sensor reads, to the formula of others that they are."""


def subject(
    path: Path,
    model: Path | None = None,
    balance: str | None = None,
    format_name: str | None = None,
    machine: Path | None = None,
    skip_bad: bool = False,
) -> Subject:
    """Return the recordings at a path and their declared models.

    Without a model, raw logs of a calibration are declared by that calibration, an arm's by its
    joints, and others by the rig of this project whose equations the channels allow.

    Args:
        path: File, folder or archive of recordings.
        model: A model file or the name of a shipped one.
        balance: Only this equation.
        format_name: Importer to use; guessed when None.
        machine: A machine file or the name of a shipped machine: its equations are declared, and
            foreign tables are read as it states.
        skip_bad: Exclude runs that cannot be read, with the reason.

    Raises:
        UsageError: The path does not exist, or no model of that equation is declared.
        PlantFileError: The machine file cannot be read.
        ModelFileError: The model cannot be read.
        DataError: The recordings cannot be read.
    """
    if machine is not None:
        own = equations_of(machine)
        models = of_equation(own, balance) if model is None else declared_models(model, balance)
        campaign = open_recordings(path, machine, format_name, skip_bad)
        plant = read_machine(machine)
        moving, formulas = with_motion(campaign, models), formulas_of(machine)
        return Subject(moving, models, plant, of_machine=model is None, formulas=formulas)
    if model is not None:
        models = declared_models(model, balance)
        return Subject(open_campaign(path, format_name, skip_bad), models)
    if format_name is None and is_raw(path):
        return of_calibration(declared_by_folder(path), balance)
    others = [name for name in plant_file.shipped() if name != "reference"]
    rigs = [declared_of(plant_file.shipped_plant(name)) for name in ("reference", *others)]
    if balance is not None and not balance.startswith("joint."):
        known = [rig for rig in rigs if balance in {model.balance for model in rig}]
        rigs = [of_equation(rig, balance) for rig in known or [model_file.reference_rig()]]
    campaign = open_campaign(path, format_name, skip_bad)
    first = next(iter(campaign.evidence), None)
    arm = None if first is None else balances_of(first)
    if arm is not None:
        return Subject(campaign, of_equation(arm.models, balance))
    there = set() if first is None else {"time_s", *first.columns}

    def readable(rig: Sequence[Model]) -> int:
        read = (measured_channels([*m.channels, m.target], m.signals) for m in rig)
        return sum(there >= {*channels} for channels in read)

    return Subject(campaign, max(rigs, key=readable))


def of_calibration(declared: Declared, balance: str | None = None) -> Subject:
    """Return a calibration as what is diagnosed."""
    return Subject(Campaign.of(declared.recordings), of_equation([declared.model], balance))


def declared_models(path: Path | None, balance: str | None) -> list[Model]:
    """Return the models of a file or of a shipped name, or those of one equation alone.

    They are the equations of the reference rig when the path is None.

    Raises:
        UsageError: No model of that equation.
        ModelFileError: The file cannot be read.
    """
    models = model_file.reference_rig() if path is None else model_file.read_all(path)
    return of_equation(models, balance)
