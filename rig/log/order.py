"""The order of files and variables by their names."""

import re


def by_number(name: str) -> list[tuple[int, str]]:
    """Return the key that sorts names with the numbers in them by value: run 2 before run 10."""
    parts = re.split(r"(\d+)", name)
    return [(int(part) if k % 2 else 0, part) for k, part in enumerate(parts)]
