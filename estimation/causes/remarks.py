"""What a diagnosis remarks on besides its findings: one sentence each."""

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set

import numpy as np

from estimation.causes.apart import LARGER, Apart
from estimation.causes.candidates import Candidate
from estimation.causes.equations import Equation
from estimation.causes.findings import Kept, written_term
from estimation.causes.folds import unvaried
from estimation.causes.functions import Function
from estimation.causes.instruments import noise_share
from estimation.causes.laid import TINY
from estimation.causes.layout import Layout
from estimation.causes.numbers import DEFAULT
from estimation.causes.run_signals import ANGLES, EFFORTS
from estimation.causes.sources import Source
from estimation.derived import CAMPAIGN_TIME, CLOCKS, origin_of
from estimation.diagnosis.audit import audit
from estimation.diagnosis.result import Finding, is_unexplained
from estimation.diagnosis.split import Sealed
from estimation.model import AT_BOUND, Model
from estimation.noise import MOST_ERROR, MOST_NOISE, noise_of, noisy_sentence
from estimation.recording import Recording
from estimation.signals import Signals

FEW = 4
"""At most one run in so many is far apart from the others."""


def apart(found: Iterable[Apart], is_left_out: bool = False) -> Iterator[str]:
    """Yield the runs of which a channel is in another sign or unit than the others predict."""
    for one in found:
        wrong = "sign" if one.factor < 0.0 else "unit"
        what = (
            f"The run is left out; correct the {wrong} in it to use it."
            if is_left_out
            else f"Check its sign and unit in this run, or exclude the run: --exclude {one.run}."
        )
        factor = f"{one.factor:.2g} times what the other runs predict for it"
        yield f"{one.run}: {one.channel} is {factor}. {what}"


def late(found: Mapping[str, float], signals: Signals) -> Iterator[str]:
    """Yield the angles that are later than others by a little, a sentence each.

    A damped spring between two angles bends with its rate too, as if one of them were late.
    """
    bends = [c for c in signals.combinations if len(c.shares) == 2]
    for reading, delay_s in found.items():
        others = [s.channel for c in bends if c.gain(reading) for s in c.shares]
        damped = [
            f" Damping of the flexible part between {other} and {reading} shows in the same way."
            for other in dict.fromkeys(others)
            if other != reading
        ]
        yield (
            f"{reading}: {1e3 * delay_s:.2g} ms later than the other angles. The search takes so"
            " short a delay into account and does not count it as a finding; it remains in the"
            f" errors.{''.join(damped)}"
        )


def over_noise(layout: Layout, errors: Mapping[str, float]) -> dict[str, float]:
    """Return each equation's error over the noise of its readings, where they show any."""
    noise = {n: math.sqrt(sum(layout.equations[n].noises(layout.runs))) for n in errors}
    return {name: error / noise[name] for name, error in errors.items() if noise[name] > 0.0}


def left(
    layout: Layout, errors: Mapping[str, float], ratios: Mapping[str, float], explained: Set[str]
) -> Iterator[str]:
    """Yield how large the errors left are next to the noise of the readings, a sentence each.

    Of an equation that a finding explains, only where most of its error is not noise.
    """
    for name, ratio in ratios.items():
        equation, error = layout.equations[name], errors[name]
        if name in explained and not is_unexplained(ratio):
            continue
        which, rest = "on", "Most of it has no explanation here."
        if name in explained:
            which = "left on"
            rest += (
                " A diagnosis with the file of --model-out as --model searches next to the"
                " findings."
            )
        yield (
            f"{name}: the error {which} the test runs is {ratio:.2g} times the noise that"
            f" its readings show. {rest if is_unexplained(ratio) else 'Most of it is noise.'}"
        )
        channel, own = _loudest(equation, layout)
        if own > MOST_ERROR * error:
            whose = noise_of(channel, equation.model.signals)
            yield f"{name}: most of that error is {whose}. {_remedy(equation)}"


