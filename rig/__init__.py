"""The application: command line, session, recording, live display, simulated rig, reports.

As a library, `import rig` gives the calls of `rig.library`; each is loaded when it is first used.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

__all__ = [
    "Prediction",
    "__version__",
    "compare",
    "declared",
    "diagnose",
    "effects",
    "fit",
    "held_out",
    "plot",
    "predict",
    "read",
    "save",
    "simulate",
    "to_pandas",
    "to_polars",
    "to_xarray",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'rig' has no attribute {name!r}")
    _check_rooms()
    return getattr(import_module("rig.library"), name)


def __dir__() -> list[str]:
    return __all__  # what a notebook completes


def _check_rooms() -> None:
    """Raise ImportError where another package has the name of one of the project's."""
    home = Path(__file__).parents[1]
    for room in ("estimation", "calibration", "drivers"):
        found = find_spec(room)
        if found is None or found.origin is None or home not in Path(found.origin).parents:
            where = found.origin if found else "nowhere"
            raise ImportError(
                f"Another package is called {room!r}: it comes from {where}, not from {home}. "
                "Install rig into an environment of its own."
            )
