"""The rig's configuration: one TOML file, every key checked, the resolved form kept in each log."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import (
    Field,
    SerializeAsAny,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from calibration.linear import CalibrationSet, load_calibration_set, shipped_calibration_set
from calibration.record import CalibrationRecord
from calibration.rules import Verdict, judge, judge_raw, refuse_errors
from calibration.store import (
    CalibrationStore,
    active_lines,
    compose,
    default_folder,
    simulated_folder,
)
from estimation.channels import UnknownUnitError, unit_of
from estimation.errors import nearest
from estimation.files import not_utf8
from rig.configuration.machine_settings import (
    DriftSection,
    LimitsSection,
    OwnSection,
    ReferenceLimits,
    settings_of,
)
from rig.configuration.model_in_use import model_in_use
from rig.configuration.sections import (
    ControllerSection,
    DeviceSection,
    InstrumentSection,
    Length,
    LoggerSection,
    Name,
    PlausibilitySection,
    SafetySection,
    Section,
    SimulationSection,
    profiles,
)
from rig.configuration.validation import explain
from rig.errors import UsageError

SHIPPED = Path(__file__).parent / "shipped"
SIMULATED = SHIPPED / "simulated.toml"


class Config(Section):
    """The whole configuration.

    Attributes:
        name: Name of the rig, written into each log.
        lever_arm_m: Lever arm from the jaw's axis to its tip, for the force that is shown.
        model: Fitted model of `rig live`: a file, or a shipped one by name; `rig model use` goes
            before it.
        calibration: Calibration set: a TOML file, or a shipped one by name.
        calibration_store: Folder of the store whose active records go before that set's lines, or
            `default` for the store that `rig calibrate` uses; no store if none.
        machine: What else the machine is configured by; which keys there are depends on
            `[logger] profile`, as those of limits and drift do.
        devices: Further devices by the name their recorded channels go under.
        serials: Serial numbers of the devices on the rig, compared with those of the records.
    """

    name: str
    logger: LoggerSection
    controller: ControllerSection = ControllerSection(kp=0, ki=0, kd=0, velocity_filter=1)
    limits: SerializeAsAny[LimitsSection] = Field(default=LimitsSection(), validate_default=True)
    safety: SafetySection = SafetySection()
    plausibility: PlausibilitySection = PlausibilitySection()
    drift: SerializeAsAny[DriftSection] = Field(default=DriftSection(), validate_default=True)
    instrument: InstrumentSection = InstrumentSection()
    simulation: SimulationSection = SimulationSection()
    machine: SerializeAsAny[OwnSection] = Field(default=OwnSection(), validate_default=True)
    calibration: str = "reference"
    calibration_store: str | None = None
    serials: dict[str, str] = Field(default_factory=dict)
    devices: dict[Name, DeviceSection] = Field(default_factory=dict)
    lever_arm_m: Length = 0.012
    model: str | None = None

    @field_validator("limits", "drift", "machine", mode="before")
    @classmethod
    def _is_the_machines(cls, value: Any, info: ValidationInfo) -> Any:
        """Check a table against the machine that `[logger] profile` names."""
        if "logger" not in info.data:  # that table is wrong itself, and is reported
            return {"limits": LimitsSection, "drift": DriftSection}.get(
                str(info.field_name), OwnSection
            )()
        profile = info.data["logger"].profile
        settings = settings_of(profile)
        kinds = {"limits": settings.limits, "drift": settings.drift, "machine": settings.own}
        kind = kinds[str(info.field_name)]
        is_free = getattr(kind, "takes_any", False) or not isinstance(value, dict) or not value
        if not is_free and not set(value) & set(kind.model_fields):
            raise ValueError(
                f"[{info.field_name}] are not those of [logger] profile = {profile!r}, which has "
                + (", ".join(kind.model_fields) or "none")
            )
        return kind.model_validate(value.model_dump() if isinstance(value, Section) else value)

    @model_validator(mode="after")
    def _has_a_controller(self) -> "Config":
        moves = settings_of(self.logger.profile).moves
        if moves and "controller" not in self.model_fields_set:
            raise ValueError(f"[controller] is missing: a {self.logger.profile} has motors")
        return self

    @property
    def reference_limits(self) -> ReferenceLimits:
        """The limits, of what moves a reference rig.

        Raises:
            UsageError: The configuration is of another kind of rig.
        """
        if not isinstance(self.limits, ReferenceLimits):
            raise UsageError(
                f"{self.name} is a {self.logger.profile}.",
                "This moves a spindle against a load motor.",
                'Name a configuration with [logger] profile = "reference".',
            )
        return self.limits

    @property
    def is_simulated(self) -> bool:
        """Whether the logger is the simulated one."""
        return is_simulated(self.logger.url)

    @property
    def model_path(self) -> Path | None:
        """The fitted model `rig live` estimates with: the one in use, else the configured one."""
        if chosen := model_in_use(self.name):
            return chosen
        if self.model is None:
            return None
        shipped = SHIPPED / f"{self.model}.model.toml"
        return shipped if shipped.is_file() else Path(self.model)

    @property
    def store(self) -> CalibrationStore | None:
        """The calibration store in use, if any."""
        if self.calibration_store is None:
            return None
        named = self.calibration_store
        return CalibrationStore(default_folder() if named == "default" else Path(named))

    @property
    def default_store(self) -> CalibrationStore:
        """The store where neither the configuration nor a command names one.

        Calibrations of a simulated rig are stored separately from the real ones.
        """
        folder = default_folder()
        return CalibrationStore(simulated_folder(folder) if self.is_simulated else folder)

    @property
    def calibration_records(self) -> list[CalibrationRecord]:
        """The store's active lines for the instrument, one a channel; none without a store."""
        known = {} if self.store is None else active_lines(self.store, self.instrument.serial)
        return list(known.values())

    def calibration_set(self) -> CalibrationSet:
        """Return the calibrations in use: the set, with the store's active lines in place of its.

        Raises:
            CalibrationError: A file cannot be read, or an active record must not be used.
        """
        path = Path(self.calibration)
        is_file = path.suffix == ".toml"
        base = load_calibration_set(path) if is_file else shipped_calibration_set(self.calibration)
        refuse_errors(self.calibration_verdicts())
        return compose(base, self.calibration_records)

    @property
    def drift_limits(self) -> dict[str, float]:
        """The limits of the zeros' drift, of the channels that have one."""
        return {name: limit for name, limit in self.drift if limit is not None}

    def calibration_verdicts(self) -> list[Verdict]:
        """Return the objections to the store's active lines now; empty without a store."""
        now = datetime.now(UTC)
        return [
            verdict
            for line in self.calibration_records
            for verdict in (*judge(line, now, self.serials), *judge_raw(line))
        ]

    def changed(self, **sections: Any) -> "Config":
        """Return a configuration with some keys changed; a section is a dict of its own keys."""
        whole = self.model_dump()
        for name, change in sections.items():
            whole[name] = {**whole[name], **change} if isinstance(change, dict) else change
        return Config.model_validate(whole)

    def logged(self) -> dict[str, Any]:
        """Return the part for a log: all but the hidden effects, which a diagnosis must find."""
        whole = self.model_dump()
        for secret in ("hidden", "draw_hidden"):
            del whole["simulation"][secret]
        return whole


