"""The machines of the study: their recordings, equations, and what their owners published."""

import tarfile
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from estimation.recording import Recording


@dataclass(frozen=True)
class Case:
    """One machine, or one part of it.

    Attributes:
        machine: Shipped machine.
        folder: Folder of its recordings in the data, or `machine-FOLDER.tar.xz`; also the name of
            the page that says what is declared, published and suspected.
        published: Published error, in words.
        files: Pattern of the files in the folder; all when empty.
        equation: Only this equation; all when empty.
        only: Condition to the value that a run must have.
    """

    name: str
    machine: str
    folder: str
    published: str
    files: str = ""
    equation: str = ""
    only: Mapping[str, float] = field(default_factory=dict)

    def wants(self, recording: Recording) -> bool:
        """Whether a run belongs to the case."""
        return all(
            abs(float(recording.conditions.get(name, float("nan"))) - value) < 1e-3 * value
            for name, value in self.only.items()
        )


_SERVO = "position error in simulation .0309 to .0323 rad, six friction models, parts cut out"
_JOINT = "none for a joint alone"

CASES = (
    Case("EMPS", "emps", "emps", "4.083 % of the force; by direction 3.112 %"),
    Case("smart grasper", "smart_grasper", "smart-grasper", "none stated"),
    Case(
        "STS3215, 1.168 kg at .1 m",
        "sts3215",
        "sts3215",
        _SERVO,
        only={"pendulum_mass_kg": 1.1682, "pendulum_length_m": 0.1},
    ),
    Case(
        "STS3215, .969 kg at .15 m",
        "sts3215",
        "sts3215",
        _SERVO,
        only={"pendulum_mass_kg": 0.969, "pendulum_length_m": 0.15},
    ),
    Case("UR10e, joint 6", "ur10e", "ur10e", _JOINT, "*joint_6.csv", "joint_6"),
    Case("UR10e, joint 1", "ur10e", "ur10e", _JOINT, "*joint_1.csv", "joint_1"),
)


@contextmanager
def unpacked(data: Path, folder: str) -> Iterator[Path | None]:
    """Yield the folder of a machine's recordings, from its archive if need be; None without."""
    archive = data / f"machine-{folder}.tar.xz"
    if (data / folder).is_dir():
        yield data / folder
    elif archive.is_file():
        with tempfile.TemporaryDirectory(prefix="machine-") as place:
            with tarfile.open(archive) as content:
                content.extractall(place, filter="data")
            yield Path(place) / folder
    else:
        yield None
