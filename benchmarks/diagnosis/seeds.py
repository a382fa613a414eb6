"""Which seeds are for what, so that no version is judged on cases that shaped it.

A measurement takes a block of seeds and is named by the first of them.
"""

from collections.abc import Collection

BLOCK = 1000

USES = {
    "calibrate": range(0, 1_000_000),
    "develop": range(1_000_000, 2_000_000),
    "judge": range(2_000_000, 3_000_000),
}
"""`calibrate`: to choose numbers by a command (those below a thousand were also looked at while the
first rules were written). `develop`: to look at. `judge`: once; who has seen an answer about a case
of such a seed must not judge a version that was changed afterwards with it."""


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
    """Return the first judging block that no line of the results page has."""
    blocks = {seed // BLOCK for seed in spent}
    return next(seed for seed in USES["judge"][::BLOCK] if seed // BLOCK not in blocks)