def is_simulated(url: str) -> bool:
    """Whether a URL names a fake."""
    return url.startswith("sim:")


def shipped_configs() -> list[str]:
    """Return the names of the shipped configurations, sorted."""
    return sorted(p.stem for p in SHIPPED.glob("*.toml") if not p.stem.endswith(".model"))


def load_config(path: Path | None = None) -> Config:
    """Read a configuration, of a file or shipped, by name; the simulated rig's without one.

    Raises:
        UsageError: The file cannot be read or a key is wrong; names the key and the nearest one.
    """
    path = SIMULATED if path is None else path
    if str(path) in shipped_configs():
        path = SHIPPED / f"{path}.toml"
    try:
        text = path.read_text("utf-8")
        return Config.model_validate(tomllib.loads(text))
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not a configuration.", *not_utf8(error)) from error
    except OSError as error:
        raise UsageError(
            f"The configuration {path} cannot be read.",
            f"{error.strerror}.",
            f"Give a TOML file, or a shipped one by name. {nearest(str(path), shipped_configs())}",
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is not TOML.", str(error)) from error
    except ValidationError as error:
        raise UsageError(
            f"{path} is not a configuration.", explain(error, _known_keys(), text)
        ) from error


def _known_keys() -> set[str]:
    every = map(settings_of, profiles())
    kinds = [Config, *(kind for one in every for kind in (one.limits, one.drift, one.own))]
    schemas = [kind.model_json_schema() for kind in kinds]
    tables = [table for whole in schemas for table in (whole, *whole.get("$defs", {}).values())]
    return {key for table in tables for key in table.get("properties", {})}


def to_toml(config: Config) -> str:
    """Return the configuration as TOML that `load_config` reads back to the same configuration."""
    return "\n".join(_table((), config.model_dump())).strip() + "\n"


def _table(path: tuple[str, ...], values: Mapping[str, Any]) -> Iterator[str]:
    """Yield a table's lines: its own keys, then the tables inside it; keys without a value last."""
    own = {k: v for k, v in values.items() if not isinstance(v, Mapping)}
    inner = {k: v for k, v in values.items() if isinstance(v, Mapping)}
    if path and (own or not inner):
        yield ""
        yield f"[{'.'.join(_key(part) for part in path)}]"
    for key, value in own.items():
        yield (
            f"# {_key(key)} is not set" if value is None else f"{_key(key)} = {_value(key, value)}"
        )
    for key, table in inner.items():
        yield from _table((*path, key), table)


def _value(key: str, value: Any) -> str:
    text = json.dumps(value)  # of strings, numbers, truth values and lists: TOML's own form
    try:
        unit = unit_of(key)
    except UnknownUnitError:
        return text
    return text if unit == "1" else f"{text}  # {unit}"


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else json.dumps(name)
