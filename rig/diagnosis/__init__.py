"""Diagnosing recordings: what `rig diagnose` reads, writes and remembers."""
