"""maxon EPOS4 over CANopen: its objects, its driver, and the fake."""
