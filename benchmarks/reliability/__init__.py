"""How reliable the rig is: soak, injected faults, killed recorders, fuzzed decoders; one table."""
