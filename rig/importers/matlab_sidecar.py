"""The sidecar `<file>.mat.toml`: which variable of a MATLAB file becomes which channel."""

import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
    model_validator,
)

from estimation.channels import UnknownUnitError, unit_of
from rig.configuration.validation import explain
from rig.errors import DataError

TIME = "time_s"


def carries_unit(name: str) -> bool:
    """Whether a name ends in a unit, as a channel's must."""
    try:
        unit_of(name)
    except UnknownUnitError:
        return False
    return True


def _with_unit(name: str) -> str:
    if not carries_unit(name):
        raise ValueError("a channel's name ends in its unit, as in spindle_angle_rad")
    return name


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Mapped(_Section):
    """One channel: value = scale * variable + offset."""

    variable: str
    scale: FiniteFloat = 1.0
    offset: FiniteFloat = 0.0


class Sidecar(_Section):
    """A sidecar; its keys are shown in `rig.importers.matlab`."""

    channels: dict[Annotated[str, AfterValidator(_with_unit)], Mapped] = Field(min_length=1)
    conditions: dict[str, FiniteFloat | str] = Field(default_factory=dict)
    sample_rate_hz: FiniteFloat | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _one_clock(self) -> "Sidecar":
        if (TIME in self.channels) == (self.sample_rate_hz is not None):
            raise ValueError(f"either a channel {TIME} or sample_rate_hz is needed")
        return self


def sidecar_path(path: Path) -> Path:
    """Return where the sidecar of a MATLAB file lies."""
    return path.with_name(path.name + ".toml")


def read_sidecar(path: Path) -> Sidecar | None:
    """Read the sidecar of a MATLAB file, None where there is none.

    Raises:
        DataError: It is not valid TOML or its keys are wrong; names key and problem.
    """
    file = sidecar_path(path)
    if not file.is_file():
        return None
    try:
        return Sidecar.model_validate(tomllib.loads(file.read_text("utf-8")))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{file} is not valid TOML: {error}.") from error
    except ValidationError as error:
        known = [*Sidecar.model_fields, *Mapped.model_fields]
        raise DataError(
            f"{file} does not map variables to channels: {explain(error, known)}",
            "Expected [channels.<name with unit>] tables of `variable` and, if needed, `scale` and "
            "`offset`; either a channel time_s or a sample_rate_hz; [conditions] if needed.",
            "See rig/importers/README.md for an example.",
        ) from error
