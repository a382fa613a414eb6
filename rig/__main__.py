"""Run the command line as `python -m rig`."""

from rig.cli.main import run

run()
