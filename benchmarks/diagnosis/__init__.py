"""How good `rig diagnose` is, version by version, on cases whose answer is known: `make measure`.

A generator yields cases (`case.py`); any checkout's `rig` executable is asked about each of them
(`asking.py`), its answers are kept and scored (`measure.py`), and one line a version and generator
goes to the results page (`page.py`). Only the command line and the JSON contract of `rig diagnose`
are relied on, so that old and new versions are measured alike.
"""
