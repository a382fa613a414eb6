"""Which seeds are for what: a case that a number was chosen on never judges it.

A seed of the judging range is used once: the results page that used it names it.
"""

from rig.errors import UsageError

CALIBRATE = range(0, 1_000_000)
"""Seeds of the cases that the numbers of the diagnosis are calibrated on."""

DEVELOP = range(1_000_000, 2_000_000)
"""Seeds of the cases that people read while they work on it."""

JUDGE = range(2_000_000, 3_000_000)
"""Seeds of the cases that its figures are reported on."""

RANGES = {"calibrate": CALIBRATE, "develop": DEVELOP, "judge": JUDGE}


def part_of(seed: int) -> str:
    """Return the range a seed belongs to: `calibrate`, `develop` or `judge`.

    Raises:
        UsageError: It belongs to none.
    """
    for name, seeds in RANGES.items():
        if seed in seeds:
            return name
    raise UsageError(
        f"Seed {seed} belongs to no range of cases.",
        ", ".join(f"{name}: {r.start} to {r.stop - 1}" for name, r in RANGES.items()) + ".",
    )
