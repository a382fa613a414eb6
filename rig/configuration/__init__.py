"""The configuration of a rig: its file, what is checked in it, and the files that are shipped."""
