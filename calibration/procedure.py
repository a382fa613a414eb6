"""A guided calibration: steps with a measurement each, then a conclusion from all of them.

A procedure has no access to devices and asks no questions. The caller passes in an operator, who
receives the set-up instructions of each step, and a bench, which measures it. Nothing is stored
before the conclusion, so that an aborted session has no effect.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calibration.errors import CalibrationError
from calibration.linear import CalibrationSet
from calibration.quality import SATURATED_SHARE, BadDataError
from calibration.record import Fit
from estimation.recording import Flag, FloatArray, Recording


class AbortedError(CalibrationError):
    """The operator ended the session before its last step."""


@dataclass(frozen=True, eq=False)
class Step:
    """One thing to set up and measure.

    Attributes:
        name: Name of the run, unique in the session.
        conditions: What is set, numbers in SI with the unit in the name; kept in the raw log.
        instruction: Instruction for a person before the step; empty if none is needed.
        duration_s: Time to measure a rig that is not moved.
        target_angle_rad: Spindle trajectory at 1 kHz, shape (n,); None where nothing moves.
        load_command_a: Load current at 1 kHz, shape (n,); None where nothing moves.
    """

    name: str
    conditions: Mapping[str, float | str] = field(default_factory=dict)
    instruction: str = ""
    duration_s: float = 2.0
    target_angle_rad: FloatArray | None = None
    load_command_a: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measurement of one step.

    Attributes:
        recording: Channels in SI units and the step's conditions. Sensors are tared once,
            before the first step that moves the rig.
        counts: Raw counts of the logger, structured, shape (n,); None without a logger.
        details: Properties reported by the devices, such as counts per unit.
    """

    recording: Recording
    counts: NDArray[np.void] | None = None
    details: Mapping[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Result:
    """One calibration that came out.

    Attributes:
        input: Raw counts field or channel it reads.
        low: Least input it was measured at; None if it has no range.
        high: Greatest input.
        tared: Whether the zero is measured again before each run.
    """

    channel: str
    input: str
    fit: Fit
    low: float | None = None
    high: float | None = None
    tared: bool = False


@dataclass(frozen=True, eq=False)
class Residuals:
    """The residuals of the fit, for the record's figure.

    Attributes:
        label: Name and unit of the variable.
        unit: Name and unit of the residual.
        series: Name of each run to its variable and residual, each of shape (n,).
    """

    label: str
    unit: str
    series: Mapping[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class Conclusion:
    """Result of a session.

    Attributes:
        found: Other numbers that were measured on the way, and words on what was not.
    """

    results: tuple[Result, ...]
    found: Mapping[str, float | str]
    residuals: Residuals


def or_words(value: float | None, words: str) -> float | str:
    """Return a number that was found, or words on why it was not measured."""
    return words if value is None else value


class Procedure(Protocol):
    """One kind of calibration."""

    @property
    def kind(self) -> str:
        """Kind of the records it makes."""

    @property
    def devices(self) -> tuple[str, ...]:
        """Devices it measures with: `logger`, `force_sensor` or both."""

    def steps(self) -> Sequence[Step]:
        """Return the steps in order."""

    def conclude(self, measurements: Sequence[Measurement], lines: CalibrationSet) -> Conclusion:
        """Return the conclusion from the measurements, one a step in the order of the steps.

        The lines are the calibrations that the recordings were converted with.

        Raises:
            BadDataError: They are not sufficient for a calibration; its `rule` is the reason.
        """


class Answer(Enum):
    """What an operator wants before a step."""

    DONE = "done"
    BACK = "back"
    """Measure the step before again."""


class Operator(Protocol):
    """Who sets up a step: a person at the terminal, or hands in the simulated world."""

    def prepare(self, step: Step) -> Answer | None:
        """Return when the step is set up, or that the one before is to be measured again.

        Raises:
            AbortedError: The session is to end here.
        """


class Bench(Protocol):
    """The measuring part of a step."""

    def measure(self, step: Step) -> Measurement:
        """Play the step's trajectory, or read the rig at rest for the step's duration."""


def carry_out(
    procedure: Procedure,
    operator: Operator,
    bench: Bench,
    on_step: Callable[[Step, int, int], None] | None = None,
    on_measured: Callable[[list[Measurement]], None] | None = None,
    measured: list[Measurement] | None = None,
) -> list[Measurement]:
    """Go through the steps and return their measurements.

    `on_step` is called before each step with it, its number from 0, and how many there are;
    `on_measured` after each step with all measurements so far, its own last. `measured` holds those
    of the first steps, where a session goes on; it grows step by step, so that a caller has what
    was measured before an error.

    Raises:
        AbortedError: The operator ended the session.
        BadDataError: A sensor was at its limit.
    """
    steps = procedure.steps()
    measured = [] if measured is None else measured
    while len(measured) < len(steps):
        step = steps[len(measured)]
        if on_step:
            on_step(step, len(measured), len(steps))
        if operator.prepare(step) is Answer.BACK:
            del measured[-1:]
            continue
        measurement = bench.measure(step)
        refuse_saturated(measurement.recording)
        measured.append(measurement)
        if on_measured:
            on_measured(measured)
    return measured


def refuse_saturated(recording: Recording) -> None:
    """Refuse a recording with more than one sample in a hundred flagged as saturated."""
    share = float(np.mean((recording.flags & np.uint8(Flag.SATURATED)) != 0))
    if share > SATURATED_SHARE:
        raise BadDataError(
            "saturated",
            f"{recording.name}: a converter was at its limit in {share:.0%} of the samples.",
            "What lies beyond a limit is not measured.",
            "Load less, or reduce the amplifier's gain.",
        )
