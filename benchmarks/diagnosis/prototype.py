"""The joint decision core behind the command line of `rig diagnose`, to be measured like it.

`python -m benchmarks.diagnosis measure --prototype ...` asks this module. It goes when the core
replaces the search behind `rig diagnose`.
"""

import argparse
import json
from pathlib import Path

from estimation import model_file
from estimation.campaign import Campaign
from estimation.causes.verdict import diagnose
from estimation.diagnosis.split import split
from rig.importers.registry import open_campaign

REFERENCE_RIG = ("motor", "gearbox", "cable", "stretch")


def main() -> int:
    """Diagnose a folder of recordings and write the JSON answer."""
    parser = argparse.ArgumentParser(prog="prototype", description=__doc__)
    parser.add_argument("command", choices=["diagnose"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json-out", type=Path, help="the answer, rig.diagnosis/1")
    parser.add_argument("--model", type=Path, help="declared model; the reference rig's if none")
    parser.add_argument("--quick", action="store_true", help="no meaning here")
    options = parser.parse_args()
    recordings = list(open_campaign(options.folder).evidence)
    if options.model is None:
        models = [model_file.read(Path(name)) for name in REFERENCE_RIG]
    else:
        models = model_file.read_all(options.model)
    whole = list(Campaign.of(recordings).evidence)
    answer = diagnose(whole, models, split(whole)).to_json()
    if options.json_out is not None:
        options.json_out.write_text(json.dumps(answer))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
