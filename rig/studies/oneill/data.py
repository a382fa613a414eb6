"""Data of the study of O'Neill et al. 2018: its campaigns, their closing samples, what is held out.

Closing samples and the processing before them: section II.C of the paper.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation.campaign import Campaign, in_folds
from estimation.closing import closing_samples, is_closing, processed
from estimation.live_channels import causal_channels
from estimation.recording import FloatArray
from rig.errors import DataError
from rig.importers.registry import open_campaign
from rig.studies.oneill.paper import CONDITIONS, FOLDS, INSTRUMENT, TEST_SHARE

CAUSAL = "causal "
"""Prefix of a column that is filtered as live; the others are filtered without lag."""

POSE_FREQUENCY_HZ = 0.3
"""The paper's experiment 3 holds one frequency; the pitch folders hold a second one."""


@dataclass(frozen=True)
class Source:
    """Data for the study."""

    campaign: Campaign
    name: str
    measured: bool  # whether it was measured on the paper's instrument
    notes: tuple[str, ...] = ()


def open_reference(path: Path) -> Source:
    """Open the paper's part of the measured data, by the folder or archive of Tool_4_Maryland_L_4.

    It may be among others in a folder or archive; any other recordings are taken as they are.

    Raises:
        UsageError: There is nothing at the path.
        DataError: Nothing there can be read.
    """
    place = part_of(path, INSTRUMENT)
    notes = [f"{path.name} holds several parts; {place.name} was taken."] if place != path else []
    campaign = open_campaign(place)
    own = [name for name in campaign.names if f"{INSTRUMENT}/" in name]
    if own and len(own) < len(campaign):
        notes.append(f"{len(own)} of {len(campaign)} runs are of {INSTRUMENT} and were taken.")
        campaign = campaign.select(own)
    measured = bool(own) or INSTRUMENT in place.name
    if not measured:
        notes.append(f"Not the paper's instrument ({INSTRUMENT}): its numbers do not apply.")
    return Source(campaign, place.name, measured, tuple(notes))


def simulated_reference(seed: int) -> Source:
    """Simulate the paper's campaign."""
    from rig.simulation.campaign import simulate_reference_campaign

    name = f"simulated reference campaign, seed {seed}"
    return Source(simulate_reference_campaign(seed), name, measured=False)


def part_of(path: Path, instrument: str) -> Path:
    """Return the folder or archive of an instrument below a path, or the path itself."""
    if path.is_file() or path.name == instrument:
        return path
    parts = sorted(
        (p for p in path.rglob(f"*{instrument}*") if p.name.split(".")[0].endswith(instrument)),
        key=lambda p: (p.is_file(), len(p.parts), p),
    )
    return parts[0] if parts else path


def pose_runs(folder: Path | None, pose: str) -> Campaign | None:
    """Return the runs of the five folders of a pose at the paper's frequency, if all are there.

    The folder may hold the folders or archives of experiment 3, or be next to them; the pose is
    `pitch` or `roll`.

    Raises:
        DataError: A run is damaged.
    """
    if folder is None or not folder.is_dir():
        return None
    found: dict[str, Path] = {}
    for place in (folder, folder.parent):
        for path in sorted(place.glob(f"*{pose.title()}_[1-5]*")):
            found.setdefault(path.name.split(".")[0].removeprefix("mrdlab-"), path)
    if len(found) != 5:
        return None
    return Campaign.of(
        replace(recording, name=f"{name}/{recording.name}")
        for name, path in sorted(found.items())
        for recording in open_campaign(path)
        if np.isclose(float(recording.conditions["frequency_hz"]), POSE_FREQUENCY_HZ)
    )


