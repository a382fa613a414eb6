"""Where an estimator comes from: its data by hash, its code, and the errors reported with it."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from hashlib import sha256

import numpy as np

from estimation.recording import Recording

HASH_DIGITS = 16


@dataclass(frozen=True)
class Origin:
    """What is needed to make an estimator again, and to see what changed since."""

    made_at: str  # when it was fitted, ISO 8601 with offset from UTC
    code: str  # version and commit of the code that fitted it
    data: Mapping[str, str]  # hash of each run fitted on, by the run's name
    # errors it was reported with, in SI units, by name
    figures: Mapping[str, float] = field(default_factory=dict)
    adapted_from: str = ""  # hash of the file of the estimator it was adapted from; empty of a fit
    is_simulated: bool = False

    def arrays(self) -> dict[str, np.ndarray]:
        """Return it as a named array."""
        return {"origin": np.array(json.dumps(asdict(self), sort_keys=True))}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> "Origin | None":
        """Return the origin of named arrays, None where there is none; ValueError if damaged."""
        if "origin" not in arrays:
            return None
        found = json.loads(str(arrays["origin"]))
        if not isinstance(found, dict) or set(found) - set(cls.__dataclass_fields__):
            raise ValueError("The origin of the estimator is not understood.")
        try:
            return cls(**found)
        except TypeError as error:
            raise ValueError("The origin of the estimator is not complete.") from error


def data_hash(recording: Recording) -> str:
    """Return a hash of a recording's samples: time, flags and every channel by name."""
    found = sha256()
    parts = {"time_s": recording.time_s, "flags": recording.flags, **recording.columns}
    for name in sorted(parts):
        found.update(name.encode())
        found.update(np.ascontiguousarray(parts[name]).tobytes())
    return found.hexdigest()[:HASH_DIGITS]
