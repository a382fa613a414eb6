"""Which rig a command is about: named, configured for this folder or person, or the simulated one.

Nobody types the configuration in an emergency, and nobody is to believe that a simulated rig was
the real one. So a rig is looked for in three places, and the simulated one must be asked for.
"""

import os
from pathlib import Path

from calibration.store import own_folder
from rig.configuration.config import SIMULATED, Config, load_config
from rig.errors import UsageError

ENVIRONMENT = "RIG_CONFIG"
FILE = "rig.toml"

ONE_OF = (
    f"Set {ENVIRONMENT} to a configuration, keep one as ./{FILE} or as ~/.config/rig/{FILE}, "
    "or name it with --config. --sim asks for the simulated rig."
)
"""What to do where no rig is configured."""


def default_config() -> Path | None:
    """Return the configuration that counts where none is named; None without one.

    The first of: `$RIG_CONFIG` (a file or a shipped name), `./rig.toml`, `~/.config/rig/rig.toml`.
    """
    if named := os.environ.get(ENVIRONMENT):
        return Path(named)
    places = (Path(FILE), own_folder() / FILE)
    return next((place for place in places if place.is_file()), None)


def configured_rigs() -> list[Path]:
    """Return every configuration somebody may mean: the defaults, and all of `~/.config/rig`."""
    named = os.environ.get(ENVIRONMENT)
    found = [Path(named)] if named else []
    found += [Path(FILE)] if Path(FILE).is_file() else []
    found += sorted(own_folder().glob("*.toml"))
    return list({path.resolve() if path.is_file() else path: path for path in found}.values())


def choose_config(config: Path | None, sim: bool) -> Path:
    """Return the configuration a command is about, by its options `--config` and `--sim`.

    Raises:
        UsageError: Both are given, or neither and no rig is configured.
    """
    if sim:
        if config is not None:
            raise UsageError(
                "--sim asks for the simulated rig and --config for another one.",
                fix="Give one of them.",
            )
        return SIMULATED
    chosen = config or default_config()
    if chosen is None:
        raise UsageError("No rig is configured.", "None is taken by default.", ONE_OF)
    return chosen


def choose_rig(config: Path | None, sim: bool) -> Config:
    """Return the configuration a command is about, as `choose_config`, read and checked."""
    return load_config(choose_config(config, sim))
