"""What is there, what is wrong with it, and what to type: `rig devices`, `doctor`, `selftest`."""
