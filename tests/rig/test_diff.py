"""`rig diff`: two folders of recordings in, what changed out."""

import json

import numpy as np
import pytest

from estimation.recording import Recording
from rig.cli.main import main
from rig.log.convert import write_recording
from tests.rig.test_library import MODEL


def campaign(folder, seed, damping):
    random = np.random.default_rng(seed)
    time_s = np.arange(0, 8, 0.01)
    folder.mkdir()
    for k in range(5):
        phase = 2 * np.pi * 0.3 * (1 + 0.2 * k) * time_s
        position = 0.2 * np.sin(phase + random.uniform(0, 6)) + 0.1 * np.sin(0.4 * phase)
        speed = np.gradient(position, time_s)
        force = 2.0 * np.gradient(speed, time_s) + damping * speed
        force += random.normal(0, 0.05, time_s.size)
        columns = {"axis_position_m": position, "drive_force_n": force}
        write_recording(folder / f"{k}.mcap", Recording(f"{k}", time_s, columns))
    return str(folder)


@pytest.mark.integration
def test_a_change_is_stated_in_words_and_as_json(tmp_path, capsys):
    model = tmp_path / "axis.toml"
    model.write_text(MODEL)
    before, after = campaign(tmp_path / "a", 1, 5.0), campaign(tmp_path / "b", 2, 6.5)
    third = campaign(tmp_path / "c", 3, 6.5)
    words = ["diff", before, after, "--model", str(model), "--on", third, "--json"]
    assert main(words) == 0
    printed = capsys.readouterr()
    answer = json.loads(printed.out)
    assert answer["schema"] == "rig.diff/2"
    (change,) = answer["changes"]
    assert change["verdict"] == "moved"
    assert change["parameters"]["damping"] == pytest.approx(1.5, rel=0.1)
    assert answer["predicted"]["motor"]["as_b"] < answer["predicted"]["motor"]["with_a"]
    assert "Moved: friction.viscous damping of motor" in printed.err


@pytest.mark.integration
def test_too_few_runs_are_refused(tmp_path, capsys):
    model = tmp_path / "axis.toml"
    model.write_text(MODEL)
    before, after = campaign(tmp_path / "a", 1, 5.0), campaign(tmp_path / "b", 2, 6.5)
    (tmp_path / "b" / "0.mcap").unlink()
    (tmp_path / "b" / "1.mcap").unlink()
    assert main(["diff", before, after, "--model", str(model)]) == 5
    assert "3 runs, too few to compare" in capsys.readouterr().err
    for name in ("2", "3"):
        (tmp_path / "b" / f"{name}.mcap").unlink()
    assert main(["diff", before, after, "--model", str(model)]) == 5
    said = capsys.readouterr().err
    assert "The second campaign has 1 run, too few to compare" in said
    assert "lap_s under [data.runs]" in said
