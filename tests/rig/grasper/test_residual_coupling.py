"""A wrist built with a wrong pulley ratio: the real diagnosis finds the coupling of equation 5."""

import json

import pytest

from rig.cli.main import main
from rig.grasper.wrist_plant import Wrist

pytestmark = pytest.mark.integration


def diagnosed(folder, *, pulley_ratio, seed=3):
    words = [
        "-o",
        str(folder),
        "--pulley-ratio",
        str(pulley_ratio),
        "--seed",
        str(seed),
        "--runs",
        "9",
    ]
    assert main(["grasper", "record", *words]) == 0
    told = folder.with_suffix(".json")
    ledger = folder.with_suffix(".ledger")
    assert main(["diagnose", str(folder), "--json-out", str(told), "--ledger", str(ledger)]) == 0
    return json.loads(told.read_text())


def test_a_wrong_pulley_ratio_is_found_from_a_folder_of_recordings(tmp_path):
    told = diagnosed(tmp_path / "wrong", pulley_ratio=1.1)
    assert set(told["rmse_before"]) == {"grasp", "pitch", "yaw"}
    (finding,) = told["findings"]
    assert (finding["balance"], finding["family"]) == ("pitch", "coupling.kinematic")
    # a share of the other joint's reading is the same equation
    assert set(finding["alternatives"]) <= {"sensor.crosstalk"}
    ratio = finding["parameters"]["ratio"]
    built = Wrist(1.1).built.jacobian
    assert ratio["value"] == pytest.approx(built[1, 0] / built[0, 0], rel=0.05)


@pytest.mark.long
def test_the_right_pulley_ratio_lacks_nothing(tmp_path):
    assert diagnosed(tmp_path / "right", pulley_ratio=1.0)["findings"] == []


def test_designs_are_listed_with_the_most_compact_one(capsys):
    assert main(["grasper", "designs", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["designs"]) == 27
    assert told["most_compact"]["drive"] == "carrier"
    assert told["most_compact"]["planetary"] == {"gear_ratio": 1.0, "sun_over_carrier": 0.0}
