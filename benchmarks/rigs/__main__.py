"""Draw a case to a folder: `python -m benchmarks.rigs --seed 5 --kind strong --out DIR`.

The logs go to DIR/runs and the answer to DIR/answer.json, so that DIR/runs can be diagnosed blind.
"""

import argparse
import json
import sys
from pathlib import Path

from benchmarks.diagnosis.case import write_recordings
from benchmarks.rigs import KINDS, draw
from estimation.files import write_text_atomic
from rig.errors import RigError


def main() -> int:
    """Draw the case that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rigs", description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--kind", choices=KINDS, required=True)
    parser.add_argument("--out", type=Path, required=True, help="Folder; made if missing.")
    parser.add_argument("--gear-ratio", type=float, help="Instead of the drawn one.")
    asked = parser.parse_args()
    runs = asked.out / "runs"
    try:
        case = draw(asked.seed, asked.kind, gear_ratio=asked.gear_ratio)
        write_recordings(runs, case.recordings)
    except RigError as error:
        sys.stderr.write(f"{error}\n")
        return int(error.exit_code)
    answer = json.dumps(case.describe(), indent=1, default=str)
    write_text_atomic(asked.out / "answer.json", answer + "\n")
    sys.stdout.write(f"{len(case.stage.plans)} runs in {runs}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
