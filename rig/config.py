"""The rig's configuration: one TOML file, every key checked, the resolved form kept in each log."""

import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from calibration.linear import CalibrationSet, load_calibration_set, shipped_calibration_set
from calibration.rules import Verdict, judge, judge_raw, refuse_errors
from calibration.store import CalibrationStore, active_lines, compose, default_folder
from estimation.recording import Instrument
from rig.errors import UsageError
from rig.validation import explain

SHIPPED = Path(__file__).parent / "configs"
SIMULATED = SHIPPED / "simulated.toml"

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LoggerSection(_Section):
    """Where the logger is found.

    Attributes:
        url: `sim://`, `usb:VID:PID:SERIAL`, `/dev/serial/by-id/...` or `socket://host:port`.
    """

    url: str


class ControllerSection(_Section):
    """Gains of the logger's position controller, in its own ticks: see `drivers.teensy.control`."""

    kp: Number
    ki: Number
    kd: Number
    velocity_filter: float = Field(gt=0, le=1)
    limit: Positive = 10000.0

    def gains(self) -> list[float]:
        """Return the gains in the order the controller takes them."""
        return [self.kp, self.ki, self.kd, self.velocity_filter, self.limit]


class LimitsSection(_Section):
    """Limits checked at every sample, on the absolute value; a crossing ends in the safe state."""

    proximal_torque_n_m: Positive
    distal_torque_n_m: Positive
    motor_current_a: Positive
    load_command_a: Positive
    spindle_angle_rad: Positive


class DriftSection(_Section):
    """Largest change of a sensor's zero over a run that passes."""

    proximal_torque_n_m: Positive
    distal_torque_n_m: Positive
    motor_current_a: Positive


class InstrumentSection(_Section):
    """Identity of the instrument on the rig."""

    model: str | None = None
    serial: str | None = None
    lot: str | None = None
    side: str | None = None
    uses: int | None = Field(default=None, ge=0)

    def identity(self) -> Instrument:
        """Return the identity as a recording keeps it."""
        return Instrument(**self.model_dump())


class SimulationSection(_Section):
    """The simulated rig behind a `sim://` logger.

    Attributes:
        seed: Seed of noise, offsets and drift.
        spread: Relative spread of the plant's parameters drawn by the seed.
        hidden: Hidden effect to strength; effects that no declared model is told of.
        draw_hidden: Seed that draws one more hidden effect, so that nobody need know which.
        firmware: Put the compiled firmware core in the loop where it is built.
    """

    seed: int = 0
    spread: float = Field(default=0.0, ge=0, lt=0.5)
    hidden: dict[str, Number] = Field(default_factory=dict)
    draw_hidden: int | None = None
    firmware: bool = True


class Config(_Section):
    """The whole configuration.

    Attributes:
        calibration: Calibration set: a TOML file, or a shipped one by name.
        calibration_store: Folder of the store whose active records go before that set's lines, or
            `default` for the store that `rig cal` uses; no store if none.
        serials: Serial numbers of the devices on the rig, held against those of the records.
    """

    name: str
    logger: LoggerSection
    controller: ControllerSection
    limits: LimitsSection
    drift: DriftSection
    instrument: InstrumentSection = InstrumentSection()
    simulation: SimulationSection = SimulationSection()
    calibration: str = "reference"
    calibration_store: str | None = None
    serials: dict[str, str] = Field(default_factory=dict)
    lever_arm_m: Positive = 0.012
    model: str | None = None

    @property
    def is_simulated(self) -> bool:
        """Whether the logger is the simulated one."""
        return self.logger.url.startswith("sim:")

    @property
    def model_path(self) -> Path | None:
        """The fitted model `rig live` estimates with: a file, or a shipped one by name."""
        if self.model is None:
            return None
        path = Path(self.model)
        return path if path.suffix == ".toml" else SHIPPED / f"{self.model}.model.toml"

    @property
    def store(self) -> CalibrationStore | None:
        """The calibration store in use, if any."""
        if self.calibration_store is None:
            return None
        named = self.calibration_store
        return CalibrationStore(default_folder() if named == "default" else Path(named))

    def calibration_set(self) -> CalibrationSet:
        """Return the calibrations in use: the set, with the store's active lines in place of its.

        Raises:
            CalibrationError: A file cannot be read, or an active record must not be used.
        """
        path = Path(self.calibration)
        is_file = path.suffix == ".toml"
        base = load_calibration_set(path) if is_file else shipped_calibration_set(self.calibration)
        if self.store is None:
            return base
        refuse_errors(self.calibration_verdicts())
        return compose(base, active_lines(self.store, self.instrument.serial).values())

    def calibration_verdicts(self) -> list[Verdict]:
        """Return what speaks against the store's active lines now; empty without a store."""
        if self.store is None:
            return []
        lines = active_lines(self.store, self.instrument.serial).values()
        now = datetime.now(UTC)
        return [v for line in lines for v in (*judge(line, now, self.serials), *judge_raw(line))]

    def changed(self, **sections: Any) -> "Config":
        """Return a configuration with some keys changed; a section is a dict of its own keys."""
        whole = self.model_dump()
        for name, change in sections.items():
            whole[name] = {**whole[name], **change} if isinstance(change, dict) else change
        return Config.model_validate(whole)


def load_config(path: Path | None = None) -> Config:
    """Read a configuration; the simulated rig's when no path is given.

    Raises:
        UsageError: The file cannot be read or a key is wrong; names the key and the nearest one.
    """
    path = path or SIMULATED
    try:
        return Config.model_validate(tomllib.loads(path.read_text()))
    except OSError as error:
        raise UsageError(f"The configuration {path} cannot be read.", str(error)) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is not TOML.", str(error)) from error
    except ValidationError as error:
        raise UsageError(
            f"{path} is not a configuration.", explain(error, _keys(Config))
        ) from error


def _keys(model: type[BaseModel]) -> set[str]:
    keys = set(model.model_fields)
    for info in model.model_fields.values():
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            keys |= _keys(info.annotation)
    return keys