def far(
    layout: Layout, sizes: Mapping[str, Mapping[str, float]], recordings: Sequence[Recording]
) -> Iterator[str]:
    """Yield the few runs of which an equation's error is far larger than that of all others.

    A run at an end of what was recorded may be the one that shows an effect. `sizes` has the error
    of each equation in each run, in the unit of the target.
    """
    several = {name: found for name, found in sizes.items() if len(found) > 1}
    ratios = over_noise(layout, {name: max(found.values()) for name, found in several.items()})
    for name, found in several.items():
        runs = sorted(found, key=found.__getitem__, reverse=True)
        gaps = [found[one] / max(found[next_], TINY) for one, next_ in itertools.pairwise(runs)]
        gap = max(gaps[: max(1, len(runs) // FEW)])
        if gap < LARGER or not is_unexplained(ratios.get(name, math.inf)):
            continue
        odd = runs[: gaps.index(gap) + 1]
        if len(odd) > 1:
            yield (
                f"{name}: the errors in {', '.join(sorted(odd))} are at least {gap:.2g} times that"
                " in any other run. Compare what these runs have in common; more runs like them"
                " would identify an effect that acts in some of the runs only."
            )
            continue
        fault = f"Check what happened in it, or exclude the run: --exclude {odd[0]}."
        if end := _end(layout, layout.equations[name], odd[0], recordings):
            fault = (
                f"It has {end} of all runs: either an effect that the equation lacks shows"
                " there, and more such runs would identify it, or something happened in it, and"
                f" it is to be excluded: --exclude {odd[0]}."
            )
        yield f"{name}: the error in {odd[0]} is {gap:.2g} times that in any other run. {fault}"


def _end(layout: Layout, equation: Equation, run: str, recordings: Sequence[Recording]) -> str:
    """Return the condition, or the channel of an equation, of which a run has an end; else nothing.

    Of a speed or a load only the largest size counts. A level of several runs explains none: an
    effect of it would show in all of them.
    """
    stated = {r.name: r.conditions for r in recordings}
    for key in stated.get(run, {}):
        values = {name: own[key] for name, own in stated.items() if key in own}
        if len({*values.values()}) < 2 or not all(
            isinstance(x, int | float) for x in values.values()
        ):
            continue
        for word, end in (("least", min), ("largest", max)):
            if [x for x in values.values() if x == end(values.values())] == [values[run]]:
                return f"the {word} {key}"
    for channel in equation.model.channels:
        if channel.endswith(ANGLES) or channel in CLOCKS or origin_of(channel)[1] > 1:
            continue
        peaks = {r.name: float(np.abs(r.on_grid(channel)).max()) for r in layout.runs}
        if run == max(peaks, key=peaks.__getitem__):
            return f"the largest {channel}"
    return ""


def of_levels(findings: Iterable[Finding], recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield which stated condition the runs share in which a finding acts, and no others have.

    A condition of nearly as many levels as runs, such as a date, has every group of runs.
    """
    for found in findings:
        acts = {*found.runs_affected}
        for key in dict.fromkeys(key for r in recordings for key in r.conditions):
            levels: dict[str | float | None, set[str]] = {}
            for run in recordings:
                levels.setdefault(run.conditions.get(key), set()).add(run.name)
            own = {level: runs for level, runs in levels.items() if runs & acts}
            is_exact = set().union(*own.values()) == acts and len(own) < len(levels)
            if acts and is_exact and 2 * len(levels) <= len(recordings):
                shown = " and ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in own)
                yield (
                    f"{found.balance}: the {len(acts)} runs in which {found.family} acts are"
                    f" exactly those of {key} {shown}: it may depend on that."
                )


def _loudest(equation: Equation, layout: Layout) -> tuple[str, float]:
    """Return the derivative with the most noise in an equation, and that in the target's unit."""
    sizes = {
        channel: abs(gain) * math.sqrt(np.mean([np.var(r.noise[channel]) for r in layout.runs]))
        for channel, gain in equation.channels.items()
        if origin_of(channel)[1]
    }
    return max(sizes.items(), key=lambda one: one[1], default=("", 0.0))


def _remedy(equation: Equation) -> str:
    return f"A cutoff_hz below {equation.model.low_pass.cutoff_hz:g} removes more of it."


def pauses(recordings: Sequence[Recording], causes: Iterable[Source | Function]) -> Iterator[str]:
    """Yield that time over a campaign lacks its pauses, if a cause reads it and no clock has it."""
    read = [c.variables if isinstance(c, Function) else dict(c.channels).values() for c in causes]
    is_read = any("time" in names or CAMPAIGN_TIME in names for names in read)
    if is_read and any(r.started_at_ns is None for r in recordings):
        yield (
            "The start of the runs is not known: a time over the campaign is that of the recordings"
            " one after the other, without the pauses between them."
        )


def at_bounds(models: Sequence[Model]) -> Iterator[str]:
    """Yield the parameters of each equation that are at a bound, a sentence each."""
    for model in models:
        bound = [
            f"{term.effect.id} {parameter.name}"
            for term in model.terms
            for parameter in term.parameters
            if term.is_at_bound(parameter)
        ]
        if bound:
            yield f"{model.balance}: at a bound: {', '.join(bound)}. {AT_BOUND}"


def limits(
    recordings: Sequence[Recording], layout: Layout, sealed: Sealed, read: Set[str] = frozenset()
) -> list[str]:
    """Return the limits of these runs, one sentence each; `read` are channels of the findings."""
    training = [r for r in recordings if r.name in sealed.discover]
    found = audit(training, read)
    if not sealed.may_name:
        found.append(
            f"{len(sealed.discover)} training runs: with fewer than {DEFAULT.least_to_name} no"
            " effect is named."
        )
    found += [f"Left out: {reason}" for reason in layout.left_out.values()]
    found += [
        f"The {'mean' if condition.endswith(EFFORTS) else 'highest'} {condition} is about the same"
        " in all training runs: what depends on it shows only within runs, and may be taken for"
        " what depends on something else that varies there."
        for condition in unvaried(layout.select(sealed.discover))
    ]
    return found + _noisy(layout)


def _noisy(layout: Layout) -> list[str]:
    """Return the terms that a reading's noise makes too small, one sentence each."""
    found = []
    for equation in layout.equations.values():
        for channel in equation.channels:
            share = noise_share(layout.runs, channel)
            if share > MOST_NOISE:
                sentence = noisy_sentence(channel, share, _remedy(equation))
                found.append(f"{equation.name}: {sentence}")
    return found


def rejected(candidate: Candidate, why: str, found: Collection[object]) -> str:
    """Return that a cause is not a finding; of another form of a finding, that it is a second."""
    second = "A second form of " if candidate.name in found else ""
    family, place = candidate.cause.family, candidate.cause.place.name
    if isinstance(candidate.cause, Function):
        family = f"{'an' if second else 'An'} effect of unknown form"
    return f"{second}{family} ({place}) was found in the training runs and {why}."


def unidentified(judged: Sequence[tuple[Kept, Finding]], written: Sequence[Model]) -> Iterator[str]:
    """Yield the findings that a model file could hold and does not, a sentence each."""
    for kept, f in judged:
        model = next(m for m in written if m.balance == f.balance)
        if kept.part is not None and kept.part.is_written and not written_term(kept, model):
            yield (
                f"{f.balance}: {f.form} is reported and not added to the model file; next to the"
                " declared terms not all of its amplitudes can be identified."
            )


def unwritten(candidate: Candidate) -> str:
    """Return why a cause is in no model file."""
    cause, family = candidate.cause, candidate.cause.family
    if isinstance(cause, Function):
        family, why = "an effect of unknown form", "it has no equation"
    elif candidate.acts is not None:
        why = "it acts in some of the runs only"
    elif cause.ahead:
        why = "its reading is late, and a model cannot read it earlier"
    elif not any(e.order for e in cause.place.enters if e.equation == cause.place.home):
        why = "it depends on the quantity that the model estimates, which the model cannot read"
    else:
        why = (
            "the rate of change of what it adds enters the equation, and a term of a model is not a"
            " rate of change"
        )
    return f"{cause.place.home}: {family} is reported and not added to the model file; {why}."
