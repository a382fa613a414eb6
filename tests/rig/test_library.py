"""`import rig` as a library: light to import, the notebook runs; `rig diff` of its campaigns."""

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rig
from estimation.campaign import Campaign
from estimation.effects import effect
from estimation.filters import LowPass
from estimation.model import Model, Term
from estimation.model_file import to_toml
from estimation.recording import Recording
from rig.log.convert import write_recording

NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebook.ipynb"
TIME_S = np.arange(0, 8, 0.01)


def axis_run(name: str, phase: float, damping: float = 5.0, seed: int = 0) -> Recording:
    position = 0.2 * np.sin(2 * TIME_S + phase) + 0.1 * np.sin(0.7 * TIME_S)
    speed = np.gradient(position, TIME_S)
    noise = np.random.default_rng(seed + int(10 * phase)).normal(0, 0.05, TIME_S.size)
    force = 2.0 * np.gradient(speed, TIME_S) + damping * speed + noise
    return Recording(name, TIME_S, {"axis_position_m": position, "drive_force_n": force})


TERMS = (
    Term(effect("inertia.missing"), 1, {"acceleration": "axis_acceleration_m_s2"}),
    Term(effect("friction.viscous"), 1, {"speed": "axis_velocity_m_s"}),
)
MODEL = to_toml(Model("axis", "motor", "drive_force_n", TERMS, low_pass=LowPass(20.0)))


@pytest.fixture
def campaign() -> Campaign:
    return Campaign.of(axis_run(f"{k}", 0.7 * k) for k in range(6))


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "axis.toml"
    path.write_text(MODEL)
    (found,) = rig.declared(path)
    return found


def test_importing_loads_neither_numpy_nor_a_command():
    code = "import rig, sys; print(sorted(m for m in sys.modules if m in ('numpy', 'rig.cli')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_is_there_and_documented():
    for name in rig.__all__:
        value = getattr(rig, name)
        assert name == "__version__" or value.__doc__
    with pytest.raises(AttributeError, match="no attribute 'fitt'"):
        rig.fitt  # noqa: B018


def test_a_prediction_has_an_interval_that_covers(campaign, model):
    fitted = rig.fit(campaign, model)
    assert rig.held_out(campaign, model, folds=3).rmse < 0.05
    run = campaign.runs[0].recording()
    found = rig.predict(fitted, run)
    assert found.unit == "N"
    inside = (found.low < run["drive_force_n"]) & (run["drive_force_n"] < found.high)
    # the interval is of the filtered signal; the measured one has the sensor's noise on top
    assert np.mean(np.abs(found.value - run["drive_force_n"]) < 0.2) > 0.95
    assert inside.any()
    assert rig.predict(fitted, run).value.shape == TIME_S.shape


def test_a_table_is_read_by_a_mapping_and_written_as_logs(tmp_path, campaign):
    run = campaign.runs[0].recording()
    table = tmp_path / "run.csv"
    rows = zip(1e3 * TIME_S, 1e3 * run["axis_position_m"], strict=True)
    table.write_text("t,x\n" + "".join(f"{t},{x}\n" for t, x in rows))
    columns = {"time_s": "t:ms", "axis_position_m": "x:mm"}
    read = rig.read(table, columns=columns, runs={"lap_s": 4.0})
    assert len(read) == 2
    rig.save(read, tmp_path / "logs")
    again = rig.read(tmp_path / "logs")
    first = again.runs[0].recording()
    np.testing.assert_allclose(first["axis_position_m"], run["axis_position_m"][:400])


@pytest.mark.integration
def test_a_diagnosis_enters_the_access_log_as_the_command_does(model, tmp_path, monkeypatch):
    monkeypatch.setenv("RIG_STATE_DIR", str(tmp_path / "state"))
    runs = Campaign.of(axis_run(f"{k}", 0.7 * k) for k in range(8))
    first, second = (rig.diagnose(runs, [model]) for _ in range(2))
    assert (first.exploratory, second.exploratory) == (False, True)
    assert "Exploratory: " in " ".join(second.notes)
    assert len((tmp_path / "state" / "looks.jsonl").read_text().splitlines()) == 2
    apart = rig.diagnose(runs, [model], ledger=tmp_path / "own.jsonl")
    assert not apart.exploratory


@pytest.mark.integration
@pytest.mark.parametrize(
    ("factor", "left_out"),
    [(1e-3, "in another unit"), (1e3, "in another unit"), (0.01, "constant"), (0.25, "")],
)
def test_a_run_with_a_channel_that_is_surely_wrong_takes_no_part(tmp_path, model, factor, left_out):
    """Friction hides the factor of a position from an equation that predicts a force."""
    runs = [axis_run(f"{k}", 0.7 * k) for k in range(8)]
    for k in (3, 6):
        force = np.full(len(TIME_S), 1.5) if left_out == "constant" else runs[k]["drive_force_n"]
        position = (1.0 if left_out == "constant" else factor) * runs[k]["axis_position_m"]
        runs[k] = runs[k].with_columns(axis_position_m=position, drive_force_n=force)
    found = rig.diagnose(Campaign.of(runs), [model], ledger=tmp_path / "looks.jsonl")
    used = {*found.sealed.discover, *found.sealed.confirm}
    assert {"3", "6"}.isdisjoint(used) == bool(left_out)
    notes = [note for note in found.notes if note.startswith("Run 3 is left out: ")]
    assert len(notes) == bool(left_out)


