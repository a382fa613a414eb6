"""The Teensy logger: its frames, its driver, and the fake that speaks for it."""
