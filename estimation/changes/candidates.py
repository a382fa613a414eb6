"""What may have changed: a declared parameter, a sensor's gain, or an effect that came or went."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from estimation.causes.candidates import Claim
from estimation.causes.equations import Layout
from estimation.causes.places import Place, places_of
from estimation.causes.sources import Source, sources_at
from estimation.effects.effect import Parameter, Proportional
from estimation.fit_problem import OFFSET
from estimation.model import Term


class SensorGain(Proportional):
    """A reading that is wrong by a constant factor."""

    id = "sensor.gain"
    roles = {"reading": "proximal_torque_n_m"}  # noqa: RUF012 - the class attribute of effects
    amplitudes = (Parameter("gain", "1", "change of the reading's factor"),)


@dataclass(frozen=True)
class Moved(Source):
    """A parameter that may have moved: of a declared term, or a sensor's gain.

    Attributes:
        key: What a report calls it.
        column: Number of its equation's declared column; None of an offset or a sensor's gain.
    """

    key: str = ""
    column: int | None = None

    @property
    def family(self) -> str:
        """A parameter of one equation is a name of its own."""
        return self.key

    @property
    def is_declared(self) -> bool:
        """A declared term; an offset and a sensor's gain are in no column."""
        return self.column is not None

    @property
    def is_bounded(self) -> bool:
        """A parameter moves either way."""
        return False

    @property
    def side(self) -> int:
        """The sign of its term is in how it enters."""
        return 1


def claims(layout: Layout, is_b: Sequence[bool]) -> Iterator[Claim]:
    """Yield everything that may have changed, each acting in the runs of one campaign.

    Args:
        layout: The runs of both campaigns.
        is_b: Whether each is of the second campaign.
    """
    places = places_of(layout)
    later, earlier = (tuple(b is side for b in is_b) for side in (True, False))
    for equation in layout.equations.values():
        column = 0
        for term in equation.model.terms:
            of_all_runs = term.effect.id == OFFSET
            for k in range(len(term.effect.amplitudes)):
                own = None if of_all_runs else column + k
                yield Claim(_moved(places, equation.name, term, k, own), later, given=True)
            if not of_all_runs:
                column += len(term.effect.amplitudes) + len(term.effect.shape)
    for place in places:
        if place.kind in ("torque sensor", "angle sensor"):
            gain, reading = SensorGain(), (("reading", place.roles["reading"][0]),)
            moved = Moved(place, gain, reading, (), (0,), key=f"gain of {place.name}")
            yield Claim(moved, later, given=True)
        for source in sources_at(layout, place):
            if _takes_part(source):
                yield Claim(source, later, given=True)
                yield Claim(source, earlier, given=True)


def _moved(
    places: Sequence[Place], equation: str, term: Term, amplitude: int, column: int | None
) -> Moved:
    own, effect = next(p for p in places if p.name == equation), term.effect
    enters = tuple(replace(e, gain=float(term.sign)) for e in own.enters if e.equation == equation)
    return Moved(
        replace(own, name=f"terms of {equation}", enters=enters),
        effect,
        tuple((role, term.channels[role]) for role in effect.roles),
        tuple(term.numbers(effect.shape)),
        (amplitude,),
        key=f"{effect.id} {effect.amplitudes[amplitude].name} of {equation}",
        column=column,
    )


def _takes_part(source: Source) -> bool:
    """Whether an effect can have come: not one of the campaigns' clock, which their order is too.

    Without a declared friction nothing states the speed over which another one changes its sign.
    """
    shape = zip(source.effect.shape, source.shape, strict=True)
    no_width = any(parameter.name == "width" and value == 0.0 for parameter, value in shape)
    return not no_width and not {"elapsed", "campaign_clock"} & {*source.effect.roles}
