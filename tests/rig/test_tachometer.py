"""A machine whose motor has a tachometer and whose output, behind a gear, has an encoder."""

from pathlib import Path

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.derived import zero_phase_channels
from estimation.plant_equations import equations, integrals, missing, signals
from estimation.plant_file import parse
from estimation.recording import Recording
from rig.machines.recordings import with_positions

CRANK = """
schema = "rig.machine/1"
[machine]
name = "crank"
cutoff_hz = 20.0
run_offsets = false
[[axis]]
name = "motor"
unit = "rad"
[[axis]]
name = "crank"
unit = "rad"
[[transmission]]
name = "belt"
input = "motor"
output = "crank"
ratio = 3.0
[[actuator]]
name = "motor_supply_v"
axis = "motor"
[[sensor]]
name = "motor_velocity_rad_s"
axis = "motor"
reads = "speed"
[[sensor]]
name = "crank_angle_rad"
axis = "crank"
reads = "position"
"""

DATA = """
[data]
[data.columns]
time_s = "t"
motor_supply_v = "u"
motor_velocity_rad_s = "speed"
crank_angle_rad = "angle"
[data.runs]
changes = ["run"]
"""

TORQUE = """
[[sensor]]
name = "motor_torque_n_m"
axis = "motor"
reads = "effort"
"""

RATE_HZ, SECONDS = 200.0, 6.0


def crank_runs(cogging: float = 0.0, of_speed: float = 1.0) -> np.ndarray:
    """Return rows of run, time, supply, speed and angle of runs, each from another angle.

    Args:
        cogging: Amplitude that repeats 6 times per turn of the motor, V.
        of_speed: Gain of the tachometer in the last four of the runs.
    """
    random, rows = np.random.default_rng(2), []
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    for k in range(12):
        waves = [(random.uniform(0.2, 0.5), random.uniform(0.0, 6.0)) for _ in range(3)]
        motor = 5.0 * sum(np.sin(2 * np.pi * f * time + p) for f, p in waves)
        motor = motor + random.uniform(0.0, 6.0)
        speed = np.gradient(motor, time)
        supply = 0.08 * speed + 0.004 * np.gradient(speed, time) + 0.2 * np.tanh(speed / 0.5)
        supply += cogging * np.sin(6.0 * motor) + random.normal(0.0, 0.03, len(time))
        gain = of_speed if k >= 8 else 1.0
        tacho = gain * speed + random.normal(0.0, 0.2, len(time))
        angle = motor / 3.0 + random.normal(0.0, 2e-4, len(time))
        rows.append(np.column_stack([np.full(len(time), k + 1), time, supply, tacho, angle]))
    return np.vstack(rows)


def crank(folder: Path, rows: np.ndarray) -> tuple[Path, Path]:
    """Return the table of the runs and the file of the machine."""
    table, file = folder / "crank.csv", folder / "crank.toml"
    head = "run,t,u,speed,angle"
    np.savetxt(table, rows, delimiter=",", header=head, comments="", fmt="%.7g")
    file.write_text(CRANK + DATA)
    return table, file


def test_a_cogging_of_the_motor_is_found_at_the_motor_although_a_tachometer_reads_it(
    tmp_path, answered
):
    table, file = crank(tmp_path, crank_runs(cogging=0.15))
    (finding,) = answered("diagnose --quick", table, "--machine", file)["findings"]
    assert "ripple.motor" in (finding["family"], *finding["alternatives"])


def test_with_a_sensor_of_torque_the_angle_is_not_the_integral_of_the_tachometer_either(
    tmp_path, answered
):
    """The friction is that of the tachometer's speed, and the cogging that of the shaft's angle."""
    rows = crank_runs(cogging=0.15)
    table, file = crank(tmp_path, rows)
    torque = 0.5 + 0.3 * np.sin(1.7 * rows[:, 1] + rows[:, 0])
    supply = rows[:, 2] + torque / 0.4
    noise = np.random.default_rng(5).normal(0.0, 0.002, len(rows))
    rows = np.column_stack([rows[:, :2], supply, rows[:, 3:], torque + noise])
    head = "run,t,u,speed,angle,torque"
    np.savetxt(table, rows, delimiter=",", header=head, comments="", fmt="%.7g")
    data = DATA.replace("[data.runs]", 'motor_torque_n_m = "torque"\n[data.runs]')
    file.write_text(CRANK + TORQUE + data)
    (finding,) = answered("diagnose --quick", table, "--machine", file)["findings"]
    assert "ripple.motor" in (finding["family"], *finding["alternatives"])


def test_a_check_asks_for_no_encoder_where_a_neighbours_gives_the_angle(tmp_path, said):
    table, file = crank(tmp_path, crank_runs())
    printed = said("machine check", file, table).out
    assert "sensor of position on motor" not in printed
    assert "integral" not in printed
    assert "Check: motor_velocity_rad_s" not in printed


