"""Tables of a configuration that every machine has, and the types of their numbers."""

from importlib.metadata import entry_points
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from estimation.recording import Instrument

MACHINE_SETTINGS = "rig.machine_settings"
"""Entry point group: `[logger] profile` to the `MachineSettings` of that machine."""


def profiles() -> list[str]:
    """Names of the machines that are installed, sorted."""
    return sorted(entry.name for entry in entry_points(group=MACHINE_SETTINGS))


def _installed(profile: str) -> str:
    if profile not in profiles():
        known = ", ".join(profiles()) or "none"
        raise ValueError(f"no machine {profile!r} is installed, only {known}")
    return profile


Profile = Annotated[str, AfterValidator(_installed)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Torque = Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)]
Current = Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)]
Angle = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Force = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0, le=1, allow_inf_nan=False)]
Window = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Ratio = Annotated[float, Field(ge=0, le=10_000, allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]


class Section(BaseModel):
    """A table of a configuration: every key checked, no value changed later."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class DeviceSection(Section):
    """A further device whose channels are recorded with the logger's.

    Attributes:
        driver: Name of its driver; `rig devices` lists them.
        url: URL; `sim://` for its fake.
        options: The driver's own options.
        bit_rate: Bit rate it is set to, bit/s, where it is on a CAN bus; the one it comes with
            from the factory if none.
    """

    driver: str
    url: str
    options: dict[str, Any] = Field(default_factory=dict)
    bit_rate: int | None = Field(default=None, ge=10_000, le=1_000_000)


class LoggerSection(DeviceSection):
    """The board or drive that moves and samples the rig, and its URL.

    Attributes:
        driver: `teensy` for the 1 kHz logger board, `epos4` for a drive on CANopen whose
            position loop runs in this computer; with the profiles `drive` and
            `sensor` any driver, such as `dynamixel`.
        url: `sim://`, `usb:VID:PID:SERIAL`, `/dev/serial/by-id/...`, `socket://host:port` or
            `can:...`.
        profile: What the board samples and moves: a name in the entry point group
            `rig.machine_settings`, such as the reference rig or the 3-DOF grasper.
    """

    driver: str = "teensy"
    profile: Profile = "reference"


class ControllerSection(Section):
    """Gains of the logger's position controller, in its own ticks of 1e-4 of full scale.

    Attributes:
        kp: Command ticks a spindle count.
        ki: Command ticks a spindle count and tick.
        kd: Command ticks a motor count and tick.
        velocity_filter: Weight of the newest velocity.
        limit: Largest command, ticks.
    """

    kp: Number
    ki: Number
    kd: Number
    velocity_filter: float = Field(gt=0, le=1)
    limit: Positive = 10000.0

    def gains(self) -> list[float]:
        """Return the gains in the order the controller takes them."""
        return [self.kp, self.ki, self.kd, self.velocity_filter, self.limit]


class SafetySection(Section):
    """Monitors in addition to the limits, on the board and again on this computer; always on.

    A time or a heat of 0 switches its watch off.

    Attributes:
        safe_state: State of the drive motor after a trip: `release`, no current; or
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
        load_continuous_a: Load current that warms the load motor no further, by its data sheet; the
            limit of the load where it is not set, which is never exceeded.
        load_heat_a2_s: Heat above it that the load motor can take; it has no current read-back, so
            the current it is given counts.
        dry_s: How long the last setpoint is held while none follows.
        hold_s: How long a tripped board may hold; then it releases.
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
    load_continuous_a: Current | None = None
    load_heat_a2_s: float = Field(default=0.5, ge=0, le=2000)
    dry_s: float = Field(default=0.5, gt=0, le=60)
    hold_s: float = Field(default=10.0, gt=0, le=600)
    watchdog_s: float = Field(default=0.25, ge=0.005, le=1)


class PlausibilitySection(Section):
    """How far encoders and measured current may contradict one another before the rig trips.

    The firmware core holds these limits; the board in Python, which is for simulation without a
    compiler, does not. Defaults are those of the reference rig. Each window is wider than what the
    shipped protocols need on simulated rigs whose parameters vary by 15 % and that have one hidden
    effect (docs/decisions/0281). Stiffness and torque constant are believed to a half: the board
    adds half of the twist, the stretch and the motor's torque they give to each window.

    Attributes:
        following_rad: Farthest the followed encoder may be from its target.
        following_s: How long it may be farther.
        command_full_scale_a: Motor current of a full command.
        command_offset_a: Motor current at a command of 0.
        current_window_a: Largest difference of measured and commanded current, averaged over
            `current_s`. The controller's limit must lie below the motor controller's own.
        current_s: Time of that average.
        frozen_current_a: Change of the current behind which a motor that did not move has a dead
            encoder; half of the current limit if unset.
        frozen_motor_rad: Motor shaft angle within which it did not move.
        torque_constant_n_m_a: Torque at the spindle a motor current, at rest.
        still_torque_n_m: Largest torque of a motor at rest that the torque sensor does not find:
            its friction. Beyond it the encoders are dead.
        still_change_n_m: Farthest the proximal torque may change while no encoder counts; more
            where the gearhead is so stiff that it turns the spindle by less than two counts.
        still_rise_n_m: Farthest the motor's torque may rise, while no encoder counts, above the
            friction it overcame in its last motion.
        beyond_rad: Farthest beyond its travel limit the spindle may be as the jaw's encoder shows.
        probe_rad: Distance to the end of the travel that the spindle is to turn towards, within
            which the encoders may not count for 30 ms, or 0.3 s at the target. Then the board pulls
            away from that end by twice `still_torque_n_m` until they count; after 10 ms without a
            count they are dead.
        probe_s_rad: How much longer they may not count, for each radian farther from that end.
        gear_ratio: Motor turns a turn of the spindle; 0 for no comparison.
        gear_stiffness_n_m_rad: Stiffness of the gearhead's twist, at the spindle.
        twist_window_rad: Largest span of what motor and spindle differ by besides that twist, at
            the spindle: backlash, friction, and a stiffness that is not quite right.
        jaw_ratio: Jaw angle a spindle angle; 0 for no comparison.
        jaw_zero_rad: Jaw angle at spindle angle zero.
        cable_stiffness_n_m_rad: Stiffness of the cable's stretch, at the jaw.
        stretch_window_rad: Largest span of what jaw and spindle differ by besides that stretch, at
            the jaw.
        spindle_jump_rad: Farthest the spindle may turn in one sample.
        jaw_jump_rad: Farthest the jaw may turn in one sample.
    """

    following_rad: Window = 0.5
    following_s: Annotated[float, Field(gt=0, le=60)] = 0.2
    command_full_scale_a: Window = 2.06
    command_offset_a: Number = -0.019
    current_window_a: Window = 0.05
    current_s: Annotated[float, Field(gt=0, le=1)] = 0.02
    frozen_current_a: Window | None = None
    frozen_motor_rad: Window = 0.008
    torque_constant_n_m_a: Window = 0.897
    still_torque_n_m: Window = 0.085
    still_change_n_m: Window = 0.02
    still_rise_n_m: Window = 0.032
    beyond_rad: Window = 0.06
    probe_rad: Window = 0.75
    probe_s_rad: Window = 2.0
    gear_ratio: Ratio = 35.0
    gear_stiffness_n_m_rad: Window = 5.4
    twist_window_rad: Window = 0.03
    jaw_ratio: Ratio = 0.913
    jaw_zero_rad: Number = 1.272
    cable_stiffness_n_m_rad: Window = 0.751
    stretch_window_rad: Window = 0.105
    spindle_jump_rad: Window = 0.1
    jaw_jump_rad: Window = 0.1


class InstrumentSection(Section):
    """Identity of the instrument on the rig."""

    model: str | None = None
    serial: str | None = None
    lot: str | None = None
    side: str | None = None
    uses: int | None = Field(default=None, ge=0)

    def identity(self) -> Instrument:
        """Return the identity as a recording keeps it."""
        return Instrument(**self.model_dump())


class SimulationSection(Section):
    """The simulated rig behind a `sim://` logger.

    Attributes:
        seed: Seed of noise, offsets and drift.
        spread: Relative spread of the plant's parameters drawn by the seed.
        hidden: Hidden effect to strength; effects that no declared model contains.
        draw_hidden: Seed that draws one more hidden effect without showing its name.
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
