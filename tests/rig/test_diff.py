"""`rig diff`: two folders of recordings in, what changed out."""

import json

import numpy as np
import pytest

from estimation.recording import Recording
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


@pytest.fixture
def model(tmp_path):
    (tmp_path / "axis.toml").write_text(MODEL)
    return tmp_path / "axis.toml"


@pytest.mark.integration
def test_a_change_is_stated_in_words_and_as_json(tmp_path, model, said):
    before, after = campaign(tmp_path / "a", 1, 5.0), campaign(tmp_path / "b", 2, 6.5)
    third = campaign(tmp_path / "c", 3, 6.5)
    printed = said("diff", before, after, "--on", third, "--json --model", model)
    answer = json.loads(printed.out)
    assert answer["schema"] == "rig.diff/2"
    (change,) = answer["changes"]
    assert change["verdict"] == "moved"
    assert change["parameters"]["damping"] == pytest.approx(1.5, rel=0.1)
    assert answer["predicted"]["motor"]["as_b"] < answer["predicted"]["motor"]["with_a"]
    assert "Moved: friction.viscous damping of motor" in printed.err


@pytest.mark.integration
def test_too_few_runs_are_refused(tmp_path, model, said):
    words = ("diff", campaign(tmp_path / "a", 1, 5.0), campaign(tmp_path / "b", 2, 6.5), "--model")
    for name in ("0", "1"):
        (tmp_path / "b" / f"{name}.mcap").unlink()
    assert "3 runs, too few to compare" in said(*words, model, code=5).err
    for name in ("2", "3"):
        (tmp_path / "b" / f"{name}.mcap").unlink()
    printed = said(*words, model, code=5).err
    assert "The second campaign has 1 run, too few to compare" in printed
    assert "lap_s under [data.runs]" in printed
