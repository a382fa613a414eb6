"""Arms: simulated, identified, excited and carrying a payload, on the recordings of any arm."""
