"""`[data]` of a machine's file: which column of a table becomes which channel, and what runs are.

    [data]
    files = "*.csv"
    [data.columns]
    time_s = "t:ms"
    motor_angle_rad = "encoder:rev/4096"
    motor_current_a = { column = "adc", unit = "A", gain = 0.00488, zero = 512 }
    [data.conditions]
    load_mass_kg = "load:g"
    [data.runs]
    gap_s = 0.5

Every other table of that file is of the machine itself and is not read here.
"""

from contextlib import suppress
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat

from rig.importers.table.units import NotAUnitError, read_unit

TIME = "time_s"
DATE = "iso8601"
"""Unit of a time column that holds dates."""

Positive = Annotated[FiniteFloat, Field(gt=0)]


class Section(BaseModel):
    """A table of the file: no other key than those listed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _short(value: Any) -> Any:
    """Return `COLUMN:UNIT` as a table; what follows the last colon counts if it is a unit."""
    if isinstance(value, int) and not isinstance(value, bool):
        return {"column": str(value)}
    if not isinstance(value, str):
        return value
    name, colon, unit = value.rpartition(":")
    with suppress(NotAUnitError):
        if colon and (unit == DATE or read_unit(unit)):
            return {"column": name, "unit": unit}
    return {"column": value}


class Source(Section):
    """Where a channel or a condition comes from: SI value = unit * gain * (raw - zero).

    Attributes:
        column: Name of a column, of a single value of the file, of a group of `file_name`, or of a
            column of the side file; columns without a head are numbered from 1.
        unit: Unit of the values; the SI unit of the channel's name if none.
        gain: Number, or the name of a single value of the file.
        zero: Raw value that means nought.
        wraps_at: Raw range of a counter or angle that starts again at its end, or None.
        sign_bit: Raw value of a bit that is set where the reading is negative, or None: the
            registers of many servos hold sign and magnitude.
        value: Of a condition: the value itself, in place of a column.
    """

    column: Annotated[str, BeforeValidator(lambda v: str(v) if type(v) is int else v)] = ""
    unit: str = ""
    gain: FiniteFloat | str = 1.0
    zero: FiniteFloat = 0.0
    wraps_at: Positive | None = None
    sign_bit: Positive | None = None
    value: FiniteFloat | str | None = None


Short = Annotated[Source, BeforeValidator(_short)]


class Invalid(Section):
    """Samples that do not count.

    Attributes:
        when: Formula that is true for them.
        reason: Why.
        missing: Whether nothing was read: a filter then bridges them, instead of smearing values
            that are none over their neighbours.
    """

    when: str
    reason: str
    missing: bool = False


class Runs(Section):
    """Where one run ends and the next one begins; every stated rule applies.

    Attributes:
        gap_s: A pause of more than this in the time column, s.
        resets: Whether time that goes back begins a run.
        changes: Columns a new value of which begins a run.
        falls: Column that begins a run where it falls.
        mark: Column that begins a run where it turns from 0 to something else.
        at_s: Times since the start of the file, s.
        lap_s: Length of a lap, s.
        start_s: What is before this time since the start of the file is left out, s.
        tail_s: What is within this time of the end of the file is left out, s.
        least_s: Shorter parts are left out, s; half a lap if laps are cut.
    """

    gap_s: Positive | None = None
    resets: bool = False
    changes: tuple[str, ...] = ()
    falls: str = ""
    mark: str = ""
    at_s: tuple[FiniteFloat, ...] = ()
    lap_s: Positive | None = None
    start_s: FiniteFloat = 0.0
    tail_s: Annotated[FiniteFloat, Field(ge=0)] = 0.0
    least_s: Annotated[FiniteFloat, Field(ge=0)] | None = None


def _several(value: Any) -> Any:
    """Return one text as several, such as the command line states it."""
    return (value,) if isinstance(value, str) else value


class Layout(Section):
    """How a file is laid out, as far as it is stated.

    Attributes:
        files: Pattern of the files of a folder, such as `*.csv`.
        header: Whether the first line of a text table names the columns; None follows it.
        separator: Of a text table; found in the first line if none.
        decimal: Decimal sign of a text table; None follows the first numbers.
        comment: What a line to be skipped begins with.
        skip_lines: Lines before the head.
        skip_last_lines: Lines after the samples of a text table; empty ones do not count.
        missing: Texts in a cell of a text table that mean that nothing was read.
        rows: Key of a JSON object that holds the samples.
        trials: Pattern of the variables of a `.mat` or `.npz` that hold one run each.
    """

    files: str = ""
    header: bool | None = None
    separator: Annotated[str, Field(max_length=1)] = ""
    decimal: Literal[".", ","] | None = None
    comment: str = ""
    skip_lines: Annotated[int, Field(ge=0)] = 0
    skip_last_lines: Annotated[int, Field(ge=0)] = 0
    missing: Annotated[tuple[str, ...], BeforeValidator(_several)] = ()
    rows: str = ""
    trials: str = ""


class Data(Layout):
    """The table `[data]`.

    Attributes:
        sample_rate_hz: Rate of the samples where no column holds their time.
        even_rate_hz: Rate of an even clock onto which each channel is interpolated, or None.
        file_name: Regular expression of NAME or FOLDER/NAME; each named group is a single value.
        side_file: CSV next to the data with a column `file` and one for each single value.
        columns: Channel to its source.
        conditions: Condition to its source.
        formulas: Channel or condition to a formula of others, in SI units.
        invalid: Samples that do not count.
        runs: Where runs begin.
    """

    sample_rate_hz: Positive | None = None
    even_rate_hz: Positive | None = None
    file_name: str = ""
    side_file: str = ""
    columns: dict[str, Short] = Field(default_factory=dict)
    conditions: dict[str, Short] = Field(default_factory=dict)
    formulas: dict[str, str] = Field(default_factory=dict)
    invalid: tuple[Invalid, ...] = ()
    runs: Runs = Field(default_factory=Runs)
