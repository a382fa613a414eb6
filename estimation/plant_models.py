"""A machine's equations as declared models."""

from estimation.channels import unit_of
from estimation.effects import catalogue
from estimation.errors import EstimationError, nearest
from estimation.filters import LowPass
from estimation.model import Model, ModelError, Term
from estimation.plant import Part, Plant, PlantError, Written
from estimation.plant_equations import equations, signals

WORDS = {
    "motor.torque_constant": "gain x {source}",
    "transmission.ratio": "ratio x {load}",
    "inertia.missing": "inertia x {acceleration}",
    "friction.viscous": "viscous friction of {speed}",
    "friction.coulomb": "Coulomb friction of {speed}",
    "compliance.link": "compliance x {load}",
    "transmission.damping": "damping x {rate}",
    "sensor.offset": "offset",
}
"""An effect's term in words."""


def declared(plant: Plant) -> list[Model]:
    """Return the machine's equations as models without values.

    Raises:
        PlantError: An equation of its owner's has an unknown effect, role or channel.
    """
    known = signals(plant)
    own = [equation.name for equation in plant.equations]
    models, effects = [], 0
    for equation in equations(plant):
        number = own.index(equation.name) + 1 if equation.name in own else 0
        try:
            terms = tuple(_term(p, effects + k) for k, p in enumerate(equation.parts, start=1))
            effects += len(terms) if number else 0
            models.append(
                Model(
                    name=equation.name,
                    balance=equation.name,
                    target=equation.target,
                    terms=terms,
                    description=equation.description or in_words(equation, terms),
                    low_pass=LowPass(plant.cutoff_hz, plant.order),
                    run_offsets=plant.run_offsets,
                    counted=equation.samples,
                    signals=known,
                )
            )
        except ModelError as error:
            place = ("equation", number, "") if number else ("machine", 1, "")
            raise PlantError(place, error.what, error.why, error.fix) from error
    return models


def _term(part: Part, number: int) -> Term:
    """Return one effect as a term; it is the so many-th that the machine's owner states."""
    known = catalogue()
    if part.id not in known:
        raise PlantError(
            ("equation.effects", number, "id"),
            f"There is no effect {part.id!r}.",
            nearest(part.id, list(known)),
            "`rig effects` lists them.",
        )
    try:
        for channel in part.channels.values():
            unit_of(channel)
        return Term(known[part.id], part.sign, part.channels)
    except EstimationError as error:
        place = ("equation.effects", number, "channels")
        raise PlantError(place, error.what, error.why, error.fix) from error


def in_words(equation: Written, terms: tuple[Term, ...]) -> str:
    """Return an equation as a sentence."""
    text = f"{equation.target} ="
    for k, term in enumerate(terms):
        words = WORDS.get(term.effect.id, f"{term.effect.id}({', '.join(term.channels.values())})")
        sign = "" if k == 0 and term.sign == 1 else (" +" if term.sign == 1 else " -")
        text += f"{sign} {words.format(**term.channels)}"
    return f"{text}."
