"""Protocol files: expansion into runs, shipped protocols, errors that name the key."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.errors import UsageError
from rig.protocols import trajectory
from rig.protocols.protocol import load_protocol


def test_the_reference_protocol_is_fifty_runs_of_twenty_seconds():
    plans = load_protocol("reference").plans()
    assert len(plans) == 50
    assert {plan.duration_s for plan in plans} == {20.0}
    conditions = {(p.conditions["frequency_hz"], p.conditions["load_command_a"]) for p in plans}
    assert len(conditions) == 50
    assert len({plan.name for plan in plans}) == 50


@pytest.mark.parametrize("name", ["reference", "thorough", "quick", "diagnosis"])
def test_shipped_plans_are_whole_and_move_the_spindle_without_jumps(name):
    for plan in load_protocol(name).plans():
        assert plan.target_angle_rad.shape == plan.load_command_a.shape
        assert np.isfinite(plan.target_angle_rad).all()
        # 4 rad/s is more than any shipped run asks for; a jump would be a missing ramp
        assert np.abs(np.diff(plan.target_angle_rad)).max() * trajectory.SAMPLE_RATE_HZ < 4.0


@given(st.floats(-1.5, 0.5), st.floats(0.1, 0.8), st.floats(0.05, 1.0))
def test_a_sine_opens_at_its_start_and_closes_by_twice_its_amplitude(start, amplitude, frequency):
    angle = trajectory.sine(4.0 / frequency, start, amplitude, frequency)
    assert angle[0] == pytest.approx(start)
    assert angle.min() == pytest.approx(start, abs=1e-3)
    assert angle.max() == pytest.approx(start + 2 * amplitude, abs=1e-3)


@given(st.lists(st.floats(0.02, 2.0), min_size=1, max_size=4))
def test_a_speed_staircase_holds_each_speed(speeds):
    angle = trajectory.speed_staircase(-1.0, 0.5, speeds, 0.2)
    rate = np.diff(angle) * trajectory.SAMPLE_RATE_HZ
    for speed in speeds:
        assert np.isclose(rate, speed, rtol=1e-6).sum() >= 0.9 * 0.5 / speed * 1000 - 2
    assert angle[0] == angle[-1] == -1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "x"\n[[runs]]\nkind = "sine"\nfrequencies_hz = [0.1]\n', "loads_a"),
        (
            'name = "x"\n[[runs]]\nkind = "sine"\nfrequency_hz = [0.1]\nloads_a = [1]\n',
            "did you mean 'frequencies_hz'",
        ),
        ('name = "x"\n[[runs]]\nkind = "sin"\n', "sine"),
        ('name = "x"\nruns = []\n', "runs"),
        ('name = "x"\n[[runs]]\nkind = "sine"\nfrequencies_hz = [nan]\nloads_a = [1]\n', "finite"),
        ("name = ", "not TOML"),
    ],
)
def test_a_wrong_file_is_refused_with_the_key(tmp_path, text, message):
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=message):
        load_protocol(str(path))


def test_an_unknown_protocol_lists_the_shipped_ones():
    with pytest.raises(UsageError, match="quick, reference, still, thorough"):
        load_protocol("referense")


def test_a_folder_of_a_shipped_protocols_name_does_not_hide_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick").mkdir()  # as `rig record -p quick -o quick` makes it
    assert load_protocol("quick").name == "quick"
