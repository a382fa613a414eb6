"""Readers of recordings, one file a format, found by the entry point group `rig.importers`."""
