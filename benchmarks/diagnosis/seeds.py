"""Which seeds are for what, so that no version is judged on cases that shaped it."""

from collections.abc import Collection

USES = {
    "spent": range(0, 1000),
    "calibrate": range(1000, 2000),
    "develop": range(2000, 3000),
    "judge": range(3000, 4000),
}
"""`spent`: looked at while the rules of the first versions were written. `calibrate`: to choose
numbers by a command. `develop`: to look at. `judge`: once; who has seen an answer about a case of
such a seed must not judge a version that was changed afterwards with it."""


def use_of(seed: int) -> str:
    """Return what a seed is for.

    Raises:
        ValueError: It is for nothing.
    """
    for use, seeds in USES.items():
        if seed in seeds:
            return use
    raise ValueError(f"Seed {seed} is for nothing: the last one is {USES['judge'][-1]}.")


def next_to_judge(spent: Collection[int]) -> int:
    """Return the first judging seed that no line of the results page has."""
    return next(seed for seed in USES["judge"] if seed not in spent)
