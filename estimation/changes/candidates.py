"""What may have changed: a declared parameter, a sensor's gain or zero, or an effect that came."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from estimation.causes.equations import Layout, RunSignals
from estimation.causes.places import Place, places_of
from estimation.causes.sources import Source, sources_at
from estimation.changes.regression import Columns, declared_columns
from estimation.fit_problem import OFFSET
from estimation.recording import FloatArray


@dataclass(frozen=True)
class Moved:
    """A declared parameter of one equation that may have moved."""

    equation: str
    family: str
    parameter: str
    unit: str
    column: int

    @property
    def key(self) -> str:
        """What a report calls it."""
        return f"{self.family} {self.parameter} of {self.equation}"

    def columns(self, run: RunSignals, layout: Layout) -> Columns:
        """Return its column; an offset is one at every sample."""
        if self.column < 0:
            return {self.equation: np.ones((len(run.used[self.equation]), 1))}
        equation = layout.equations[self.equation]
        return {self.equation: declared_columns(equation, run)[:, [self.column]]}


@dataclass(frozen=True)
class SensorMoved:
    """A sensor's gain that may have moved: its error enters every equation that reads it."""

    place: Place
    channel: str

    family = "sensor.gain"
    parameter = "gain"
    unit = "1"

    @property
    def equation(self) -> str:
        """Equation it is reported under."""
        return self.place.home

    @property
    def key(self) -> str:
        """What a report calls it."""
        return f"gain of {self.place.name}"

    def columns(self, run: RunSignals, layout: Layout) -> Columns:
        """Return the error of the reading in every equation."""
        made: dict[str, FloatArray] = {}
        for entry in self.place.enters:
            values = run.on_grid(self.channel)
            for _ in range(entry.order):
                values = np.gradient(values, run.grid / run.rate_hz)
            used = entry.gain * values[run.used[entry.equation], None]
            made[entry.equation] = made.get(entry.equation, 0.0) + used
        return made


@dataclass(frozen=True)
class Came:
    """An effect of the catalogue that one of the campaigns may have and the other has not."""

    source: Source

    @property
    def equation(self) -> str:
        """Equation it is reported under."""
        return self.source.place.home

    @property
    def family(self) -> str:
        """The effect's family."""
        return self.source.family

    @property
    def key(self) -> str:
        """What a report calls it."""
        return f"{self.family} at {self.source.place.name}"

    def columns(self, run: RunSignals, layout: Layout) -> Columns | None:
        """Return the effect's columns in every equation; None where one is not finite."""
        return self.source.columns(run)

    def may_have(self, amplitudes: FloatArray) -> bool:
        """Whether amplitudes have the effect's sign."""
        if len(self.source.parts) > 1:
            return True
        bound = self.source.effect.amplitudes[self.source.parts[0]]
        return not (amplitudes[0] < 0.0 <= bound.lower)


Candidate = Moved | SensorMoved | Came


def candidates(layout: Layout) -> Iterator[Candidate]:
    """Yield everything that may have changed."""
    for name, equation in layout.equations.items():
        column = 0
        for term in equation.terms:
            for parameter in term.effect.amplitudes:
                unit = term.unit(parameter, equation.target)
                yield Moved(name, term.effect.id, parameter.name, unit, column)
                column += 1
        if any(term.effect.id == OFFSET for term in equation.model.terms):
            yield Moved(name, OFFSET, "offset", equation.model.unit, -1)
    for place in places_of(layout):
        if place.kind in ("torque sensor", "angle sensor"):
            yield SensorMoved(place, place.roles["reading"][0])
        yield from (Came(s) for s in sources_at(layout, place) if _takes_part(s))


def _takes_part(source: Source) -> bool:
    """Whether an effect can have come: not one of the campaigns' clock, which their order is too.

    Without a declared friction nothing states the speed over which another one changes its sign.
    """
    clocks = {"elapsed", "campaign_clock"} & set(source.effect.roles)
    widths = [
        value
        for parameter, value in zip(source.effect.shape, source.shape, strict=True)
        if parameter.name == "width"
    ]
    return not clocks and not source.effect.id.startswith("change.") and 0.0 not in widths


def columns_of(candidate: Candidate, layout: Layout) -> Sequence[Columns] | None:
    """Return a candidate's columns in every run; None where one is not finite."""
    out = []
    for run in layout.runs:
        columns = candidate.columns(run, layout)
        if columns is None:
            return None
        out.append(columns)
    return out
