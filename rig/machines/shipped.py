"""The machines that come with the project: the reference rig, and some that other people built."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from estimation import plant_file
from estimation.errors import nearest
from estimation.plant import Plant
from estimation.plant_equations import missing
from rig.errors import UsageError

if TYPE_CHECKING:
    from estimation.model import Model


def shipped() -> dict[str, Path]:
    """Return the machine files that come with the project, by name."""
    folder = Path(str(files("rig"))) / "machines" / "examples"
    others = {path.stem: path for path in folder.glob("*.toml")}
    return dict(sorted((plant_file.shipped() | others).items()))


def place_of(path: Path) -> Path:
    """Return the file of a machine: the path, or the file of that name in `shipped`.

    Raises:
        NoPlantError: No such file and no such name.
    """
    known = shipped()
    place = known.get(str(path), path)
    if not place.exists():
        raise plant_file.NoPlantError(
            f"There is no machine {str(path)!r}: neither a file nor a shipped machine.",
            f"Shipped: {', '.join(known)}.",
            f"{nearest(str(path), list(known))} `rig machine new` writes a file.",
        )
    return place


def read_machine(path: Path) -> Plant:
    """Read a machine file, or a shipped machine by its name.

    Raises:
        NoPlantError: No such file and no such name.
        PlantFileError: The file cannot be read.
    """
    return plant_file.read(place_of(path))


def equations_of(path: Path) -> "list[Model]":
    """Return the equations of a machine file, or of a shipped machine by its name.

    Raises:
        NoPlantError: No such file and no such name.
        PlantFileError: The file cannot be read.
        UsageError: The machine's sensors allow no equation.
    """
    from estimation.plant_models import declared  # loads numba, which help must not

    plant = read_machine(path)
    models = declared(plant)
    if not models:
        gaps = [f"{gap.what} Needed: {gap.needed}" for gap in missing(plant)]
        raise UsageError(
            f"No equation can be written for {plant.name}.",
            " ".join(gaps),
            f"`rig machine check {path}` lists what is needed.",
        )
    return models


def of_equation(models: "Sequence[Model]", balance: str | None) -> "list[Model]":
    """Return the models of an equation; all of them without one (UsageError if there is none)."""
    chosen = [model for model in models if balance in (None, model.balance)]
    if not chosen:
        known = list(dict.fromkeys(model.balance for model in models))
        raise UsageError(
            f"There is no declared model of the equation {balance!r}.",
            f"Declared: {', '.join(known)}.",
            f"{nearest(balance or '', known)} Or name a model file with --model.",
        )
    return chosen
