"""A wrist built with a wrong pulley ratio: the real diagnosis finds the coupling of equation 5."""

import pytest

from rig.grasper.wrist_plant import Wrist

pytestmark = pytest.mark.integration


@pytest.fixture
def diagnosed(tmp_path, said, answered):
    """Diagnose recordings of a wrist with a pulley ratio."""

    def run(pulley_ratio):
        said("grasper record --seed 3 --runs 9 --pulley-ratio", pulley_ratio, "-o", tmp_path / "a")
        return answered("diagnose", tmp_path / "a", "--ledger", tmp_path / "ledger")

    return run


@pytest.mark.long
def test_a_wrong_pulley_ratio_is_found_from_a_folder_of_recordings(diagnosed):
    told = diagnosed("1.1")
    assert set(told["rmse_before"]) == {"grasp", "pitch", "yaw"}
    (finding,) = told["findings"]
    assert (finding["balance"], finding["family"]) == ("pitch", "coupling.kinematic")
    # a share of the other joint's reading is the same equation
    assert set(finding["alternatives"]) <= {"sensor.crosstalk"}
    ratio = finding["parameters"]["ratio"]
    built = Wrist(1.1).built.jacobian
    assert ratio["value"] == pytest.approx(built[1, 0] / built[0, 0], rel=0.05)


@pytest.mark.long
def test_the_right_pulley_ratio_lacks_nothing(diagnosed):
    assert diagnosed("1.0")["findings"] == []


def test_designs_are_listed_with_the_most_compact_one(answered):
    told = answered("grasper designs")
    assert len(told["designs"]) == 27
    assert told["most_compact"]["drive"] == "carrier"
    assert told["most_compact"]["planetary"] == {"gear_ratio": 1.0, "sun_over_carrier": 0.0}
