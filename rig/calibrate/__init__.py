"""Guided calibrations on the rig: who sets up, what measures, and how the result is kept."""
