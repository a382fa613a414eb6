"""Guided calibrations, one file per kind: their steps and their conclusions."""
