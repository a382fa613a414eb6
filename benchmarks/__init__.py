<<<<<<< HEAD
"""Ratios against named baselines, measured in one run: `make bench`."""
=======
"""Benchmarks: each file measures one thing as a ratio within one run."""
>>>>>>> drivers
