"""Channels of further devices in a recording: at the samples' times, whatever their own rate."""

import json

import numpy as np
import pytest

from estimation.plant import Axis, Part, Plant, Sensor, Written
from estimation.plant_file import to_toml
from estimation.recording import Flag
from rig.importers.log import IMPORTER
from rig.log.convert import log_times_ns
from rig.log.run import RunEnd, RunInfo
from rig.log.schema import Field, Stream
from rig.log.streams import SAMPLE, sample_stream
from rig.log.writer import LogWriter

RATE_HZ = 1000.0
TOPIC = "/rig/device/ft"
FT = Stream(
    TOPIC,
    "rig_msgs/msg/Ft",
    (
        Field("time_s", "float64", "s", ""),
        Field("force_z_n", "float64", "N", ""),
        Field("gauge", "float64", "", "raw counts"),
        Field("sequence", "uint32", "", ""),
        Field("flags", "uint32", "", ""),
    ),
    None,
)
CURRENT, FORCE = "motor_current_a", "ft_force_z_n"
DRIVE = Part("motor.torque_constant", 1, {"source": CURRENT})
MACHINE = Plant(
    name="gripper",
    cutoff_hz=20.0,
    axes=(Axis("jaw", "m"),),
    sensors=(Sensor("jaw_position_m", "jaw", "position"), Sensor(CURRENT), Sensor(FORCE)),
    equations=(Written("grip", FORCE, (DRIVE, Part("sensor.offset"))),),
)


def write(path, columns, device_s, force_n, flags=None, conditions=None):
    """Write a log of samples at 1 kHz and of a device at times of its own."""
    size = len(next(iter(columns.values())))
    time_s = np.arange(size) / RATE_HZ
    run = RunInfo(path.stem, conditions=conditions or {}, started_at_ns=10**18)
    writer = LogWriter(path, run, [sample_stream(tuple(columns), RATE_HZ), FT])
    rows = {"sequence": np.arange(size), "flags": np.zeros(size, int), "time_s": time_s}
    writer.write(SAMPLE, {**columns, **rows}, log_times_ns(time_s, 10**18))
    numbers = np.arange(len(device_s))
    marks = np.zeros(len(device_s), int) if flags is None else flags
    rows = {"time_s": device_s, "force_z_n": force_n, "gauge": force_n * 1e3}
    rows |= {"sequence": numbers, "flags": marks}
    writer.write(TOPIC, rows, log_times_ns(device_s, 10**18))
    writer.close(RunEnd(expected_samples={SAMPLE: size}))


def read(path):
    (run,) = IMPORTER.open(path).runs
    return run.recording()


@pytest.mark.parametrize("rate_hz", [80.0, 333.3, 1000.0, 4000.0])
def test_a_device_is_read_at_the_times_of_the_samples(tmp_path, rate_hz):
    device_s = 0.0007 + np.arange(int(3 * rate_hz)) / rate_hz
    angle_rad = np.arange(3000) / RATE_HZ
    write(
        tmp_path / "run.mcap",
        {"motor_angle_rad": angle_rad},
        device_s,
        np.sin(2 * np.pi * 2 * device_s),
    )
    recording = read(tmp_path / "run.mcap")
    assert set(recording.columns) == {"motor_angle_rad", "ft_force_z_n"}
    assert recording.valid.all()
    inside = slice(20, -20)
    expected = np.sin(2 * np.pi * 2 * recording.time_s)
    assert np.abs(recording["ft_force_z_n"] - expected)[inside].max() < 0.01


def test_of_a_faster_device_the_noise_within_a_period_is_averaged(tmp_path):
    device_s = np.arange(12_000) / 4000.0
    force_n = 1.0 + np.random.default_rng(0).normal(size=device_s.size)
    write(tmp_path / "run.mcap", {"motor_angle_rad": np.zeros(3000)}, device_s, force_n)
    spread_n = read(tmp_path / "run.mcap")["ft_force_z_n"].std()
    assert 0.4 < spread_n < 0.6  # of four samples


def test_where_a_device_sent_nothing_its_value_is_unknown_and_the_sample_flagged(tmp_path):
    device_s = np.arange(300) / 100.0
    flags = np.zeros(300, int)
    flags[250] = Flag.SATURATED
    kept = (device_s < 1.0) | (device_s > 1.2)
    force_n = np.ones(300)
    columns = {"motor_angle_rad": np.zeros(3000)}
    write(tmp_path / "run.mcap", columns, device_s[kept], force_n[kept], flags[kept])
    recording = read(tmp_path / "run.mcap")
    absent = np.isnan(recording["ft_force_z_n"])
    np.testing.assert_array_equal(absent, (recording.flags & Flag.MISSING) > 0)
    assert recording.time_s[absent][[0, -1]] == pytest.approx([0.99, 1.21], abs=0.002)
    saturated_s = recording.time_s[(recording.flags & Flag.SATURATED) > 0]
    assert np.abs(saturated_s - 2.5).max() < 0.006


def test_its_channel_is_fitted_and_diagnosed_by_a_machine_file(tmp_path, answered):
    random = np.random.default_rng(3)
    stiffness_n_m = 400.0
    for load in (0.0, 0.5):
        for frequency_hz in (0.7, 1.1, 1.6):
            time_s = np.arange(8000) / RATE_HZ
            position_m = 5e-3 * np.sin(2 * np.pi * frequency_hz * time_s)
            current_a = 0.3 * np.sin(2 * np.pi * 0.4 * time_s + frequency_hz) + load
            device_s = np.arange(800) / 100.0
            force_n = 6.0 * np.interp(device_s, time_s, current_a)
            force_n -= stiffness_n_m * np.interp(device_s, time_s, position_m)
            force_n += random.normal(0, 0.01, 800)
            write(
                tmp_path / f"runs-{load:g}-{frequency_hz:g}.mcap",
                {"jaw_position_m": position_m, "motor_current_a": current_a},
                device_s,
                force_n,
                conditions={"load_command_a": load, "frequency_hz": frequency_hz},
            )
    machine = tmp_path / "gripper.toml"
    machine.write_text(to_toml(MACHINE))
    fitted = answered("fit", tmp_path, "--machine", machine, "-o", tmp_path / "grip.model.toml")
    assert "ft_force_z_n" in json.dumps(fitted)
    found = answered("diagnose --quick", tmp_path, "--machine", machine)
    assert "spring.position" in json.dumps(found["findings"])
