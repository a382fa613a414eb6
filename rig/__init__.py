"""The application: command line, session, recording, live display, simulated rig, reports."""

__version__ = "0.1.0"
