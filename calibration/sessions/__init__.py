"""Guided calibrations, one file a kind: their steps, and what their measurements say."""
