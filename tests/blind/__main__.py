"""`python -m tests.blind`: the blind study from the command line."""

import sys

from rig.cli.main import app, main
from tests.blind.run import blind

# as a verb of `rig`, for its errors and exit codes
app.command("blind")(blind)
sys.exit(main(["blind", *sys.argv[1:]]))
