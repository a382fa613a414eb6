"""Benchmarks: each file measures one thing as a ratio within one run."""
