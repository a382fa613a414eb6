"""The Teensy logger: its frames, its driver and its fake."""
