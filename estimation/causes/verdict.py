"""From the search's hypotheses to a diagnosis: names with probabilities, and errors on test runs.

The test runs take no part in the search. They are opened once, when every hypothesis is fixed.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from estimation.causes import remarks
from estimation.causes.acting import Moved
from estimation.causes.addition import Addition
from estimation.causes.angles import signals_of
from estimation.causes.apart import Apart, wrong_runs
from estimation.causes.candidates import Candidate
from estimation.causes.findings import (
    Kept,
    family_probabilities,
    named,
    parameters_of,
    unpredicted,
)
from estimation.causes.held_out import HeldOut
from estimation.causes.instruments import add_instruments
from estimation.causes.layout import Layout, lay_out, prepared
from estimation.causes.levels import with_levels
from estimation.causes.numbers import DEFAULT, Numbers
from estimation.causes.refits import Refits
from estimation.causes.run_errors import that_falls
from estimation.causes.scoring import DIGITS, probabilities
from estimation.causes.search import Found, search
from estimation.causes.unsteady import unsteady
from estimation.diagnosis.result import Diagnosis, Finding
from estimation.diagnosis.split import Sealed, claim
from estimation.model import Model, parameter_keys
from estimation.recording import Recording

LEAST_SHARE = 0.001
"""Probability from which a family is held against the test runs."""


@dataclass(frozen=True)
class Answer:
    """A diagnosis with what a report, a model file and the next experiment need.

    These are the equations on all runs, the search on the training runs, the cause of each finding,
    the equations refitted before and after, and the models with the causes that a file can hold.
    """

    diagnosis: Diagnosis
    layout: Layout
    found: Found
    kept: tuple[Kept, ...]
    refits: Refits
    models: tuple[Model, ...]


def diagnose(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    numbers: Numbers = DEFAULT,
) -> Diagnosis:
    """Identify what the declared equations lack; see `answer`."""
    return answer(recordings, models, sealed, numbers).diagnosis


def answer(
    recordings: Sequence[Recording],
    models: Sequence[Model],
    sealed: Sealed,
    numbers: Numbers = DEFAULT,
    on_stage: Callable[[str], None] = lambda _: None,
) -> Answer:
    """Identify what declared equations lack on all runs, some of which are sealed as test runs.

    `on_stage` is called with what begins, in words.

    Raises:
        LayoutError: No equation can be laid out on these runs.
        FitError: A declared equation cannot be identified.
    """
    began = time.perf_counter()
    on_stage("fitting the declared equations")
    timed = prepared(recordings)
    layout, sealed, wrong = _without_wrong_runs(models, timed, sealed, numbers)
    kept_names = {run.name for run in layout.runs}
    timed = [r for r in timed if r.name in kept_names]
    on_stage("searching the training runs for what they lack")
    with threadpool_limits(limits=1, user_api="blas"):  # threads wait for one another
        found = search(layout.select(sealed.discover), numbers)
        on_stage("opening the held-out test runs")
        refits = Refits(layout, timed, sealed, numbers)
        held_out = HeldOut(layout, sealed, numbers, found.late)
        judged, notes = _judged(found, held_out, refits)
        written, errors = refits.models(), refits.errors()
    left = {
        name: error.after if layout.equations[name].model.run_offsets else error.with_means_after
        for name, error in errors.items()
    }
    findings = [replace(f, parameters=parameters_of(k, f, written, refits)) for k, f in judged]
    notes += remarks.unidentified(judged, written)
    if not findings and sealed.may_name and (changing := unsteady(held_out)):
        findings = [unpredicted(changing, refits)]
        left[changing.equation] = findings[0].rmse_after
        notes.append(changing.sentence)
    over_noise = remarks.over_noise(layout, left)
    explained = {name for f in findings for name in (f.balance, *f.also_in)}
    read = {name for kept, _ in judged for name in kept.scored.candidate.cause.reads}
    found_in = [(kept.scored.candidate, f.runs_affected) for kept, f in judged]
    said = [
        *remarks.apart(wrong, is_left_out=True),
        *remarks.apart(held_out.apart(found_in)),
        *filter(None, [claim(sealed)]),
        *remarks.late(found.noticed, signals_of(layout)),
        *remarks.left(layout, left, over_noise, explained),
        *remarks.far(layout, {name: refits.sizes(name) for name in layout.equations}, timed),
        *remarks.at_bounds(written),
        *remarks.of_levels(findings, timed),
        *remarks.pauses(timed, (kept.scored.candidate.cause for kept, _ in judged)),
        *remarks.limits(timed, layout, sealed, read),
        *notes,
    ]
    diagnosis = Diagnosis(
        findings=tuple(findings),
        errors=errors,
        unit={name: e.model.unit for name, e in layout.equations.items()},
        noise_floor=dict.fromkeys(layout.equations),
        over_noise=over_noise,
        moved={m.balance: _moved(layout.equations[m.balance].model, m) for m in written},
        sealed=sealed,
        undecided=dict(layout.undecided),
        notes=tuple(dict.fromkeys(said)),  # two findings of one family may have the same note
        seconds=time.perf_counter() - began,
    )
    return Answer(diagnosis, layout, found, tuple(k for k, _ in judged), refits, tuple(written))


def _without_wrong_runs(
    models: Sequence[Model], recordings: Sequence[Recording], sealed: Sealed, numbers: Numbers
) -> tuple[Layout, Sealed, list[Apart]]:
    """Return the equations on the runs of usual signs and units, their split, and the others."""
    layout, kept = _laid_out(models, recordings, sealed, numbers)
    wrong = wrong_runs(layout, kept, numbers)
    if wrong:
        names = {one.run for one in wrong}
        rest = [r for r in recordings if r.name not in names]
        layout, kept = _laid_out(models, rest, kept.without(names), numbers)
    return layout, kept, wrong


def _laid_out(
    models: Sequence[Model], recordings: Sequence[Recording], sealed: Sealed, numbers: Numbers
) -> tuple[Layout, Sealed]:
    """Return the equations on all runs that are long enough, and the split of these."""
    layout = lay_out(models, recordings, sealed.discover)
    sealed = sealed.without(layout.left_out)
    layout = with_levels(layout, sealed.discover, numbers)
    add_instruments(layout, sealed.discover)
    return layout, sealed


@dataclass(frozen=True)
class _Opened:
    """A cause that the refit has, with what it added to each equation and notes on it."""

    kept: Kept
    finding: Finding
    parts: Mapping[str, Addition]
    fall: float
    notes: Sequence[str]


def _judged(
    found: Found, held_out: HeldOut, refits: Refits
) -> tuple[list[tuple[Kept, Finding]], list[str]]:
    """Return the causes that the test runs confirm with their findings, and notes on the others."""
    confirmed, rejected = _confirmed(found, held_out)
    opened: dict[int, _Opened] = {}
    tried = [one.scored.candidate for one in confirmed]
    # each equation is refitted on its own, where a cause of several ones could stand in for another
    # one; and a smooth function could stand in for a named cause of its variables
    order = [(len(one.cause.place.equations), one.is_function) for one in tried]
    for k in sorted(range(len(confirmed)), key=order.__getitem__):
        one = _opened(confirmed[k], [o.kept for o in opened.values()], held_out, refits)
        if one is None:
            candidate = confirmed[k].scored.candidate
            rejected.append((candidate, "does not lower the error on the test runs"))
        else:
            opened[k] = one
    while opened:
        shown = {k: _shown(one, refits) for k, one in opened.items()}
        least = min(shown, key=shown.__getitem__)
        if shown[least] >= refits.numbers.least_shown:
            break
        one = opened.pop(least)
        refits.remove(one.parts)
        rejected.append((one.kept.scored.candidate, "barely lowers the error on the test runs"))
    settled = refits.settle()
    judged, notes = [], list[str]()
    for k in sorted(opened):
        one = opened[k]
        own, stated = (
            settled[id(one.parts[name])] for name in (one.finding.balance, one.finding.error_of)
        )
        judged.append((replace(one.kept, part=own, shown=stated), one.finding))
        notes += one.notes
    names = [kept.scored.candidate.name for kept, _ in judged]
    return judged, [*notes, *(remarks.rejected(one, why, names) for one, why in rejected)]


def _opened(one: Kept, kept: Sequence[Kept], held_out: HeldOut, refits: Refits) -> _Opened | None:
    """Add a cause to the equations it enters; None, and nothing added, where no error falls."""
    candidate, sealed = one.scored.candidate, refits.sealed
    acts_in, settled = held_out.acts_in([k.scored.candidate for k in kept], candidate)
    if isinstance(candidate.cause, Moved) and 2 * sum(acts_in.values()) > len(acts_in):
        acts_in = {name: not acts for name, acts in acts_in.items()}  # most runs are the usual ones
    parts, uncounted, notes = dict(refits.parts), refits.open, list[str]()
    if settled:
        candidate = held_out.begun(candidate, acts_in)
        one = replace(one, scored=replace(one.scored, candidate=candidate))
        more = refits.open | {*settled}
        counted = candidate.acts is not None or more >= {*sealed.confirm}
        if not counted:
            refits.open = more
        notes.append(
            f"{', '.join(settled)}: the training runs do not show whether"
            f" {candidate.cause.family} acts there; "
            + ("these test runs themselves do." if counted else "not counted in the errors.")
        )
    place = candidate.cause.place
    before = {name: refits.test_errors(name) for name in place.equations}
    added = refits.add(candidate, acts_in)
    after = {name: refits.test_errors(name) for name in place.equations}
    falls = {name: refits.fall(before[name], after[name], name) for name in place.equations}
    stated, least = place.home, -0.5 * math.log1p(-refits.numbers.form_floor)
    if falls[stated] < least:
        stated = max(falls, key=falls.__getitem__)
    if falls[stated] < least:
        refits.parts, refits.open = parts, uncounted
        return None
    has_means = not refits.layout.equations[stated].model.run_offsets
    old, new, has_means = that_falls(before[stated], after[stated], has_means, least)
    finding = replace(
        named(one, sealed.may_name, refits.numbers),
        error_of=stated,
        with_means=has_means,
        rmse_before=old.rmse,
        rmse_after=new.rmse,
        runs_improved=sum(new.by_run[name] < x for name, x in old.by_run.items()),
        runs_total=len(old.by_run),
        runs_affected=tuple(name for name, acts in acts_in.items() if acts),
    )
    if place.home in added and not added[place.home].is_written:
        notes.append(remarks.unwritten(candidate))
    return _Opened(one, finding, added, max(falls.values()), notes)


def _shown(one: _Opened, refits: Refits) -> float:
    """Return the largest fall of an equation's error as a share of what the search gained.

    Next to all other causes, or to those added before: another one may have the same columns. The
    search weighs an equation's bands by their noise and reads predictions; it may find what no
    measured error shows.
    """
    falls = [
        refits.fall(refits.test_errors(name, without=part), refits.test_errors(name), name)
        for name, part in one.parts.items()
    ]
    return max(one.fall, *falls) / max(one.kept.likely[0].gain, np.finfo(float).tiny)


def _confirmed(found: Found, held_out: HeldOut) -> tuple[list[Kept], list[tuple[Candidate, str]]]:
    """Return the causes with evidence on the test runs next to the others, and the rest with why.

    By all runs some effect has to be more probable than none. The one with the least evidence goes
    first: two effects may need one another.
    """
    left, rejected, numbers = list[Kept](), list[tuple[Candidate, str]](), held_out.numbers
    for ranked in found.conditional:
        likely = family_probabilities(ranked, numbers)
        left.append(Kept(likely[0].best, likely, ranked))
    while left:
        tested = [
            _tested(one, [o.scored.candidate for o in left if o is not one], held_out)
            for one in left
        ]
        least = min(range(len(left)), key=lambda k: tested[k][1])
        why = "not confirmed on the test runs"
        if tested[least][1] >= math.log(numbers.kept_evidence):
            known = [sum(p.share for p in one.likely) for one, _ in tested]
            least = min(range(len(left)), key=known.__getitem__)
            why = "is less probable than no effect, by all runs"
            if known[least] >= 0.5:
                return [one for one, _ in tested], rejected
        rejected.append((left.pop(least).scored.candidate, why))
    return [], rejected


def _tested(one: Kept, others: Sequence[Candidate], held_out: HeldOut) -> tuple[Kept, float]:
    """Return a cause with probabilities from all runs, and the log e-value of the test runs.

    The e-value is the mean over the families, by their probabilities on the training runs.
    Each of these families then has the mean gain over all runs; the test runs add no family.
    """
    known, numbers = [p for p in one.likely if p.share >= LEAST_SHARE], held_out.numbers
    count, train = len(held_out.layout.runs), len(held_out.layout.runs) - len(held_out.at)
    gains, logs = np.array([(p.gain, 0.0) for p in known]).T
    for k, p in enumerate(known):
        of_runs = held_out.gains(others, p.best.candidate)
        logs[k] = of_runs.log_ratio()
        rate = numbers.sharpness / count
        gains[k] = (train * gains[k] + of_runs.score(rate)) / count
    shares = np.array([p.share for p in known])
    total = float(np.logaddexp.reduce(np.log(shares / shares.sum()) + logs))
    prices = np.array([p.best.price.score(numbers) for p in known])
    weights = probabilities(gains - prices, gains, numbers.sharpness)
    found = sorted(
        (
            replace(p, share=round(float(w), DIGITS), gain=float(g))
            for p, w, g in zip(known, weights, gains, strict=True)
        ),
        key=lambda p: -p.share,
    )
    return replace(one, scored=found[0].best, likely=found), total


def _moved(before: Model, after: Model) -> dict[str, dict[str, float]]:
    """Return the declared parameters before and after the findings."""
    moved = {id(old): new for old, new in zip(before.terms, after.terms, strict=False)}
    return {
        key: {
            "before": term.values[p.name].value,
            "after": moved[id(term)].values[p.name].value,
        }
        for term, p, key in parameter_keys(before)
    }
