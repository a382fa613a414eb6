"""What may have changed: a declared parameter, a sensor's gain, or an effect that came or went."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from estimation.causes.acting import Moved, amplitudes_of, reads_target_alone
from estimation.causes.candidates import Claim
from estimation.causes.functions import functions_at
from estimation.causes.layout import Layout
from estimation.causes.offered import sources_at
from estimation.causes.places import places_of
from estimation.causes.sources import Source
from estimation.effects import effect


@dataclass(frozen=True)
class Changed(Moved):
    """A parameter that may have moved, of a declared term or a sensor's gain; `key` is its name."""

    key: str = ""

    @property
    def family(self) -> str:
        """A parameter of one equation is a name of its own."""
        return self.key


def claims(layout: Layout, is_b: Sequence[bool]) -> Iterator[Claim]:
    """Yield everything that may have changed, each acting in the runs of one campaign.

    The layout has the runs of both; `is_b` states of each whether it is of the second one. A moved
    parameter is that of the first campaign and a change in the second, or the other way round: as
    an effect that came or went, it has the better score of both.
    """
    places = places_of(layout)
    later, earlier = (tuple(b is side for b in is_b) for side in (True, False))
    for one in amplitudes_of(layout):
        amplitude = one.effect.amplitudes[one.parts[0]].name
        key = f"{one.effect.id} {amplitude} of {one.place.name}"
        place = replace(one.place, name=f"terms of {one.place.name}")
        changed = Changed(
            place, one.effect, one.channels, one.shape, one.parts, column=one.column, key=key
        )
        yield from (Claim(changed, acts, given=True) for acts in (later, earlier))
    for place in places:
        is_drive = place.name == f"actuator {layout.equations[place.home].target}"
        if place.kind in ("torque sensor", "angle sensor") or is_drive:
            gain, reading = effect("sensor.gain"), (("reading", place.roles["reading"][0]),)
            of_all = reads_target_alone(layout, place)
            changed = Changed(
                place, gain, reading, (), (0,), of_all=of_all, key=f"gain of {place.name}"
            )
            yield from (Claim(changed, acts, given=True) for acts in (later, earlier))
        for source in sources_at(layout, place):
            if _takes_part(source):
                yield from (Claim(source, acts, given=True) for acts in (later, earlier))
        for function in functions_at(layout, place):
            if "time" not in function.variables:  # the order of the campaigns is it, too
                yield from (Claim(function, acts, given=True) for acts in (later, earlier))


def _takes_part(source: Source) -> bool:
    """Whether an effect can have come: not one of the campaigns' clock, which their order is too.

    Without a declared friction nothing states the speed over which another one changes its sign.
    """
    shape = zip(source.effect.shape, source.shape, strict=True)
    no_width = any(parameter.name == "width" and value == 0.0 for parameter, value in shape)
    return not no_width and not {"elapsed", "campaign_clock"} & {*source.effect.roles}
