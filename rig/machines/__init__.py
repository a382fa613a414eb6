"""The machine of a session, its readings and its limits."""
