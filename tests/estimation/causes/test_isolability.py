"""The effects that runs can distinguish, before any of them is found."""

from functools import cache

import pytest

from estimation.causes.isolability import NOTHING, Isolable, isolability
from estimation.recording import Recording
from tests.estimation.causes.synthetic import motor, recordings


def _at_one_load(runs: list[Recording]) -> list[Recording]:
    return [run for k, run in enumerate(runs) if k % 3 == 0]


@cache
def _effects(one_load: bool) -> dict[tuple[str, str], Isolable]:
    runs = recordings(runs=18 if one_load else 6)
    found = isolability([motor()], _at_one_load(runs) if one_load else runs)
    return {(one.place, one.family): one for one in found}


def test_a_ripple_is_distinguished_and_what_declared_terms_can_express_is_not_seen() -> None:
    found = _effects(one_load=False)
    for one in found.values():
        assert abs(one.share + sum(one.others.values()) - 1.0) < 1e-6
    assert found["motor", "ripple.motor"].share > 0.5
    assert found["motor", "friction.coulomb_asymmetry"].others.get(NOTHING, 0.0) > 0.5


@pytest.mark.long
def test_several_loads_make_the_saturation_of_a_motor_easier_to_name() -> None:
    one, several = (_effects(k)["actuator motor_current_a", "motor.saturation"] for k in (1, 0))
    assert several.share > one.share
