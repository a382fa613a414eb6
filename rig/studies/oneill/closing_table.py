"""The closing samples of a campaign as one table, for studies that train many networks on it."""

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign, in_folds
from estimation.closing import is_closing, processed
from estimation.live_channels import causal_channels
from estimation.recording import FloatArray
from rig.errors import DataError
from rig.studies.oneill import fits

CAUSAL = "causal "
"""Prefix of a column that is filtered as live; the others are filtered without lag."""


@dataclass(frozen=True)
class ClosingTable:
    """Closing samples of many runs.

    Attributes:
        columns: Names of the columns: channels, conditions, and channels after `CAUSAL`.
        values: Shape (n, columns); may be a file mapped into memory.
        run: Index of each sample's run, shape (n,).
        conditions: Condition to the value of each run, shape (runs,).
    """

    columns: tuple[str, ...]
    values: FloatArray
    run: NDArray[np.intp]
    conditions: dict[str, FloatArray]

    def __getitem__(self, names: Iterable[str]) -> FloatArray:
        """Return some of the columns, shape (n, names)."""
        return self.values[:, [self.columns.index(name) for name in names]]

    def digest(self, names: Iterable[str]) -> str:
        """Hash of some of the columns, and of which run each sample is of."""
        content = hashlib.sha256(self.run.tobytes())
        for name in names:
            content.update(name.encode() + self._hashes[name])
        return content.hexdigest()[:16]

    @cached_property
    def _hashes(self) -> dict[str, bytes]:
        return {
            name: hashlib.sha256(np.ascontiguousarray(values).tobytes()).digest()
            for name, values in zip(self.columns, self.values.T, strict=True)
        }

    def save(self, path: Path) -> None:
        """Write the table next to `path`, the values so that they can be mapped into memory."""
        path.parent.mkdir(parents=True, exist_ok=True)
        for suffix, values in ((".npy", self.values), (".run.npy", self.run)):
            part = path.with_name(f".{path.name}{suffix}")
            np.save(part, values, allow_pickle=False)
            part.replace(path.with_name(path.name + suffix))


def closing_table(
    campaign: Campaign,
    channels: Iterable[str],
    conditions: Iterable[str] = (),
    on_run: Callable[[str], None] = lambda name: None,
) -> ClosingTable:
    """Reduce a campaign to its closing samples, flagged ones too, as the paper does.

    Args:
        campaign: Raw runs; excluded ones are left out.
        channels: Channels, measured or derived; each is given without lag and as live.
        conditions: Conditions of the runs that become columns.
        on_run: Called with each run's name when it has been processed.

    Raises:
        DataError: A run lacks a condition, or nothing is left.
        MissingChannelError: A run lacks a channel.
    """
    names, stated = tuple(channels), tuple(conditions)
    parts, runs = [], []
    known: dict[str, list[float]] = {"frequency_hz": [], "load_command_a": []}
    for index, recording in enumerate(campaign.evidence):
        zero_phase = processed(recording, names)
        causal = causal_channels(recording, names)
        kept = is_closing(zero_phase)
        missing = [name for name in stated if name not in recording.conditions]
        if missing:
            raise DataError(f"Run {recording.name} does not state its {', '.join(missing)}.")
        columns = [zero_phase[n][kept] for n in names]
        columns += [np.full(int(kept.sum()), float(recording.conditions[n])) for n in stated]
        columns += [causal[n][kept] for n in names]
        parts.append(np.column_stack(columns))
        runs.append(np.full(len(parts[-1]), index, dtype=np.intp))
        for name, values in known.items():
            values.append(float(recording.conditions.get(name, np.nan)))
        on_run(recording.name)
    if sum(map(len, parts)) == 0:
        raise DataError("No run has a closing sample.", "The spindle never closes fast enough.")
    return ClosingTable(
        (*names, *stated, *(CAUSAL + name for name in names)),
        np.concatenate(parts),
        np.concatenate(runs),
        {name: np.array(values) for name, values in known.items()},
    )


def mapped(path: Path, columns: tuple[str, ...]) -> ClosingTable:
    """Open a saved table without reading it; its conditions are not kept."""
    values = np.load(path.with_name(path.name + ".npy"), mmap_mode="r", allow_pickle=False)
    run = np.load(path.with_name(path.name + ".run.npy"), allow_pickle=False)
    return ClosingTable(columns, values, run, {})


def held_out_masks(table: ClosingTable, protocol: str, folds: int, seed: int) -> list[np.ndarray]:
    """Return which samples each split of a protocol tests on; empty when it cannot be made.

    Args:
        table: The samples.
        protocol: `random`, `run-wise`, `lofo` or `lopo`.
        folds: Folds of `run-wise`.
        seed: Seed of `random` and `run-wise`, as of `Campaign.folds`.
    """
    if protocol == "random":
        mask = np.zeros(len(table.run), bool)
        order = np.random.default_rng(seed).permutation(len(mask))
        mask[order[: round(fits.TEST_SHARE * len(mask))]] = True
        return [mask]
    if protocol == "run-wise":
        runs = int(table.run.max()) + 1
        parts = in_folds(runs, min(folds, runs), seed) if runs > 1 else []
        return [np.isin(table.run, part) for part in parts]
    condition = table.conditions[{"lofo": "frequency_hz", "lopo": "load_command_a"}[protocol]]
    levels = np.unique(condition)
    if len(levels) < 2 or not np.isfinite(condition).all():
        return []
    return [(condition == level)[table.run] for level in levels]
