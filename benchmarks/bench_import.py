"""How long a 60 MB folder of MRDLab text takes to import, against pandas' C reader.

The importer does more than the baseline: signs, units, checks, fits and flags. It has to make up
for that while parsing.
"""

import sys
import tarfile
import tempfile
from pathlib import Path

from benchmarks.ratio import Ratio, best_of

FOLDER = "Tool_4_Maryland_L_4"


def measure() -> list[Ratio]:
    """Time both on the same unpacked files; an empty list where the data is absent."""
    import os

    import pandas

    from rig.importers.mrdlab import IMPORTER

    root = Path(__file__).resolve().parents[1]
    data = Path(os.environ.get("RIG_DATA", root.parent / "shared" / "data"))
    archive = data / f"mrdlab-{FOLDER}.tar.xz"
    if not archive.is_file():
        sys.stderr.write(f"bench_import skipped: no {archive} (set RIG_DATA to its folder)\n")
        return []
    with tempfile.TemporaryDirectory() as temporary:
        with tarfile.open(archive) as tar:
            tar.extractall(temporary, filter="data")
        folder = next(Path(temporary).rglob("00.TXT")).parent
        files = sorted(folder.glob("*.TXT"))
        megabytes = sum(file.stat().st_size for file in files) / 1e6

        def by_pandas() -> None:
            for file in files:
                pandas.read_csv(file, engine="c", comment="%", header=None)

        def by_rig() -> None:
            for _ in IMPORTER.open(folder):
                pass

        by_rig()  # compile, and fill the page cache for both
        # alternate, so that a change of the processor's clock meets both
        times = [(best_of(by_pandas, 1), best_of(by_rig, 1)) for _ in range(7)]
        pandas_s, rig_s = (min(column) for column in zip(*times, strict=True))
    return [
        Ratio(
            "MRDLab import over pandas' C reader",
            pandas_s / rig_s,
            1.0,
            detail=f"{len(files)} runs, {megabytes:.0f} MB: rig {rig_s:.2f} s, "
            f"pandas {pandas_s:.2f} s",
        )
    ]
