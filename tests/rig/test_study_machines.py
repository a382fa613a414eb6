"""`rig study machines`, and the walk of docs/your-own-machine.md, on tables of their layouts."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from estimation.plant_file import parse
from estimation.plant_models import declared
from rig.cli.main import main
from rig.importers.table.mapping import read_mapping
from rig.importers.table.open import read_runs
from rig.machines.shipped import place_of
from rig.studies.machines.published import by_direction, standard
from rig.studies.machines.study import CASES


@pytest.fixture
def data(tmp_path):
    folder = tmp_path / "emps"
    folder.mkdir()
    savemat(folder / "DATA_EMPS.mat", drive_axis())
    return tmp_path


def test_the_published_estimates_find_what_was_planted(data):
    whole = read_mapping(place_of(Path("emps")), [(("runs",), {}, "whole")])
    (recording,) = read_runs(data / "emps", whole, [])
    plain, split = standard(recording), by_direction(recording)
    assert plain.parameters["mass_kg"] == pytest.approx(MASS, rel=0.01)
    assert split.parameters["viscous_ahead_n_s_m"] == pytest.approx(VISCOUS + ASYMMETRY, rel=0.02)
    assert split.parameters["viscous_back_n_s_m"] == pytest.approx(VISCOUS - ASYMMETRY, rel=0.02)
    assert split.parameters["coulomb_ahead_n"] == pytest.approx(COULOMB, rel=0.2)
    assert split.percent < plain.percent


@pytest.mark.long
def test_absent_machines_are_named_and_the_others_studied(data, answered):
    page = data / "page.md"
    found = answered("study machines", data, "--out", page)
    (row,) = found["rows"]
    assert (row["case"], row["equation"]) == ("EMPS", "carriage")
    assert np.isfinite(row["declared_percent"])
    assert len(found["skipped"]) == len(CASES) - 1
    text = page.read_text()
    assert "no recordings in sts3215" in text
    assert "(../machines/emps.md)" in text


@pytest.mark.long
@pytest.mark.measured
def test_no_finding_raises_the_error_on_held_out_recordings(measured_data, answered):
    rows = answered("study machines", measured_data / "machines")["rows"]
    assert all(row["found_percent"] <= 1.01 * row["declared_percent"] for row in rows)


PAGE = Path(__file__).parents[2] / "docs" / "your-own-machine.md"
RATE_HZ = 1000.0
LAP_S = 6.24
MASS, VISCOUS, COULOMB, OFFSET = 95.0, 200.0, 20.0, -3.0
ASYMMETRY = 40.0


def drive_axis(laps=4):
    """Return a carriage that goes to and fro, its viscous friction different by direction."""
    time_s = np.arange(int(laps * LAP_S * RATE_HZ)) / RATE_HZ
    position = 0.12 - 0.12 * np.cos(2 * np.pi * time_s / LAP_S * 2)
    position += 0.01 * np.sin(2 * np.pi * 1.3 * time_s) * np.sin(np.pi * time_s / 25)
    speed = np.gradient(position, time_s)
    force = MASS * np.gradient(speed, time_s) + VISCOUS * speed + ASYMMETRY * np.abs(speed)
    force += COULOMB * np.tanh(speed / 0.001) + OFFSET
    force += np.random.default_rng(7).normal(0, 0.5, time_s.size)
    return {"t": time_s, "qm": position, "vir": force / 35.15, "gtau": 35.15}


def walk():
    """Return the page's files, by name, and its commands, up to the heading after the walk."""
    text = PAGE.read_text().split("## The machine")[0]
    names = re.findall(r"Save this as `([^`]+)`", text)
    blocks = re.findall(r"```(\w+)\n(.*?)```", text, flags=re.DOTALL)
    files = dict(zip(names, [body for kind, body in blocks if kind == "toml"], strict=True))
    return files, [shlex.split(line) for kind, body in blocks if kind == "sh" for line in [body]]


@pytest.mark.integration
def test_the_walk_goes_from_a_table_to_a_verdict(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    savemat("DATA_EMPS.mat", drive_axis())
    files, commands = walk()
    for name, text in files.items():
        Path(name).write_text(text)
    said = []
    for words in commands:
        assert words[0] == "rig"
        code = main(words[1:])
        printed = capsys.readouterr()
        said.append(printed.out + printed.err)
        assert code == 0, said[-1]
    listed, previewed, checked, imported, fitted, diagnosed = said
    assert "│ qm " in listed
    assert "Nothing looks wrong" in previewed
    assert "wrote 4 recordings" in imported
    assert "drive_force_n = inertia x carriage_acceleration_m_s2" in checked
    (mass,) = re.findall(r"inertia.missing, inertia[ │+]+([0-9.]+)", fitted)
    assert float(mass) == pytest.approx(MASS, rel=0.05)
    assert "\ncarriage: " in f"\n{diagnosed}"
    assert "friction.viscous_asymmetry" in diagnosed
    assert Path("emps.html").exists()


def test_the_machine_of_the_page_is_one():
    section = PAGE.read_text().split("## The machine")[1]
    (text,) = re.findall(r"```toml\n(schema.*?)```", section, flags=re.DOTALL)
    plant = parse(text)
    assert [model.balance for model in declared(plant)] == ["motor", "gearbox", "cell"]
    assert "counts" in text


STIFFNESS, INERTIA, DAMPING = 8e8, 6e5, 4e6
"""Of a cylinder, over the area of its head side: Pa/m, Pa s^2/m, Pa s/m."""


def pull(seed):
    """Return the table of a cylinder that pulls a specimen, and holds it for a while."""
    random, time_s = np.random.default_rng(seed), np.arange(0.0, 8.0, 2e-3)
    ramp = np.clip(time_s - 1.0, 0.0, 1.0) - np.clip(time_s - 6.0, 0.0, 1.0)
    position = 4e-3 * ramp**2 + 2e-3 * ramp * np.sin(2 * np.pi * (1.0 + 0.4 * seed) * time_s)
    speed = np.gradient(position, time_s)
    net = STIFFNESS * position + INERTIA * np.gradient(speed, time_s) + DAMPING * speed
    rod = 4e6 + 1e6 * np.sin(time_s + seed)
    read = [1e3 * position, 1e-5 * (net + 0.64 * rod), 1e-5 * rod]
    noise = [random.normal(0.0, size, time_s.size) for size in (1e-4, 0.02, 0.02)]
    return np.column_stack([1e3 * time_s, *(x + e for x, e in zip(read, noise, strict=True))])


@pytest.mark.integration
def test_the_equation_of_one_s_own_is_fitted_as_it_stands(tmp_path, answered):
    (text,) = re.findall(r"```toml\n# cylinder.toml\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    file, runs = tmp_path / "cylinder.toml", tmp_path / "runs"
    file.write_text(text)
    runs.mkdir()
    for k in range(4):
        head = "t_ms,x_mm,head_bar,rod_bar"
        np.savetxt(runs / f"{k}.csv", pull(k), delimiter=",", header=head, comments="")
    found = answered("machine check", file, runs)
    (equation,) = found["check"]["equations"]
    sizes = {one["effect"]: one["value"] for one in equation["parameters"]}
    assert found["sound"]
    assert sizes["spring.position"] == pytest.approx(STIFFNESS, rel=0.01)
    assert sizes["inertia.missing"] == pytest.approx(INERTIA, rel=0.1)
    assert sizes["friction.viscous"] == pytest.approx(DAMPING, rel=0.05)
    assert equation["relative_error"] < 0.05
    answer = answered("diagnose --quick", runs, "--machine", file)
    assert answer["findings"] == []
    assert answer["undecided"] == {}
