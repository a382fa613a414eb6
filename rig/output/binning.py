"""Values over bins of a variable."""

import numpy as np

from estimation.recording import FloatArray


def binned(
    x: FloatArray, y: FloatArray, bins: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return bin centres, mean, 5th and 95th percentile of y over bins of x.

    Args:
        x: The variable, shape (n,).
        y: The values, shape (n,).
        bins: Bins over the middle 98 % of x; those with under ten samples are left out.
    """
    low, high = np.percentile(x, [1, 99])
    edges = np.linspace(low, high if high > low else low + 1.0, bins + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    full = [k for k in range(bins) if np.count_nonzero(place == k) >= 10]
    parts = [y[place == k] for k in full]
    centres = (edges[:-1] + edges[1:])[full] / 2
    mean = np.array([part.mean() for part in parts])
    spread = np.array([np.percentile(part, [5, 95]) for part in parts]).reshape(-1, 2)
    return centres, mean, spread[:, 0], spread[:, 1]
