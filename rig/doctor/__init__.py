"""Devices, their faults and the next command: `rig devices`, `doctor`, `selftest`."""
