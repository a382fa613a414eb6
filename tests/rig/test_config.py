"""The configuration: every key checked, the nearest one named."""

from pathlib import Path

import pytest

from rig.configuration.check import problems, refuse_problems
from rig.configuration.config import SIMULATED, load_config, shipped_configs, to_toml
from rig.errors import ExitCode, UsageError


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("kp =", "kpp =", r"kpp: there is no such key; did you mean 'kp'"),
        ("motor_current_a = 0.6", "motor_current_a = -0.6", "greater than 0"),
        ('name = "simulated rig"', "", "name: Field required"),
        ("lever_arm_m = 0.012", "lever_arm_m = inf", "finite"),
        ("current_a = 0.6", "current_a = 600", r"limits.motor_current_a: .*60, given 600 A"),
        ("[limits]", '[devices.jaw]\nulr = "sim://"\n[limits]', r"ulr: .*did you mean 'url'"),
    ],
)
def test_a_wrong_key_is_named(tmp_path, old, new, message):
    text = SIMULATED.read_text()
    assert old in text
    path = tmp_path / "rig.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(UsageError, match=message):
        load_config(path)


@pytest.mark.parametrize("name", shipped_configs())
def test_every_shipped_configuration_is_sound_and_survives_being_shown(name, tmp_path):
    config = load_config(Path(name))
    assert problems(config) == []
    assert config.calibration_set().channels
    shown = tmp_path / "shown.toml"
    shown.write_text(to_toml(config))
    assert load_config(shown) == config


def on_one_bus(drive, sensor):
    bus = {"url": "can:socketcan:can0"}
    return load_config(Path("canopen")).changed(
        logger=bus | drive, devices={"jaw_force": {"driver": "ati-can"} | bus | sensor}
    )


@pytest.mark.parametrize("node", range(1, 16))
def test_the_factory_identifiers_of_the_sensor_are_those_of_a_drives_process_data(node):
    config = on_one_bus({"options": {"node_id": node}}, {"bit_rate": 1_000_000})
    (problem,) = problems(config)
    assert f"{0x200 + node:#05x}" in problem.what
    assert "0x68" in problem.fix


def test_unequal_bit_rates_on_one_bus_are_refused():
    (problem,) = problems(on_one_bus({}, {"options": {"base": 0x68}}))
    assert "250000" in problem.what
    with pytest.raises(UsageError, match="250000"):
        refuse_problems(on_one_bus({}, {"options": {"base": 0x68}}))


SIM = {"url": "sim://"}
CAN = {"driver": "ati-can", "url": "can:socketcan:can1"}


@pytest.mark.parametrize(
    ("device", "message"),
    [
        (CAN | {"url": "can:slcan:/dev/ttyACM0?bitrate=500000"}, "500000"),
        (CAN | {"driver": "ati-kan"}, "no driver 'ati-kan'"),
        (CAN | {"driver": "usb520"}, "on no CAN bus"),
        (CAN | {"url": "/dev/ttyACM0"}, "needs a CAN bus"),
        (SIM | {"driver": "usb520", "options": {"baud_rat": 1}}, "did you mean 'baud_rate'?"),
        (SIM | {"driver": "usb520", "options": {"rate_hz": 50}}, "given 50 Hz"),
        (CAN | {"options": {"base": "x"}}, "base"),
        (CAN | {"options": {"base": 500}}, "127"),
        (SIM | {"driver": "qia128", "options": {"rated_load": True}}, "rated_load"),
    ],
)
def test_what_a_device_cannot_be(device, message):
    config = load_config().changed(devices={"jaw_force": device})
    (problem,) = problems(config)
    assert message in problem.what
    assert problem.key == "devices.jaw_force"
    assert problem.fix


def test_two_devices_on_one_adapter_are_refused():
    url = "can:gs_usb:0?bitrate=250000"
    devices = {
        name: {"driver": "ati-can", "url": url, "options": {"base": base}}
        for name, base in (("one", 0x20), ("two", 0x21))
    }
    (problem,) = problems(load_config().changed(devices=devices))
    assert "one adapter" in problem.what


def test_config_check_speaks_to_machines(tmp_path, answered):
    assert answered("config check canopen")["sound"]
    bad = tmp_path / "bad.toml"
    bad.write_text(to_toml(on_one_bus({}, {})))
    assert len(answered("config check", bad, code=ExitCode.USAGE)["problems"]) == 2


def test_each_problem_names_its_line(tmp_path, said):
    text = SIMULATED.read_text()
    text = text.replace("kp = 20.0", "kpp = 20.0").replace("motor_current_a = 0.6", "")
    path = tmp_path / "bad.toml"
    path.write_text(text)
    printed = said("config check", path, code=ExitCode.USAGE).err
    lines = text.splitlines()
    assert f"line {lines.index('kpp = 20.0') + 1}, controller.kpp" in printed
    assert f"line {lines.index('[limits]') + 1}, limits.motor_current_a" in printed


@pytest.mark.parametrize(
    ("old", "new", "meant"),
    [
        ('model = "simulated_grip"', 'model = "simulated_gripp"', "simulated_grip"),
        ('calibration = "reference"', 'calibration = "refrence"', "reference"),
    ],
)
def test_a_model_or_calibration_that_is_not_there_is_a_problem(tmp_path, said, old, new, meant):
    path = tmp_path / "bad.toml"
    path.write_text(SIMULATED.read_text().replace(old, new))
    assert f"Did you mean {meant!r}" in said("config check", path, code=ExitCode.USAGE).out


def test_a_configuration_is_begun_for_the_board_that_is_plugged_in(tmp_path, monkeypatch, said):
    from rig.doctor.ports import Port

    board = Port("/dev/ttyACM0", "16c0:0483:1234567", "USB Serial")
    monkeypatch.setattr("rig.doctor.ports.serial_ports", lambda: [board])
    path = tmp_path / "rig.toml"
    printed = said("config init", path).out
    assert f"rig config check {path}" in " ".join(printed.split())
    assert f"rig doctor --config {path}" in " ".join(printed.split())
    assert load_config(path).logger.url == "usb:16c0:0483:1234567"
    said("config check", path)
    assert "already" in said("config init", path, code=ExitCode.USAGE).err
