"""`rig study payload` on the measured runs with and without a mass."""

import numpy as np
import pytest

from estimation.arm.motion import motion_of
from estimation.arm.payload import carried_torque
from estimation.arm.regressor import names, regressor
from estimation.arm.tables import PSM, PointMass
from estimation.recording import Recording
from rig.arm.payload import find_payload
from rig.arm.simulated import draw_arm
from rig.errors import DataError
from tests.rig.arms import RATE_HZ, psm_recording, waving

pytestmark = pytest.mark.long

pytest.importorskip("pinocchio", reason="Pinocchio is not installed (extra arm)")


@pytest.mark.measured
def test_the_measured_mass_is_found_and_none_where_there_is_none(measured_data, tmp_path, answered):
    if not (measured_data / "psm").is_dir():
        pytest.skip(f"no arm data at {measured_data / 'psm'}")
    out = tmp_path / "payload.md"
    words = ("study payload --on one19_insertion_105g --on one19 --out", out)
    with_mass, without = answered(*words, "--data", measured_data / "psm")["masses"]
    assert with_mass["mass_kg"] == pytest.approx(0.105, rel=0.03)
    assert abs(without["mass_kg"]) < 0.002
    assert "| one19_insertion_105g |" in out.read_text()


ARM = draw_arm(np.random.default_rng(3)).values


def made_run(name: str, seconds: float, period_s: float, mass_kg: float = 0.0) -> Recording:
    """A run of an arm that its model knows wholly, with a mass on its second link."""
    rng = np.random.default_rng(int(10 * period_s))
    position = waving(seconds, 1 / period_s, 0.2, rng)
    motion = motion_of(position, 1 / RATE_HZ)
    loaded = PSM.with_payload(PointMass("weight", 2, (0.01, 0.535, -0.02), mass_kg))
    torque = regressor(PSM, motion) @ ARM + carried_torque(loaded, motion)
    torque += 0.002 * np.ptp(torque, axis=0) * rng.normal(size=torque.shape)
    return psm_recording(name, position, motion.velocity, torque, RATE_HZ)


def test_a_mass_is_found_at_any_speed_even_where_a_run_repeats_only_twice():
    assert len(ARM) == len(names(PSM))
    fitted = made_run("without", 40.0, 8.0)
    runs = [
        made_run("fast", 30.0, 5.0, 0.08),
        made_run("slow", 30.0, 13.0, 0.2),
        made_run("nothing", 30.0, 6.5),
    ]
    masses = find_payload(fitted, runs, 0.535, 0.005).masses
    for run, true, found in zip(runs, (0.08, 0.2, 0.0), masses, strict=True):
        low, high = found.interval_kg
        assert found.mass_kg == pytest.approx(true, rel=0.03, abs=0.002), run.name
        assert low < true < high, run.name


def test_a_mass_mounted_elsewhere_is_refused_and_not_misread():
    fitted = made_run("without", 40.0, 8.0)
    with pytest.raises(DataError, match=r"one19_parallel_105g.*parallel.*not modelled"):
        find_payload(fitted, [made_run("one19_parallel_105g", 30.0, 5.0, 0.1)], 0.535, 0.005)


def test_a_run_named_twice_is_refused(said):
    assert "named twice" in said("study payload --data . --on two18", code=2).err