@dataclass(frozen=True)
class ClosingTable:
    """Closing samples of many runs."""

    # names of the columns: channels, conditions, and channels after `CAUSAL`
    columns: tuple[str, ...]
    values: FloatArray  # shape (n, columns)
    run: NDArray[np.intp]  # index of each sample's run, shape (n,)
    names: tuple[str, ...] = ()
    # condition to the value of each run, shape (runs,); NaN where it is not stated
    conditions: Mapping[str, FloatArray] = field(default_factory=dict)
    excluded: Mapping[str, str] = field(default_factory=dict)
    # other runs of which a closing sample is flagged, with the reason
    flagged: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, names: Iterable[str]) -> FloatArray:
        """Return some of the columns, shape (n, names)."""
        return self.values[:, [self.columns.index(name) for name in names]]

    def column(self, name: str) -> FloatArray:
        """Return one of the columns, shape (n,)."""
        return self[[name]][:, 0]

    def without(self, names: Iterable[str]) -> "ClosingTable":
        """Return the table without some runs."""
        runs = np.flatnonzero(~np.isin(self.names, list(names)))
        kept = np.isin(self.run, runs)
        return replace(
            self,
            values=self.values[kept],
            run=np.searchsorted(runs, self.run[kept]),
            names=tuple(self.names[k] for k in runs),
            conditions={name: values[runs] for name, values in self.conditions.items()},
        )

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


def closing_table(
    campaign: Campaign,
    channels: Iterable[str],
    conditions: Iterable[str] = (),
    on_run: Callable[[str], None] = lambda name: None,
    live: bool = True,
) -> ClosingTable:
    """Reduce a campaign to its closing samples, flagged ones too, as the paper does.

    Raw runs are read one at a time, excluded ones too; `on_run` is called with each one's name when
    it has been processed. Conditions of the runs become columns; `live` adds each channel as
    filtered live.

    Raises:
        DataError: A run lacks a condition, or nothing is left.
        MissingChannelError: A run lacks a channel.
    """
    names, stated = tuple(channels), tuple(conditions)
    parts: list[FloatArray] = []
    runs: list[str] = []
    known: dict[str, list[float]] = {name: [] for name in CONDITIONS.values()}
    excluded, flagged = {}, {}
    for recording in campaign:
        run = processed(recording, names)
        kept = is_closing(run)
        missing = [name for name in stated if name not in recording.conditions]
        if missing:
            raise DataError(f"Run {recording.name} does not state its {', '.join(missing)}.")
        columns = [run[n][kept] for n in names]
        columns += [np.full(int(kept.sum()), float(recording.conditions[n])) for n in stated]
        if live:
            causal = causal_channels(recording, names)
            columns += [causal[n][kept] for n in names]
        parts.append(np.column_stack(columns))
        runs.append(recording.name)
        for name, values in known.items():
            values.append(float(recording.conditions.get(name, np.nan)))
        closing = closing_samples(run)
        if recording.excluded is not None:
            excluded[run.name] = recording.excluded
        elif not closing.valid.all():
            seen = [s.reason for s in run.stretches if np.any(closing.flags & np.uint8(s.flag))]
            flagged[run.name] = "; ".join(seen) or "flagged samples"
        on_run(recording.name)
    lengths = [len(part) for part in parts]
    if sum(lengths) == 0:
        raise DataError("No run has a closing sample.", "The spindle never closes fast enough.")
    return ClosingTable(
        (*names, *stated, *(CAUSAL + name for name in names if live)),
        np.concatenate(parts),
        np.repeat(np.arange(len(parts)), lengths),
        tuple(runs),
        {name: np.array(values) for name, values in known.items()},
        excluded,
        flagged,
    )


def held_out_runs(
    conditions: Mapping[str, FloatArray], protocol: str, seed: int
) -> list[NDArray[np.intp]]:
    """Return the places of the runs that each split holds out; empty when it cannot be made.

    The protocol is `run-wise`, by a seed as of `Campaign.folds`, `lofo` or `lopo`.
    """
    if protocol == "run-wise":
        runs = len(next(iter(conditions.values())))
        return in_folds(runs, min(FOLDS, runs), seed) if runs > 1 else []
    values = conditions[CONDITIONS[protocol]]
    levels = np.unique(values)
    if len(levels) < 2 or not np.isfinite(values).all():
        return []
    return [np.flatnonzero(values == level) for level in levels]


def held_out_masks(table: ClosingTable, protocol: str, seed: int) -> list[NDArray[np.bool_]]:
    """Return which samples each split of `random`, or of `held_out_runs`, tests on.

    Empty when it cannot be made.
    """
    if protocol == "random":
        mask = np.zeros(len(table.run), bool)
        order = np.random.default_rng(seed).permutation(len(mask))
        mask[order[: round(TEST_SHARE * len(mask))]] = True
        return [mask]
    return [np.isin(table.run, part) for part in held_out_runs(table.conditions, protocol, seed)]
