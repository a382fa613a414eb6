"""A protocol file: the runs of a campaign, declared in TOML and expanded into plans.

Each `[[runs]]` table has a `kind` and lists of values; it expands into one run for every
combination and repeat. Loads are the currents commanded to the load motor, angles are
closing-positive.
"""

import itertools
import json
import tomllib
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator

from estimation.files import not_utf8
from rig.configuration.sections import Number, Positive, Section
from rig.configuration.validation import explain
from rig.errors import UsageError
from rig.protocols import trajectory
from rig.protocols.joints import JointHoldRuns, JointPlan, JointSineRuns

SHIPPED = Path(__file__).parent

_Motion = tuple[str, NDArray[np.float64], dict[str, float]]
"""Name of a motion, its spindle angle and its conditions."""


@dataclass(frozen=True, eq=False)
class RunPlan:
    """One run: spindle trajectory, closing-positive, and load current at 1 kHz, shape (n,) each."""

    name: str
    target_angle_rad: NDArray[np.float64]
    load_command_a: NDArray[np.float64]
    conditions: dict[str, float | str] = field(default_factory=dict)

    @property
    def samples(self) -> int:
        """Samples the run will have."""
        return self.target_angle_rad.size

    @property
    def duration_s(self) -> float:
        """Length of the run."""
        return self.samples / trajectory.SAMPLE_RATE_HZ


Plan = RunPlan | JointPlan


class _Table(Section):
    jaw_starts_rad: list[Number] = Field(default=[-1.0471975511965976], min_length=1)
    repeats: int = Field(default=1, ge=1)

    def plans(self) -> Iterator[RunPlan]:
        """Yield one plan for every combination and repeat."""
        for _, start in itertools.product(range(self.repeats), self.jaw_starts_rad):
            yield from self._from(start)

    @abstractmethod
    def _from(self, start_rad: float) -> Iterator[RunPlan]:
        """Yield one plan for every combination that begins at an angle."""


class _LoadedTable(_Table):
    """Each motion at each of some constant loads."""

    loads_a: list[Number] = Field(min_length=1)

    def _from(self, start_rad: float) -> Iterator[RunPlan]:
        for kind, angle, more in self._motions(start_rad):
            for load in self.loads_a:
                yield _constant_load(kind, angle, load, start_rad, **more)

    @abstractmethod
    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        """Yield the motions that begin at an angle."""


class SineRuns(_LoadedTable):
    """Sinusoidal grasps over frequency x load x jaw start."""

    kind: Literal["sine"]
    frequencies_hz: list[Positive] = Field(min_length=1)
    amplitude_rad: Positive = 0.5235987755982988
    duration_s: Positive = 20.0

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        for frequency in self.frequencies_hz:
            angle = trajectory.sine(self.duration_s, start_rad, self.amplitude_rad, frequency)
            yield f"sine-{frequency:g}Hz", angle, {"frequency_hz": frequency}


class FourierRuns(_LoadedTable):
    """A finite Fourier series of spindle angle, shifted to its start, at each load."""

    kind: Literal["fourier"]
    base_frequency_hz: Positive
    cosine_rad: list[Number] = Field(min_length=1)
    sine_rad: list[Number] = Field(min_length=1)
    duration_s: Positive = 20.0

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        base = self.base_frequency_hz
        phase = 2.0 * np.pi * base * trajectory.times(self.duration_s)
        angle = np.zeros_like(phase)
        pairs = zip(self.cosine_rad, self.sine_rad, strict=True)
        for order, (cosine, sine) in enumerate(pairs, start=1):
            angle += cosine * np.cos(order * phase) + sine * np.sin(order * phase)
        yield "fourier", start_rad + angle - angle[:1], {"frequency_hz": base}


class SpeedStaircaseRuns(_LoadedTable):
    """Closing and opening at constant speeds, one after the other, at each load."""

    kind: Literal["speed_staircase"]
    speeds_rad_s: list[Positive] = Field(min_length=1)
    travel_rad: Positive = 0.9
    pause_s: Positive = 0.5

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        speeds = self.speeds_rad_s
        angle = trajectory.speed_staircase(start_rad, self.travel_rad, speeds, self.pause_s)
        yield "speeds", angle, {}


class LoadStaircaseRuns(_Table):
    """Sinusoidal grasps while the load climbs and descends in steps within the run."""

    kind: Literal["load_staircase"]
    loads_a: list[Number] = Field(min_length=2)
    hold_s: Positive = 4.0
    ramp_s: Positive = 0.2
    frequencies_hz: list[Positive] = Field(min_length=1)
    amplitude_rad: Positive = 0.5235987755982988

    def _from(self, start_rad: float) -> Iterator[RunPlan]:
        load = trajectory.steps(self.loads_a, self.hold_s, self.ramp_s)
        duration_s = load.size / trajectory.SAMPLE_RATE_HZ
        for frequency in self.frequencies_hz:
            angle = trajectory.sine(duration_s, start_rad, self.amplitude_rad, frequency)
            conditions: dict[str, float | str] = {
                "trajectory": "loads",
                "jaw_start_rad": start_rad,
                "frequency_hz": frequency,
            }
            yield RunPlan(f"loads-{frequency:g}Hz", angle, load, conditions)


class StepHoldRuns(_LoadedTable):
    """The spindle steps from level to level and holds each, at each load."""

    kind: Literal["step_hold"]
    levels_rad: list[Number] = Field(min_length=2)
    hold_s: Positive = 3.0
    ramp_s: Positive = 0.2

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        yield "hold", start_rad + trajectory.steps(self.levels_rad, self.hold_s, self.ramp_s), {}