@pytest.mark.parametrize("command", ["machine check", "import --preview", "diagnose --quick"])
def test_a_tachometer_that_contradicts_the_encoder_over_the_ratio_is_asked_about(
    tmp_path, said, command
):
    table, file = crank(tmp_path, crank_runs(of_speed=1.45))
    words = (file, table) if command == "machine check" else (table, "--machine", file)
    printed = said(command, *words)
    (line,) = [x for x in (printed.out + printed.err).splitlines() if "motor_velocity_rad_s: " in x]
    assert "1.45 times the speed of crank_angle_rad times 3" in line
    assert "crank-09, crank-10, crank-11, crank-12" in line
    assert "crank-08" not in line


def test_the_angle_of_an_axis_with_a_tachometer_is_its_neighbours_over_the_ratio():
    plant = parse(CRANK)
    time = np.arange(0.0, 4.0, 0.005)
    angle = 2.0 + np.sin(2.0 * time)
    run = Recording("run", time, {"crank_angle_rad": angle, "motor_velocity_rad_s": 0.0 * time})
    found = zero_phase_channels(run, ["motor_angle_rad"], signals=signals(plant))
    assert found["motor_angle_rad"] == pytest.approx(3.0 * angle, abs=0.02)
    assert integrals(plant) == {}


def test_an_equation_that_reads_the_speed_of_a_tachometer_reads_the_tachometer():
    """The torque of the motor is lost to the friction of its own shaft."""
    plant = parse(CRANK + TORQUE)
    motor = equations(plant)[0]
    assert "motor_velocity_rad_s" in {n for part in motor.parts for n in part.channels.values()}
    assert not any("integral" in gap.what for gap in missing(plant))
    time = np.arange(0.0, 4.0, 0.005)
    speed = 5.0 + np.sin(2.0 * time)
    columns = {"crank_angle_rad": 0.0 * time, "motor_velocity_rad_s": speed}
    (run,) = with_positions(Campaign.of([Recording("run", time, columns)]), plant).evidence
    names = ["motor_velocity_rad_s", "motor_acceleration_rad_s2", "motor_angle_rad"]
    found = zero_phase_channels(run, names, signals=signals(plant))
    inside = slice(50, -50)
    assert found["motor_velocity_rad_s"][inside] == pytest.approx(speed[inside], abs=0.01)
    slope = 2.0 * np.cos(2.0 * time)[inside]
    assert found["motor_acceleration_rad_s2"][inside] == pytest.approx(slope, abs=0.02)
    assert found["motor_angle_rad"] == pytest.approx(0.0 * time)


def test_the_ratio_is_asked_about_only_where_every_run_contradicts_it(tmp_path, said):
    rows = crank_runs(of_speed=1.45)
    table, file = crank(tmp_path, rows)
    assert "gain and sign right there?" in said("machine check", file, table).out
    rows[:, 3] = 0.5 * crank_runs()[:, 3]
    table, file = crank(tmp_path, rows)
    line = "it is 0.5 times the speed of crank_angle_rad times 3 in every run;"
    printed = said("machine check", file, table).out
    assert f"{line} are its unit, gain and sign, and the ratio, right there?" in printed


PROPELLER = """
schema = "rig.machine/1"
machine = { name = "stand", cutoff_hz = 8.0, run_offsets = false }
axis = [{ name = "rotor", unit = "rad" }]
sensor = [
  { name = "rotor_velocity_rad_s", axis = "rotor", reads = "speed" },
  { name = "thrust_n", reads = "other" },
  { name = "lift_n", reads = "other" },
]
[[equation]]
name = "thrust"
target = "thrust_n"
samples = "all"
effects = [{ id = "transmission.ratio", channels = { load = "lift_n" } }, { id = "sensor.offset" }]
[data.columns]
time_s = "t"
rotor_velocity_rad_s = "speed"
thrust_n = "thrust"
[data.formulas]
lift_n = "1.3e-5 * rotor_velocity_rad_s**2"
[data.runs]
changes = ["run"]
"""


def test_an_error_of_a_formula_is_stated_as_one_of_the_reading_that_it_is_compared_with(
    tmp_path, answered
):
    random, rows = np.random.default_rng(6), []
    time = np.arange(0.0, 10.0, 0.02)
    for run in range(10):
        wave = np.sin(2 * np.pi * random.uniform(0.1, 0.3) * time + random.uniform(0.0, 6.0))
        speed = random.uniform(300.0, 500.0) + random.uniform(100.0, 200.0) * wave
        thrust = 1.3e-5 * speed**2
        thrust = thrust + 0.01 * thrust**2 + random.normal(0.0, 0.02, len(time))
        rows.append(np.column_stack([np.full(len(time), run + 1), time, speed, thrust]))
    table, file = tmp_path / "stand.csv", tmp_path / "stand.toml"
    head = "run,t,speed,thrust"
    np.savetxt(table, np.vstack(rows), delimiter=",", header=head, comments="", fmt="%.7g")
    file.write_text(PROPELLER)
    answer = answered("diagnose --quick", table, "--machine", file)
    (finding,) = answer["findings"]
    assert "sensor lift_n" in (finding["place"], *finding["alternative_places"].values())
    (note,) = [note for note in answer["notes"] if "no sensor reads lift_n" in note]
    assert "the formula 1.3e-5 * rotor_velocity_rad_s**2." in note
    assert "of the reading thrust_n that it is compared with." in note
