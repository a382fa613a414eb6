"""The rig's configuration: one TOML file, every key checked, the resolved form kept in each log."""

import math
import tomllib
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    model_validator,
)

from calibration.linear import CalibrationSet, load_calibration_set, shipped_calibration_set
from calibration.rules import Verdict, judge, judge_raw, refuse_errors
from calibration.store import CalibrationStore, active_lines, compose, default_folder
from estimation.recording import Instrument
from rig.configuration.plausibility import PlausibilitySection
from rig.configuration.validation import explain
from rig.errors import UsageError

SHIPPED = Path(__file__).parent / "shipped"
SIMULATED = SHIPPED / "simulated.toml"

POT_RAD_PER_COUNT = math.radians(300.0) / 4095


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("a potentiometer of 0 rad a count shows nothing")
    return value


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Torque = Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
Current = Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)]
Angle = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Force = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]
Turn = Annotated[float, Field(ge=-0.01, le=0.01, allow_inf_nan=False), AfterValidator(_not_zero)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LoggerSection(_Section):
    """What moves the rig and samples it, and where it is found.

    Attributes:
        driver: `teensy` for the 1 kHz logger board, `teensy-can` for it on CAN, `epos4` for a drive
            on CANopen whose position loop runs in this computer.
        url: `sim://`, `usb:VID:PID:SERIAL`, `/dev/serial/by-id/...`, `socket://host:port` or
            `can:...`.
        options: The driver's own options.
        bit_rate: Bit rate the device is set to, bit/s, where it is on a CAN bus; the one it comes
            with from the factory if none.
        profile: What the board samples and moves: the reference rig, or the 3-DOF grasper.
    """

    driver: Literal["teensy", "teensy-can", "epos4"] = "teensy"
    url: str
    profile: Literal["reference", "grasper"] = "reference"
    options: dict[str, Any] = Field(default_factory=dict)
    bit_rate: int | None = Field(default=None, ge=10_000, le=1_000_000)


class DeviceSection(_Section):
    """A further device whose channels are recorded beside the logger's.

    Attributes:
        driver: Name of its driver; `rig devices` lists them.
        url: Where it is; `sim://` for its fake.
        options: The driver's own options.
        bit_rate: Bit rate it is set to, bit/s, where it is on a CAN bus; the one it comes with
            from the factory if none.
    """

    driver: str
    url: str
    options: dict[str, Any] = Field(default_factory=dict)
    bit_rate: int | None = Field(default=None, ge=10_000, le=1_000_000)


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
    """Limits checked at every sample, on the absolute value; a crossing ends in the safe state.

    Every key is the name of a channel; which there are depends on `[logger] profile`.
    """


class ReferenceLimits(LimitsSection):
    """Limits of the reference rig."""

    proximal_torque_n_m: Torque
    distal_torque_n_m: Torque
    motor_current_a: Current
    load_command_a: float = Field(ge=0, le=60)
    spindle_angle_rad: Angle


class GrasperLimits(LimitsSection):
    """Limits of the 3-DOF grasper, for each of its motors: the yaw's, and those of both jaws."""

    yaw_current_a: Current
    jaw_1_current_a: Current
    jaw_2_current_a: Current
    yaw_force_n: Force
    jaw_1_force_n: Force
    jaw_2_force_n: Force
    yaw_angle_rad: Angle
    jaw_1_angle_rad: Angle
    jaw_2_angle_rad: Angle


def _kind_of_limits(value: Any) -> str:
    """Say whose limits these are meant to be, by the motors they name."""
    names = value if isinstance(value, dict) else type(value).model_fields
    return "grasper" if any(name.startswith(("yaw_", "jaw_")) for name in names) else "reference"


AnyLimits = Annotated[
    Annotated[ReferenceLimits, Tag("reference")] | Annotated[GrasperLimits, Tag("grasper")],
    Discriminator(_kind_of_limits),
]


class SafetySection(_Section):
    """What is watched besides the limits, by the board first and by this computer again; on always.

    A time or a heat of 0 switches its watch off.

    Attributes:
        safe_state: What the drive motor does once something tripped: `release`, no current; or
            `hold`, stay where it stands with a low command, where encoder and current are sound.
        hold_command_ratio: Largest command while holding, of full scale.
        continuous_current_a: Motor current that warms the motor no further.
        heat_a2_s: Heat above it the motor can take: integral of current squared less that squared.
        stall_current_a: Current above which a motor that stands still is stalled.
        stall_motor_angle_rad: Motor shaft angle within which it stands still.
        stall_s: How long it may be stalled.
        motor_speed_rad_s: Fastest motor shaft. The shipped protocols need up to 260.
        jaw_closed_rad: Jaw angle, closing-positive, beyond which it must not close; if unset it
            follows from the spindle's limit and [plausibility].
        jaw_open_rad: Jaw angle below which it must not open; likewise.
        saturated_s: How long a torque or current sensor may be at the end of its range.
        stale_s: How long its reading may not change at all.
        watchdog_s: How long this computer may be silent.
    """

    safe_state: Literal["release", "hold"] = "release"
    hold_command_ratio: float = Field(default=0.05, ge=0, le=0.5)
    continuous_current_a: Current = 0.5
    heat_a2_s: float = Field(default=0.5, ge=0, le=2000)
    stall_current_a: Current = 0.55
    stall_motor_angle_rad: float = Field(default=0.5, ge=0, le=100)
    stall_s: float = Field(default=1.0, ge=0, le=600)
    motor_speed_rad_s: float = Field(default=400.0, gt=0, le=20000)
    jaw_closed_rad: Number | None = None
    jaw_open_rad: Number | None = None
    saturated_s: float = Field(default=0.02, ge=0, le=60)
    stale_s: float = Field(default=0.5, ge=0, le=60)
    watchdog_s: float = Field(default=0.25, ge=0.005, le=1)


class DriftSection(_Section):
    """Largest change of a sensor's zero over a run that passes; without a limit none is judged.

    The first three are sensors of the reference rig, the others of the grasper.
    """

    proximal_torque_n_m: Torque | None = None
    distal_torque_n_m: Torque | None = None
    motor_current_a: Current | None = None
    yaw_force_n: Force | None = None
    jaw_1_force_n: Force | None = None
    jaw_2_force_n: Force | None = None


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


class MasterSection(_Section):
    """The master a grasper follows: potentiometers of yaw, pitch and grasp.

    Attributes:
        url: Where it is, such as `usb:16c0:0483:SERIAL`; a simulated grasper has a simulated one.
        zero_counts: Counts of the converter at each joint's zero.
        rad_per_count: Turn of each joint for a count, negative where it is mounted the other way
            round; a potentiometer of 300 degrees over 12 bits if not said.
    """

    url: str | None = None
    zero_counts: tuple[Number, Number, Number] = (2048.0, 2048.0, 2048.0)
    rad_per_count: tuple[Turn, Turn, Turn] = (POT_RAD_PER_COUNT,) * 3


class SimulationSection(_Section):
    """The simulated rig behind a `sim://` logger.

    Attributes:
        seed: Seed of noise, offsets and drift.
        spread: Relative spread of the plant's parameters drawn by the seed.
        hidden: Hidden effect to strength; effects that no declared model is told of.
        draw_hidden: Seed that draws one more hidden effect, so that nobody need know which.
        firmware: Put the compiled firmware core in the loop where it is built.
        plant: `measured`, with losses that no declared model holds, or `declared`, without them.
        grasper: Prototype of the simulated grasper, where the profile is the grasper's.
    """

    seed: int = 0
    spread: float = Field(default=0.0, ge=0, lt=0.5)
    hidden: dict[str, Number] = Field(default_factory=dict)
    draw_hidden: int | None = None
    firmware: bool = True
    plant: Literal["measured", "declared"] = "measured"
    grasper: Literal["third", "journal", "ball"] = "third"


class Config(_Section):
    """The whole configuration.

    Attributes:
        calibration: Calibration set: a TOML file, or a shipped one by name.
        calibration_store: Folder of the store whose active records go before that set's lines, or
            `default` for the store that `rig cal` uses; no store if none.
        devices: Further devices by the name their recorded channels go under.
        serials: Serial numbers of the devices on the rig, held against those of the records.
    """

    name: str
    logger: LoggerSection
    controller: ControllerSection
    limits: AnyLimits
    safety: SafetySection = SafetySection()
    plausibility: PlausibilitySection = PlausibilitySection()
    drift: DriftSection = DriftSection()
    instrument: InstrumentSection = InstrumentSection()
    simulation: SimulationSection = SimulationSection()
    master: MasterSection = MasterSection()
    calibration: str = "reference"
    calibration_store: str | None = None
    serials: dict[str, str] = Field(default_factory=dict)
    devices: dict[Name, DeviceSection] = Field(default_factory=dict)
    lever_arm_m: Length = 0.012
    model: str | None = None

    @model_validator(mode="after")
    def _limits_are_the_profiles(self) -> "Config":
        wanted = GrasperLimits if self.logger.profile == "grasper" else ReferenceLimits
        if not isinstance(self.limits, wanted):
            raise ValueError(
                f"[limits] are not those of [logger] profile = {self.logger.profile!r}, which has "
                + ", ".join(wanted.model_fields)
            )
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

    @property
    def default_store(self) -> CalibrationStore:
        """The store where neither the configuration nor a command names one.

        What comes from a simulated rig is kept beside the real calibrations, not among them.
        """
        folder = default_folder()
        if self.is_simulated:
            folder = folder.with_name(f"{folder.name}-simulated")
        return CalibrationStore(folder)

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

    @property
    def drift_limits(self) -> dict[str, float]:
        """The limits of the zeros' drift, of the channels that have one."""
        return {name: limit for name, limit in self.drift if limit is not None}

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

    def logged(self) -> dict[str, Any]:
        """Return what a log holds of it: all but what is hidden, which a diagnosis is to find."""
        whole = self.model_dump()
        for secret in ("hidden", "draw_hidden"):
            del whole["simulation"][secret]
        return whole


def is_simulated(url: str) -> bool:
    """Say whether a URL names a fake."""
    return url.startswith("sim:")


def shipped_configs() -> list[str]:
    """Return the names of the shipped configurations, sorted."""
    return sorted(p.stem for p in SHIPPED.glob("*.toml") if not p.stem.endswith(".model"))


def load_config(path: Path | None = None) -> Config:
    """Read a configuration; the simulated rig's when no path is given.

    Args:
        path: A TOML file, or the name of a shipped configuration such as `reference`.

    Raises:
        UsageError: The file cannot be read or a key is wrong; names the key and the nearest one.
    """
    path = SIMULATED if path is None else _found(path)
    try:
        text = path.read_text()
        return Config.model_validate(tomllib.loads(text))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(
            f"The configuration {path} cannot be read.",
            str(error),
            f"Give a TOML file, or one of: {', '.join(shipped_configs())}.",
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is not TOML.", str(error)) from error
    except ValidationError as error:
        raise UsageError(
            f"{path} is not a configuration.", explain(error, _keys(Config), text)
        ) from error


def _found(path: Path) -> Path:
    """Return the shipped configuration of that name, or the path itself."""
    return SHIPPED / f"{path}.toml" if str(path) in shipped_configs() else path


def _keys(model: type[BaseModel]) -> set[str]:
    return set(model.model_fields) | {
        key
        for info in model.model_fields.values()
        for section in _sections(info.annotation)
        for key in _keys(section)
    }


def _sections(kind: Any) -> Iterator[type[BaseModel]]:
    """Yield the sections a key's type is made of."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    for part in get_args(kind):
        yield from _sections(part)
