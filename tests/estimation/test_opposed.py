"""A drive whose sign contradicts the motion is named before its parameters are believed."""

import numpy as np
import pytest

from estimation.campaign import Campaign
from estimation.causes.equations import LayoutError
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from estimation.fitting import fit
from estimation.opposed import opposed
from estimation.recording import Recording
from tests.estimation.causes.synthetic import axis, turning


@pytest.fixture(scope="module")
def sound() -> list[Recording]:
    return turning(lambda angle, speed, acceleration: np.zeros(len(angle)))


def _negated(runs: list[Recording], channel: str) -> list[Recording]:
    return [run.with_columns(**{channel: -run[channel]}) for run in runs]


def _opposed(runs: list[Recording]) -> str:
    campaign = Campaign.of(runs)
    return opposed(fit(axis(), campaign, bootstrap=0), campaign)


def test_a_sound_machine_has_no_channel_of_the_opposite_sign(sound: list[Recording]) -> None:
    assert _opposed(sound) == ""


@pytest.mark.parametrize("channel", ["crank_torque_n_m", "crank_angle_rad"])
def test_the_drive_is_named_where_either_sign_is_wrong(
    sound: list[Recording], channel: str
) -> None:
    assert _opposed(_negated(sound, channel)).startswith("crank_torque_n_m has the opposite sign")


def test_no_cause_is_sought_where_a_sign_is_wrong(sound: list[Recording]) -> None:
    runs = _negated(sound, "crank_torque_n_m")
    with pytest.raises(LayoutError, match="opposite sign"):
        diagnose(runs, [axis()], split(runs))
