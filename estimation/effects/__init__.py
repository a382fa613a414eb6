"""Physical effects, a file each with its functional forms, or of other packages by entry point."""

import difflib
import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType

from estimation.effects.effect import Effect, Parameter, Pointwise, Proportional, Remembering
from estimation.effects.waves import Waves
from estimation.errors import UnknownNameError

__all__ = [
    "Effect",
    "Parameter",
    "Pointwise",
    "Proportional",
    "Remembering",
    "UnknownEffectError",
    "Waves",
    "catalogue",
    "effect",
    "families",
]


class UnknownEffectError(UnknownNameError):
    """The catalogue has no effect of the given id."""


@cache
def catalogue() -> Mapping[str, Effect]:
    """Return every effect by id: of this folder, and of the entry points `rig.effects`.

    Raises:
        UnknownEffectError: An entry point does not load, is not an effect, or takes a known id.
    """
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
    for entry in entry_points(group="rig.effects"):
        own = _loaded(entry)
        if own.id in found:
            raise _unusable(entry, f"its id {own.id} is taken")
        found[own.id] = own
    return MappingProxyType(dict(sorted(found.items())))


def _loaded(entry: EntryPoint) -> Effect:
    try:
        kind = entry.load()
    except (ImportError, AttributeError) as error:
        raise _unusable(entry, str(error)) from error
    if not (inspect.isclass(kind) and issubclass(kind, Effect)):
        raise _unusable(entry, f"{entry.value} is not a class of effect")
    return kind()


def _unusable(entry: EntryPoint, why: str) -> UnknownEffectError:
    package = entry.dist.name if entry.dist else entry.module
    return UnknownEffectError(
        f"The effect {entry.name!r} of {package} cannot be used: {why}.",
        f"Its entry point is {entry.value}.",
        f"Correct {package}, or remove it.",
    )


def families() -> tuple[str, ...]:
    """Return the families that a diagnosis may report; the last one is `unknown`."""
    found = {kind.family for kind in catalogue().values()}
    return (*sorted(found), "unknown")


def effect(name: str) -> Effect:
    """Return one effect of the catalogue by its id.

    Raises:
        UnknownEffectError: No effect has that id. The message names the nearest one.
    """
    known = catalogue()
    if name not in known:
        abbreviated = [one for one in known if all(part in one for part in name.split("."))]
        near = difflib.get_close_matches(name, abbreviated or known, n=1, cutoff=0.3)
        meant = f"Did you mean {near[0]!r}? " if near else ""
        fix = f"{meant}`rig effects` lists them."
        raise UnknownEffectError(f"There is no effect {name!r}.", fix=fix)
    return known[name]
