"""maxon ESCON 24/2: no data bus, so its driver is wiring and scaling at the Teensy."""
