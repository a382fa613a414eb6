"""The machines that come with the project: the reference rig, and some that other people built."""

from importlib.resources import files
from pathlib import Path

from estimation import plant_file
from estimation.errors import nearest
from estimation.plant import Plant


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