class RestRuns(_Table):
    """Nothing moves once it stands at its start; on a device without motors, nothing at all."""

    kind: Literal["rest"]
    duration_s: Positive = 10.0

    def _from(self, start_rad: float) -> Iterator[RunPlan]:
        angle = np.full(round(self.duration_s * trajectory.SAMPLE_RATE_HZ), start_rad)
        yield _constant_load("rest", angle, 0.0, start_rad)


class ChirpRuns(_LoadedTable):
    """Small grasps that become faster and faster, at each load."""

    kind: Literal["chirp"]
    low_hz: Positive
    high_hz: Positive
    amplitude_rad: Positive = 0.05
    duration_s: Positive = 12.0

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        angle = trajectory.chirp(
            self.duration_s, start_rad, self.amplitude_rad, self.low_hz, self.high_hz
        )
        yield "chirp", angle, {}


class DwellRuns(_LoadedTable):
    """Moves to and fro after rests of different length, at each load."""

    kind: Literal["dwell"]
    dwells_s: list[Positive] = Field(min_length=2)
    travel_rad: Positive = 0.4
    move_s: Positive = 0.8

    def _motions(self, start_rad: float) -> Iterator[_Motion]:
        angle = trajectory.dwells(start_rad, self.travel_rad, self.move_s, self.dwells_s)
        yield "dwell", angle, {}


AnyTable = (
    SineRuns | FourierRuns | SpeedStaircaseRuns | LoadStaircaseRuns | StepHoldRuns | ChirpRuns
    | DwellRuns | RestRuns | JointHoldRuns | JointSineRuns
)  # fmt: skip
RunTable = Annotated[AnyTable, Field(discriminator="kind")]

TABLES: tuple[type[Section], ...] = get_args(AnyTable)
"""Every kind of `[[runs]]` table."""


class Protocol(Section):
    """A protocol file: tables that expand into runs."""

    name: str = Field(min_length=1)
    description: str = ""
    runs: list[RunTable] = Field(min_length=1)

    @model_validator(mode="after")
    def _runs_are_of_one_rig(self) -> "Protocol":
        kinds = {isinstance(table, (JointHoldRuns, JointSineRuns)) for table in self.runs}
        if len(kinds) > 1:
            raise ValueError("its runs are of a spindle and of a grasper's joints: no rig has both")
        return self

    def plans(self) -> list[RunPlan]:
        """Return every run in order, numbered so that names are unique and sort by time.

        Raises:
            UsageError: The runs are of a grasper's joints.
        """
        plans = [plan for plan in self.any_plans() if isinstance(plan, RunPlan)]
        if not plans:
            raise UsageError(
                f"The protocol {self.name!r} moves the joints of a grasper.",
                "This rig has a spindle.",
                "Choose a protocol for it, such as quick.",
            )
        return plans

    def any_plans(self) -> list[Plan]:
        """Return every run in order, of whatever rig, numbered likewise."""
        plans: Iterator[Plan] = (p for table in self.runs for p in table.plans())
        return [
            replace(
                plan,
                name=f"{index:03d}-{plan.name}",
                conditions={**plan.conditions, "protocol": self.name},
            )
            for index, plan in enumerate(plans)
        ]


def protocol_toml(protocol: Protocol) -> str:
    """Return a protocol as the text of a file that `load_protocol` reads; defaults are left out."""
    lines = [f"{key} = {json.dumps(getattr(protocol, key))}" for key in ("name", "description")]
    for table in protocol.runs:
        lines += ["", "[[runs]]"]
        told = table.model_dump(exclude_unset=True)
        # TOML writes strings, numbers and lists of numbers as JSON does
        lines += [f"{key} = {json.dumps(value, allow_nan=False)}" for key, value in told.items()]
    return "\n".join(lines) + "\n"


def _constant_load(
    kind: str, angle_rad: NDArray[np.float64], load_a: float, start_rad: float, **more: float
) -> RunPlan:
    conditions: dict[str, float | str] = {
        "trajectory": kind.split("-")[0],
        "load_command_a": load_a,
        "jaw_start_rad": start_rad,
        **more,
    }
    return RunPlan(f"{kind}-{load_a:g}A", angle_rad, np.full(angle_rad.size, load_a), conditions)


def load_protocol(name_or_path: str) -> Protocol:
    """Read a protocol file, or a shipped protocol by its name.

    The UsageError of a file that is missing or is not a protocol names the wrong key.
    """
    path = Path(name_or_path)
    if not path.is_file() and path.suffix == "":
        path = SHIPPED / f"{name_or_path}.toml"
    if not path.is_file():
        shipped = ", ".join(sorted(p.stem for p in SHIPPED.glob("*.toml")))
        raise UsageError(
            f"There is no protocol {name_or_path!r}.",
            f"It is neither a file nor a shipped protocol ({shipped}).",
            "Name a TOML file, or one of the shipped protocols.",
        )
    try:
        text = path.read_text("utf-8")
        return Protocol.model_validate(tomllib.loads(text))
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not a protocol.", *not_utf8(error)) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is not TOML.", str(error)) from error
    except ValidationError as error:
        known = {name for table in TABLES for name in table.model_fields} | {"kind", "runs"}
        raise UsageError(f"{path} is not a protocol.", explain(error, known, text)) from error
