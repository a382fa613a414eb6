"""A comparison of two campaigns in sentences and tables."""

from collections.abc import Iterator, Mapping

from estimation.changes.difference import Change, Difference
from rig.output.table import TextTable
from rig.reports.diagnosis_words import confidence, in_unit, label, plain_unit, variables_of, wave

PLAIN = {"came": "new effect", "went": "effect that is gone", "moved": "changed parameter"}
"""How something changed, as in the JSON, to the words of a sentence."""


def lines(found: Difference) -> Iterator[str]:
    """Yield what changed, a sentence each, and the limits of the answer."""
    if not found.changes:
        runs = " and ".join(str(len(names)) for names in found.runs.values())
        yield f"No change beyond the differences between runs, {runs} of them."
    for change in found.changes:
        yield _sentence(change)
    yield from found.notes


def _sentence(change: Change) -> str:
    sure, how, set_of = f"confidence {confidence(change.confidence)}", change.how, ""
    if change.alternatives:  # without any, no change has the rest of the confidence
        names = ", ".join([change.name, *change.alternatives])
        set_of = f"One of these changed, not distinguishable on these runs: {names}. "
    if change.verdict == "one_of":
        how = f"most likely {how}"
    sizes = [_size(change, name) for name in change.parameters]
    for name, value in _shape(change).items():
        shown = {name: in_unit(value, plain_unit(change.unit[name]))}
        repeats = wave(value, change.depends_on) if name == "order" else shown
        sizes += [f"{name} {text}".strip() for name, text in repeats.items()]
    if change.verdict == "depends_on":
        sizes.append(f"of unknown form; it depends on {variables_of(change)}")
    form = f" ({change.form})" if change.form not in ("", change.family) else ""
    for word, plain in PLAIN.items():
        how = how.replace(word, plain)
    return f"{set_of}{how.capitalize()}: {change.name}{form}, {', '.join(sizes)} ({sure})."


def _shape(change: Change) -> Mapping[str, float]:
    """Return the shape of an effect, without which its amplitudes state little."""
    return {} if change.how == "moved" else change.shape


def _size(change: Change, name: str) -> str:
    value, before = change.parameters[name], change.before[name]
    unit = plain_unit(change.unit[name])
    low, high = change.ci95[name]
    named = label(change.form or change.family, name)
    text = f"{named} {value:+.4g} {unit} ({low:+.4g} to {high:+.4g})".replace(" 1 (", " (")
    return text if before is None else f"{text} from {before:.4g}"


def change_table(found: Difference) -> TextTable:
    """Return the changes as a table."""
    rows = []
    for change in found.changes:
        for name, value in change.parameters.items():
            low, high = change.ci95[name]
            known, interval = change.before[name], f"{low:+.4g} to {high:+.4g}"
            before = "-" if known is None else f"{known:.4g}"
            named = label(change.form or change.family, name)
            unit = plain_unit(change.unit[name])
            rows.append((change.name, named, before, f"{value:+.4g}", interval, unit))
        if change.verdict == "depends_on":
            rows.append((change.name, f"depends on {variables_of(change)}", "-", "-", "-", "-"))
        rows += [
            (change.name, name, "-", f"{value:.4g}", "", plain_unit(change.unit[name]))
            for name, value in _shape(change).items()
        ]
    heads = ("change", "parameter", "in A", "A to B", "95 %", "unit")
    return TextTable("What changed", heads, rows)


def prediction_table(found: Difference) -> TextTable:
    """Return the errors on the third campaign as a table."""
    rows = [
        (name, *(f"{v:.4g}" for v in (p.with_a, p.with_b, p.as_a, p.as_b)), p.unit)
        for name, p in found.predicted.items()
    ]
    heads = ("equation", "fitted on A", "fitted on B", "both, unchanged", "both, changed", "unit")
    return TextTable("Error on the third campaign, within runs", heads, rows)
