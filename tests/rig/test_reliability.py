"""A small share of `make soak` and `make fuzz`, and that the two go on where they stopped."""

import pytest

from benchmarks.reliability import fuzz
from benchmarks.reliability.encoder_faults import FAULTS
from benchmarks.reliability.faults import SENSOR_FAULTS, inject
from benchmarks.reliability.targets import TARGETS
from drivers.registry import fakes
from drivers.transport.faulty import Fault

pytestmark = pytest.mark.integration


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_decoder_refuses_or_reads_right_whatever_comes(target):
    tally = fuzz.Tally()
    fuzz.run_block(target, 10**6, tally, size=150)
    assert tally.failures == []
    assert tally.inputs == 150
    good = [target.run(seed) for seed in target.seeds()]
    assert all(good), "an unharmed input is not accepted"


def test_faults_of_every_kind_are_detected_and_end_safe_in_time(library):
    kinds = len(SENSOR_FAULTS) + len(FAULTS) + 2 + len(Fault) * len(fakes())
    outcomes = list(inject(kinds, seed=5))
    assert len({outcome.kind for outcome in outcomes}) == kinds
    for outcome in outcomes:
        assert outcome.crash == ""
        assert outcome.detected, outcome
        of_a_link = " on the link of " in outcome.kind  # not every protocol tells faults apart
        assert outcome.named or of_a_link, outcome
        assert outcome.mis_stamped == 0, outcome
        silence = outcome.kind in ("host killed", "cable cut")
        if outcome.safe_after_s is not None:
            assert outcome.safe_after_s <= (0.052 if silence else 0.020), outcome
    assert sum(outcome.safe_after_s is not None for outcome in outcomes) == len(SENSOR_FAULTS) + 2
