"""Names of what comes with the program, for the help and for the shell's completion."""

from pathlib import Path

import estimation
import rig


def _names(folder: Path, ending: str = ".toml") -> list[str]:
    return sorted(path.name.removesuffix(ending) for path in folder.glob(f"*{ending}"))


def config_names() -> list[str]:
    """Return the names of the shipped configurations."""
    names = _names(Path(rig.__file__).parent / "configuration" / "shipped")
    return [name for name in names if not name.endswith(".model")]


def protocol_names() -> list[str]:
    """Return the names of the shipped protocols."""
    return _names(Path(rig.__file__).parent / "protocols")


def model_names() -> list[str]:
    """Return the names of the shipped declared models."""
    from estimation.plant_equations import equations
    from estimation.plant_file import shipped_plant

    own = [equation.name for equation in equations(shipped_plant("reference"))]
    return sorted([*_names(Path(estimation.__file__).parent / "models"), *own])


def machine_names() -> list[str]:
    """Return the names of the shipped machines."""
    examples = Path(rig.__file__).parent / "machines" / "examples"
    return sorted(_names(Path(estimation.__file__).parent / "machines") + _names(examples))


def _matching(names: list[str], start: str) -> list[str]:
    """Return the names and the TOML files that begin with what was typed."""
    typed = Path(start or ".")
    folder = typed if start.endswith("/") or not start else typed.parent
    files = [str(path) for path in folder.glob("*.toml")] if folder.is_dir() else []
    return [name for name in (*names, *sorted(files)) if name.startswith(start)]


def _campaigns() -> list[Path]:
    """Return the folders of logs in `logs/`, the latest name first."""
    logs = Path("logs")
    folders = {path.parent for depth in ("*", "*/*") for path in logs.glob(f"{depth}/*.mcap")}
    return sorted(folders, reverse=True)


def complete_campaign(incomplete: str) -> list[str]:
    """Complete a campaign by its folder's name within `logs/`."""
    names = [str(folder.relative_to("logs")) for folder in _campaigns()]
    return [name for name in names if name.startswith(incomplete)]


def complete_recordings(incomplete: str) -> list[str]:
    """Complete recordings: a campaign's folder, or any path."""
    typed = Path(incomplete or ".")
    folder = typed if incomplete.endswith("/") or not incomplete else typed.parent
    paths = sorted(str(path) for path in folder.iterdir()) if folder.is_dir() else []
    found = dict.fromkeys([*map(str, _campaigns()), *paths])
    return [name for name in found if name.startswith(incomplete)]


def complete_config(incomplete: str) -> list[str]:
    """Complete a configuration: a shipped name or a file."""
    return _matching(config_names(), incomplete)


def complete_protocol(incomplete: str) -> list[str]:
    """Complete a protocol: a shipped name or a file."""
    return _matching(protocol_names(), incomplete)


def complete_machine(incomplete: str) -> list[str]:
    """Complete a machine: a shipped name or a file."""
    return _matching(machine_names(), incomplete)


def complete_effect(incomplete: str) -> list[str]:
    """Complete an effect by its name."""
    from estimation.effects import catalogue

    return [name for name in catalogue() if name.startswith(incomplete)]


def complete_fitted(incomplete: str) -> list[str]:
    """Complete a fitted model: a shipped one, a copy that was in use, or a file."""
    from rig.cli.model import fitted_models

    return _matching(list(fitted_models()), incomplete)


def complete_model(incomplete: str) -> list[str]:
    """Complete a declared model: a shipped name or a file."""
    return _matching(model_names(), incomplete)
