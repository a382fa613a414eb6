"""The calls of a notebook: read, declare, fit, diagnose, compare, predict, plot.

`import rig` gives all of them. Nothing is loaded before it is used. Results are dataclasses of
plain arrays; pandas and xarray are used only where asked for, and are installed apart.

    import rig

    runs = rig.read("table.csv", columns={"time_s": "t:ms", "motor_angle_rad": "q:deg"})
    (model,) = rig.declared("motor")
    fitted = rig.fit(runs, model)
    rig.plot(runs.runs[0].recording(), fitted)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation.campaign import Campaign
from estimation.changes.difference import Difference
from estimation.cross_validation import HeldOutError
from estimation.diagnosis.result import Diagnosis
from estimation.effects import Effect
from estimation.model import Model
from estimation.recording import FloatArray, Recording
from rig.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Prediction:
    """An estimate of a channel in one run, with its interval.

    Attributes:
        time_s: Shape (n,), s.
        value: The estimate, shape (n,); not a number where a channel that it needs is not.
        half_width: Half of the 95 % interval, from the error of the runs fitted on; None for a
            model that was not fitted on runs.
    """

    channel: str
    unit: str
    time_s: FloatArray
    value: FloatArray
    half_width: float | None

    @property
    def low(self) -> FloatArray:
        """Lower end of the 95 % interval, shape (n,); not a number without one."""
        return self.value - (np.nan if self.half_width is None else self.half_width)

    @property
    def high(self) -> FloatArray:
        """Upper end of the 95 % interval, shape (n,); not a number without one."""
        return self.value + (np.nan if self.half_width is None else self.half_width)


def read(
    path: Path | str,
    machine: Path | str | None = None,
    *,
    columns: Mapping[str, Any] | None = None,
    runs: Mapping[str, Any] | None = None,
    rate_hz: float | None = None,
    format_name: str | None = None,
) -> Campaign:
    """Read recordings: logs and formats that are known, or any table by a mapping.

    Args:
        path: File, folder or archive.
        machine: Machine file whose `[data]` maps a table, or the name of a shipped one.
        columns: Channel to `COLUMN:UNIT`, as in `[data.columns]`; makes `path` a table.
        runs: Where runs of a table begin, as in `[data.runs]`.
        rate_hz: Sample rate of a table where no column holds the time.
        format_name: Importer of a known format; detected if none.

    Raises:
        UsageError: The path is not there, or the mapping is wrong.
        NoPlantError: No such machine.
        DataError: A file is damaged or not what the mapping states.
    """
    from rig.importers.registry import open_campaign
    from rig.importers.table.mapping import read_mapping
    from rig.importers.table.open import open_table
    from rig.machines.recordings import with_positions
    from rig.machines.shipped import place_of, read_machine

    if machine is None and columns is None and runs is None and rate_hz is None:
        return open_campaign(Path(path), format_name)
    flags: list[tuple[tuple[str, ...], Any, str]] = [
        ((part, name), value, f"{part}[{name!r}]")
        for part, entries in (("columns", columns or {}), ("runs", runs or {}))
        for name, value in entries.items()
    ]
    if rate_hz is not None:
        flags.append((("sample_rate_hz",), rate_hz, "rate_hz"))
    file = place_of(Path(machine)) if machine else None
    campaign = open_table(Path(path), read_mapping(file, flags))
    return with_positions(campaign, read_machine(file)) if file else campaign


def save(campaign: Campaign, folder: Path | str) -> list[Path]:
    """Write every run as a log, which all commands and `read` open; return the files.

    Raises:
        LogExistsError: There is a log of that name already.
    """
    from rig.log.convert import write_recording

    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    return [write_recording(target / f"{run.name}.mcap", run) for run in campaign]


def simulate(
    protocol: str = "quick", hide: Mapping[str, float] | None = None, seed: int = 0
) -> Campaign:
    """Simulate a campaign of the reference rig, and hold it in memory.

    Args:
        protocol: Protocol file or the name of a shipped one.
        hide: Hidden effect to its scale, 1 for its usual size, such as `{"motor_ripple": 1.0}`.
        seed: Seed of the sensors' noise.

    Raises:
        UsageError: No such protocol or effect.
    """
    from rig.simulation.campaign import simulate_reference_campaign
    from rig.simulation.hidden import HiddenEffect

    hidden = tuple(HiddenEffect(name, scale) for name, scale in (hide or {}).items())
    return Campaign.of(simulate_reference_campaign(seed, protocol, hidden))


def declared(name: Path | str | None = None, *, machine: Path | str | None = None) -> list[Model]:
    """Return declared models: of a model file, of a machine, or of the reference rig if neither.

    Args:
        name: A model file, or the name of a shipped model such as `motor`.
        machine: A machine file, or the name of a shipped machine; its equations are declared.

    Raises:
        ModelFileError: No such file or model, or it is wrong.
        PlantFileError: No such machine, or its file is wrong.
        UsageError: The machine's sensors allow no equation.
    """
    from estimation import model_file
    from rig.machines.shipped import equations_of

    if name is not None:
        return model_file.read_all(Path(name))
    if machine is None:
        return list(model_file.reference_rig())
    return equations_of(Path(machine))


def effects() -> dict[str, Effect]:
    """Return the catalogue of physical effects by id."""
    from estimation.effects import catalogue

    return dict(catalogue())


def fit(campaign: Campaign, model: Model, seed: int = 0) -> Model:
    """Fit a declared model on all runs that count, with intervals over runs.

    Raises:
        FitError: A parameter is not identifiable from these runs.
        MissingChannelError: A run lacks a channel.
    """
    from estimation.fitting import fit as fit_model

    return fit_model(model, campaign, seed=seed)


def held_out(campaign: Campaign, model: Model, folds: int = 5, seed: int = 0) -> HeldOutError:
    """Return the error of a declared model on runs it was not fitted on.

    Raises:
        CampaignError: Fewer than two runs.
        FitError: A parameter is not identifiable from a fold's runs.
    """
    from estimation.cross_validation import held_out_error

    return held_out_error(model, campaign, min(folds, len(campaign.evidence)), seed)


def diagnose(
    campaign: Campaign, models: Sequence[Model], seed: int = 0, ledger: Path | None = None
) -> Diagnosis:
    """Identify what declared models lack, and test it on runs that took no part in the search.

    The runs are entered in the access log as by `rig diagnose`, and the result is `exploratory`
    where a test run was used before. No next experiment is proposed.

    Args:
        campaign: Seven runs or more to name an effect; fewer are cut into parts.
        models: Declared models, one an equation.
        seed: Seed of the choice of test runs.
        ledger: The access log; the one of `rig diagnose` if none.

    Raises:
        SplitError: Too few runs, or runs of several machines.
        LayoutError: No equation can be written with these channels.
        LedgerError: The access log cannot be read or written.
    """
    from rig.diagnosis.ledger import Ledger, default_ledger
    from rig.diagnosis.run import run_diagnosis
    from rig.diagnosis.subject import Subject

    looks = Ledger(ledger or default_ledger())
    done, look = run_diagnosis(Subject(campaign, models), looks, seed=seed, quick=True)
    looks.enter(look)
    return done.diagnosis


def compare(
    a: Campaign, b: Campaign, models: Sequence[Model], on: Campaign | None = None, seed: int = 0
) -> Difference:
    """Find what changed from one campaign of a machine to another.

    Args:
        a: First campaign, four runs or more.
        b: Second campaign, four runs or more.
        models: Declared models, one an equation.
        on: A third campaign to predict, or None.
        seed: Seed of the random choices of runs.

    Raises:
        ChangesError: Too few runs.
    """
    from estimation.changes.compare import compare as changes

    return changes(a.evidence, b.evidence, models, () if on is None else on.evidence, seed)


def predict(model: Model, recording: Recording) -> Prediction:
    """Estimate the target of a fitted model in one run, with its 95 % interval.

    Raises:
        NotFittedError: A parameter has no value.
        MissingChannelError: The run lacks a channel.
    """
    from estimation.model import predict as estimate

    evidence = model.evidence
    half_width = None if evidence is None else 2.0 * evidence.rmse_with_means
    value = estimate(model, recording)
    return Prediction(model.target, model.unit, recording.time_s, value, half_width)


def plot(
    recording: Recording, model: Model | None = None, channels: Sequence[str] | None = None
) -> "Figure":
    """Draw channels of a run over time, and what a fitted model predicts for its target.

    Args:
        recording: The run.
        model: A fitted model, or None.
        channels: Channels to draw; the model's target, or all without a model.

    Raises:
        MissingChannelError: The run lacks a channel.
    """
    from matplotlib.figure import Figure

    names = list(channels or ([model.target] if model else recording.columns))
    figure = Figure(figsize=(8.0, 2.2 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axis, name in zip(axes, names, strict=True):
        axis.plot(recording.time_s, recording[name], linewidth=0.8, label="measured")
        if model is not None and name == model.target:
            found = predict(model, recording)
            (line,) = axis.plot(found.time_s, found.value, linewidth=1.2, label=model.name)
            if found.half_width is not None:
                axis.fill_between(
                    found.time_s, found.low, found.high, color=line.get_color(), alpha=0.2
                )
            axis.legend(loc="upper right")
        axis.set_ylabel(name)
    axes[-1].set_xlabel("time_s")
    return figure


def to_pandas(campaign: Campaign) -> Any:
    """Return all runs that count as one pandas table, a row a sample, with run and conditions.

    Columns are those of `rig log export`; `attrs["units"]` has their units.

    Raises:
        MissingExtraError: pandas is not installed.
    """
    pd = _library("pandas")
    from estimation.channels import unit_of

    runs = list(campaign.evidence)
    table = pd.concat([pd.DataFrame(_columns(run)) for run in runs], ignore_index=True)
    channels = {"time_s"}.union(*(run.columns for run in runs))
    table.attrs["units"] = {name: unit_of(name) for name in table.columns if name in channels}
    return table


def to_polars(campaign: Campaign) -> Any:
    """Return all runs that count as one Polars table, a row a sample, with run and conditions.

    Columns are those of `rig log export`.

    Raises:
        MissingExtraError: Polars is not installed.
    """
    pl = _library("polars")
    return pl.concat([pl.DataFrame(_columns(run)) for run in campaign.evidence], how="diagonal")


def _columns(recording: Recording) -> dict[str, Any]:
    """Return the columns of a run's table; run and conditions are one value each."""
    from rig.importers.tidy import CONDITION, RUN, TIME

    conditions = {f"{CONDITION}{name}": value for name, value in recording.conditions.items()}
    samples = {name: np.asarray(values) for name, values in recording.columns.items()}
    return {RUN: recording.name, **conditions, TIME: np.asarray(recording.time_s), **samples}


def to_xarray(recording: Recording) -> Any:
    """Return a run as an xarray data set over `time_s`, units and conditions as attributes.

    Raises:
        MissingExtraError: xarray is not installed.
    """
    xr = _library("xarray")
    from estimation.channels import unit_of

    columns = {
        name: ("time_s", np.asarray(values), {"units": unit_of(name)})
        for name, values in recording.columns.items()
    }
    return xr.Dataset(columns, {"time_s": recording.time_s}, {**recording.conditions})


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        why = "The result is one of its."
        raise MissingExtraError(f"{name} is not installed.", why, "tables") from error
