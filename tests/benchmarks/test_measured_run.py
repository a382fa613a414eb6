"""The simulated rig against a measured run of the reference rig."""

import pytest

from benchmarks.measured_run import compare
from rig.importers.registry import open_campaign

pytestmark = pytest.mark.integration


@pytest.mark.measured
def test_a_simulated_run_looks_like_the_measured_one(measured_data):
    """0.3 Hz against load 0.5: the spread of each channel within 30 % of the measured run's.

    Three channels are held to less. Distal torque varies along the stroke on the reference rig and
    not in the simulation, so its level is compared. The twist of the gear lacks the measured lost
    motion and wave: 40 %. The simulated controller follows more closely than the reference rig's,
    so its error is only bounded.
    """
    campaign = open_campaign(measured_data / "mrdlab-Tool_4_Maryland_L_4.tar.xz")
    recording = campaign.select(["24"]).runs[0].recording()
    assert recording.conditions["frequency_hz"] == pytest.approx(0.3, abs=0.01)
    measured, simulated = compare(recording)
    spread = ("motor_current_a", "proximal_torque_n_m", "spindle_angle_rad", "jaw_angle_rad")
    for name in spread:
        assert simulated[name].span == pytest.approx(measured[name].span, rel=0.3), name
    for name in ("motor_current_a", "proximal_torque_n_m", "distal_torque_n_m", "jaw_angle_rad"):
        assert simulated[name].high == pytest.approx(measured[name].high, rel=0.3), name
    twist, distal, error = "gear_twist_rad", "distal_torque_n_m", "tracking_error_rad"
    assert simulated[twist].span == pytest.approx(measured[twist].span, rel=0.4)
    assert simulated[distal].middle == pytest.approx(measured[distal].middle, rel=0.3)
    assert simulated[error].span < measured[error].span
