"""The folders of one person: what is remembered, and what can be made again."""

import os
from pathlib import Path


def state_folder() -> Path:
    """Return `$RIG_STATE_DIR`, else `rig` in the user's state folder."""
    if own := os.environ.get("RIG_STATE_DIR"):
        return Path(own)
    return _users("XDG_STATE_HOME", ".local/state")


def cache_folder() -> Path:
    """Return `rig` in the user's cache folder."""
    return _users("XDG_CACHE_HOME", ".cache")


def _users(variable: str, usual: str) -> Path:
    return Path(os.environ.get(variable) or Path.home() / usual) / "rig"
