"""`rig effects [NAME]`: the physical effects a diagnosis can name, from their own descriptions."""

import inspect
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument

from rig.cli.options import complete_effect
from rig.output.console import JsonFlag, present

if TYPE_CHECKING:
    from estimation.effects import Effect


def effects(
    name: Annotated[
        str | None,
        Argument(
            help="Effect, such as ripple.motor, or a family's beginning.",
            autocompletion=complete_effect,
        ),
    ] = None,
    json: JsonFlag = False,
) -> None:
    """List the effects a diagnosis can name, or describe one with its equation and source.

    With the beginning of names, such as `friction`, lists those.
    """
    from estimation.effects import catalogue, effect

    known = catalogue()
    listed = {key: one for key, one in known.items() if name is None or key.startswith(f"{name}.")}
    if name is not None and (name in known or not listed):
        one = effect(name)
        present(json, _described(one), *_shown(one))
        return
    width = max(map(len, listed))
    sentences = {key: _text(one).split("\n\n")[0] for key, one in listed.items()}
    rows = (f"{key:{width}}  {text}".replace("\n", " ") for key, text in sentences.items())
    data = {"effects": [_described(one) for one in listed.values()]}
    present(json, data, *rows, f"{len(listed)} effects. More on one: rig effects NAME")


def _text(one: "Effect") -> str:
    return inspect.cleandoc(type(one).__doc__ or "")


def _described(one: "Effect") -> dict[str, Any]:
    return {
        "id": one.id,
        "family": one.family,
        "description": _text(one),
        "equations": list(one.balances),
        "inputs": dict(one.roles),
        "parameters": [*one.amplitudes, *one.shape],
        "told_apart_by": one.told_apart_by,
    }


def _shown(one: "Effect") -> Iterator[str]:
    yield from (one.id, _text(one), "")
    for p in (*one.amplitudes, *one.shape):
        bounds = f"{p.lower:g} to {p.upper:g}"
        yield f"parameter {p.name}: {p.description} ({p.unit}; {bounds})"
    channels = ", ".join(f"{role} = {channel}" for role, channel in one.roles.items())
    yield f"reads: {channels or 'nothing'}"
    if one.balances:
        known = ", ".join(one.balances)
        yield f"searched in: {known}; of other machines, where the inputs are read"
    else:
        yield "searched in: no equation; it is declared only"
    if one.told_apart_by:
        yield f"distinguished by: {one.told_apart_by}"
