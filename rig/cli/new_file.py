"""Outputs that are records: never written over."""

from pathlib import Path

from rig.errors import UsageError


def require_new(path: Path | None) -> None:
    """Refuse to write over a file.

    Args:
        path: Where a command is to write; None if it is to write nothing.

    Raises:
        UsageError: Something is there.
    """
    if path is not None and path.exists():
        raise UsageError(f"{path} is there already.", fix="Name another file.")
