"""The place of the lowest value of a moving window."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from estimation.derived import ALIKE, lowest, since_lowest

STEPS = st.lists(st.integers(-3, 3), min_size=1, max_size=60)


@given(STEPS, st.integers(1, 12))
def test_it_is_the_last_of_the_lowest(steps, window):
    values = np.cumsum(np.array(steps, float))
    for k, place in enumerate(lowest(values, window)):
        part = values[max(0, k - window + 1) : k + 1]
        assert values[place] == part.min()
        assert place == k - np.argmin(part[::-1])
    np.testing.assert_array_equal(
        since_lowest(values, window), values - values[lowest(values, window)]
    )


@given(STEPS, st.integers(1, 12), st.randoms(use_true_random=False))
def test_rounding_does_not_move_it_on_a_drive_at_rest(steps, window, random):
    values = 0.01 * np.cumsum(np.array(steps, float))
    rounded = values + np.array([random.uniform(-1e-13, 1e-13) for _ in steps])
    np.testing.assert_array_equal(lowest(rounded, window, ALIKE), lowest(values, window, ALIKE))