def test_two_campaigns_are_compared(campaign, model):
    assert rig.compare(campaign, campaign, [model]).changes == ()


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_table_of_runs_whose_conditions_are_named_as_channels(library):
    """As every run of the reference rig: the load is a condition and a channel."""
    pytest.importorskip(library)
    time_s = np.arange(4.0)
    run = Recording("a", time_s, {"load_a": time_s}, conditions={"load_a": 0.2, "way": "sine"})
    table = getattr(rig, f"to_{library}")(Campaign.of([run]))
    assert list(table.columns) == ["run", "condition_load_a", "condition_way", "time_s", "load_a"]
    assert list(table["load_a"]) == list(time_s)
    assert set(table["condition_load_a"]) == {0.2}
    if library == "pandas":
        assert table.attrs["units"]["load_a"] == "A"


def test_a_campaign_is_shown_in_a_line(campaign):
    said = repr(campaign)
    assert said.startswith("Campaign of 6 runs: ")
    assert len(said) < 200
    assert campaign.names[0] in repr(campaign.runs[0])
    assert len(repr(campaign.runs[0])) < 100


def test_a_data_set_has_units(campaign):
    pytest.importorskip("xarray")
    found = rig.to_xarray(campaign.runs[0].recording())
    assert found["drive_force_n"].attrs["units"] == "N"


def test_a_plot_has_a_panel_a_channel_and_the_estimate(campaign, model):
    run = campaign.runs[0].recording()
    assert len(rig.plot(run).axes) == 2
    (panel,) = rig.plot(run, rig.fit(campaign, model)).axes
    assert [line.get_label() for line in panel.get_lines()] == ["measured", "axis"]


def test_another_package_of_the_same_name_is_named(tmp_path):
    (tmp_path / "estimation").mkdir()
    (tmp_path / "estimation" / "__init__.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import rig; rig.read"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert str(tmp_path / "estimation") in done.stderr
    assert "an environment of its own" in done.stderr


@pytest.mark.integration
def test_the_notebook_runs(tmp_path):
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    script = tmp_path / "notebook.py"
    script.write_text("\n".join(code))
    names = runpy.run_path(str(script))
    (finding,) = names["found"].findings
    assert finding.family == "ripple.motor"
    error = names["found"].errors["motor"]
    assert error.after < error.before


def recorded(folder: Path, damping: float, seed: int) -> Path:
    folder.mkdir()
    for k in range(5):
        run = axis_run(f"{k}", 1.3 * k, damping, seed)
        write_recording(folder / f"{k}.mcap", run)
    return folder


@pytest.fixture
def axis(tmp_path):
    (tmp_path / "axis.toml").write_text(MODEL)
    return tmp_path / "axis.toml"


@pytest.mark.integration
def test_a_change_is_stated_in_words_and_as_json(tmp_path, axis, said):
    before, after = recorded(tmp_path / "a", 5.0, 100), recorded(tmp_path / "b", 6.5, 200)
    third = recorded(tmp_path / "c", 6.5, 300)
    printed = said("diff", before, after, "--on", third, "--json --model", axis)
    answer = json.loads(printed.out)
    assert answer["schema"] == "rig.diff/3"
    (change,) = answer["changes"]
    assert change["verdict"] == "moved"
    assert change["parameters"]["damping"] == pytest.approx(1.5, rel=0.1)
    assert answer["predicted"]["motor"]["as_b"] < answer["predicted"]["motor"]["with_a"]
    assert "Changed parameter: friction.viscous damping of motor" in printed.err


@pytest.mark.integration
@pytest.mark.parametrize("command", ["diagnose --quick", "diff"])
def test_recordings_of_another_machine_are_answered_with_the_option_that_names_it(
    command, tmp_path, said
):
    own = recorded(tmp_path / "a", 5.0, 100)
    paths = (own, own) if command == "diff" else (own,)
    printed = " ".join(said(command, *paths, code=5).err.split())
    assert "machine file of these recordings, with --model or --machine" in printed


@pytest.mark.integration
def test_too_few_runs_are_refused(tmp_path, axis, said):
    words = (
        "diff",
        recorded(tmp_path / "a", 5.0, 100),
        recorded(tmp_path / "b", 6.5, 200),
        "--model",
    )
    for name in ("0", "1"):
        (tmp_path / "b" / f"{name}.mcap").unlink()
    assert "3 runs, too few to compare" in said(*words, axis, code=5).err
    for name in ("2", "3"):
        (tmp_path / "b" / f"{name}.mcap").unlink()
    printed = said(*words, axis, code=5).err
    assert "The second campaign has 1 run, too few to compare" in printed
    assert "lap_s under [data.runs]" in printed
