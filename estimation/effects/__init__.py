"""Physical effects, one file each. To add an effect, add a file to this folder."""

import difflib
import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from estimation.effects.effect import Effect, Parameter, Pointwise, Proportional, Remembering
from estimation.effects.unknown_product import FORMS, product
from estimation.errors import UnknownNameError

__all__ = [
    "Effect",
    "Parameter",
    "Pointwise",
    "Proportional",
    "Remembering",
    "UnknownEffectError",
    "catalogue",
    "effect",
    "families",
]


class UnknownEffectError(UnknownNameError):
    """The catalogue has no effect of the given id."""


@cache
def catalogue() -> Mapping[str, Effect]:
    """Return every effect of this folder by id."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(__path__):
        content = importlib.import_module(f"{__name__}.{module.name}")
        for _, kind in inspect.getmembers(content, inspect.isclass):
            if (
                issubclass(kind, Effect)
                and kind.__module__ == content.__name__
                and "id" in vars(kind)
            ):
                found[kind.id] = kind()
    return MappingProxyType(dict(sorted(found.items())))


def families() -> tuple[str, ...]:
    """Return the families that a diagnosis may report; the last one is `unknown`."""
    found = {kind.family for kind in catalogue().values() if kind.balances}
    return (*sorted(found), "unknown")


def effect(name: str) -> Effect:
    """Return one effect of the catalogue by its id, or a term of a formula: `unknown.sign.bump`.

    Raises:
        UnknownEffectError: No effect has that id. The message names the nearest one.
    """
    known = catalogue()
    if name not in known and (term := product(name)) is not None:
        return term
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.3)
        raise UnknownEffectError(
            f"There is no effect {name!r}.",
            f"The catalogue has: {', '.join(known)}; formulas: unknown.FORM or unknown.FORM.FORM of"
            f" {', '.join(FORMS)}.",
            f"Did you mean {near[0]!r}?" if near else "",
        )
    return known[name]
