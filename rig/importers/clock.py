"""Runs whose clock is probably in another unit than stated, as questions in words."""

from collections.abc import Iterator, Sequence

from estimation.recording import Recording

FASTEST_HZ, SLOWEST_HZ = 1e5, 2.0
"""Sample rates beyond which no recorder of a driven machine is: sound cards are below the one, and
below the other a motion is not seen."""

SHORTEST_S, LONGEST_S = 1.0, 3600.0
"""Length of a run that is plausible, where its rate is not."""

TAKEN = {
    1e3: "is s taken for ms, or ms for us",
    1e6: "is s taken for us",
    60.0: "is min taken for s",
    1e-3: "is ms taken for s, or us for ms",
    1e-6: "is us taken for s",
    1 / 60.0: "is s taken for min",
}
"""Factor that a time is to be multiplied with, and the question about its unit."""


def implausible_clocks(recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield which runs are so short and fast, or so long and slow, that their time's unit is wrong.

    The unit is the first one with which rate and length are plausible.
    """
    runs: dict[str, list[Recording]] = {}
    for run in recordings:
        if len(run) > 2 and (taken := _taken(run)):
            runs.setdefault(taken, []).append(run)
    for taken, places in runs.items():
        names = ", ".join(run.name for run in places)
        where = "every run" if len(places) == len(recordings) else names
        first = places[0]
        yield (
            f"time_s: {first.sample_rate_hz:.4g} samples a second over {first.duration_s:.3g} s in"
            f" {where}; {taken}? Correct UNIT in time_s = 'COLUMN:UNIT', or the rate that is"
            " stated."
        )


def _taken(run: Recording) -> str:
    """Return the question about the unit of a run's time; nothing where the clock is plausible."""
    rate_hz, length_s = run.sample_rate_hz, run.duration_s
    is_fast = rate_hz > FASTEST_HZ and length_s < SHORTEST_S
    is_slow = rate_hz < SLOWEST_HZ and length_s > LONGEST_S
    for factor, taken in TAKEN.items() if is_fast or is_slow else ():
        if SLOWEST_HZ < rate_hz / factor < FASTEST_HZ and factor * length_s < LONGEST_S:
            return taken
    return ""
